"""Simulated lifts of a network's best grasps: a free-flying gripper executes each in its own scene.

Scenes are built once and kept, so that a validation costs only the lifts.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import FloatArray
from mpgrasp.grasp import GraspMap, best_pixel
from mpgrasp.motion.lift_trial import LiftRig
from mpgrasp.outcome import Outcome
from mpgrasp.training.augmentation import Sample
from mpgrasp.training.data.views import make_scene, stored_intrinsics, stored_pose
from mpgrasp.training.dataset import GraspDataset


class LiftCheck:
    """Grasps in the scenes that the images of `dataset` show."""

    def __init__(self, dataset: GraspDataset) -> None:
        self._dataset = dataset
        self._rigs: dict[tuple[int, int], LiftRig] = {}

    def lifts(
        self,
        index: int,
        truth: Sample,
        quality: NDArray[np.float32],
        angle: NDArray[np.float32],
        width: NDArray[np.float32],
    ) -> bool:
        """True if the best grasp of the maps (H, W), angles [rad], widths [px], lifts an object.

        Args:
            index: which image of the data set.
            truth: that image at the maps' size; its depth is what the grasp's position comes from.
            quality: highest where to grasp.
            angle: closing direction in the image [rad].
            width: opening [px].

        Raises:
            ConfigError: the shards tell neither scene nor pose.
        """
        size = len(quality)
        grasps = GraspMap(
            quality=quality,
            angle=angle,
            width=width,
            depth=truth.depth,
            intrinsics=stored_intrinsics().resize(size, size),
            T_world_camera=_pose(self._dataset, index),
        )
        return self._rig(index).attempt(grasps.grasp_at(*best_pixel(quality))).outcome == Outcome.SUCCESS

    def _rig(self, index: int) -> LiftRig:
        scene = self._dataset.scene(index)
        if scene not in self._rigs:
            self._rigs[scene] = LiftRig(make_scene(*scene)[0])
        return self._rigs[scene]


def images_to_lift(dataset: GraspDataset, images: NDArray[np.intp], count: int) -> list[int]:
    """Return `count` of the images that have a labelled grasp, of as many scenes as possible.

    Raises:
        ConfigError: the shards tell neither scene nor pose.
    """
    graspable = [int(i) for i in images if dataset.sample(int(i)).quality.any()]
    first: dict[tuple[int, int], int] = {}
    for i in graspable:
        _pose(dataset, i)
        first.setdefault(dataset.scene(i), i)
    others = [i for i in graspable if i not in first.values()]
    return [*first.values(), *others][:count]


def _pose(dataset: GraspDataset, index: int) -> FloatArray:
    try:
        return stored_pose(dataset.meta[index], dataset.columns)
    except KeyError as error:
        raise ConfigError(
            f"shards without the camera's {error}", got=dataset.columns, allowed="data with it, or no lifts"
        ) from error
