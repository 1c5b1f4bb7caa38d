"""The oracle: grasps of the true height map, looked up where each pixel of the view meets the scene.

It is the ceiling of every detector and the proof that world, robot and controllers are sound. It sees the
same frames as the networks, noise included, but only to know where its pixels lie.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mpgrasp.depth import DepthFrame, inpaint
from mpgrasp.detectors.antipodal.analysis import WorldGrasps, antipodal_grasps
from mpgrasp.detectors.central_square import central_square, empty_map, says_something
from mpgrasp.detectors.config import OracleConfig
from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import FloatArray
from mpgrasp.grasp import GraspMap, world_to_image_angle
from mpgrasp.height_map import HeightMap

SILENT = 0.05
"""Quality below which an object counts as having no grasp."""
TOP = 0.003
"""Part of such an object's height that counts as its top [m]."""


class OracleDetector:
    """Detector that reads the truth.

    Args:
        config: geometry of the gripper, and how sure its grasps must be.
    """

    name = "oracle"
    reads_truth = True

    def __init__(self, config: OracleConfig | None = None) -> None:
        self.config = config or OracleConfig()
        self._grasps: WorldGrasps | None = None

    def reset(self, truth: HeightMap | None) -> None:
        """Analyse the true shape of the scene.

        Raises:
            ConfigError: without a truth.
        """
        if truth is None:
            raise ConfigError(
                "the oracle was not told the true shape", allowed="reset(truth) with a height map"
            )
        self._grasps = _with_tops(antipodal_grasps(truth, self.config), self.config)

    def predict(self, frame: DepthFrame) -> GraspMap:
        """Return grasps of the frame's central square; pixels without depth have none.

        Raises:
            ConfigError: before the first `reset`.
        """
        if self._grasps is None:
            raise ConfigError("the oracle has no scene", allowed="reset(truth) before predict")
        image = central_square(frame)
        measured, filled = np.isfinite(image.depth), inpaint(image.depth)
        if not says_something(frame, image):
            return replace(empty_map(replace(image, depth=filled)), measured=measured)
        seen = grasps_in_view(self._grasps, image, known=measured, depth=filled)
        return replace(seen, measured=measured)


def _with_tops(grasps: WorldGrasps, config: OracleConfig) -> WorldGrasps:
    """Return grasps in which objects that have none, or hardly any, are taken by their tops where that goes.

    A bowl upside down is too wide for the hand and its wall too slanted, but its foot is not: the top of such
    an object counts as all of it, the rest as support, and the fingers come down as near as they may.
    """
    truth = grasps.height_map
    label = truth.label.copy()
    for k in np.unique(label[label > 0]):
        of_object = truth.label == k
        if grasps.quality[of_object].max() < SILENT:
            label[of_object & (truth.height < truth.height[of_object].max() - TOP)] = 0
    if (label == truth.label).all():
        return grasps
    nearest = replace(config, margin=(config.margin[0], config.margin[0] + 1e-6))
    tops = antipodal_grasps(replace(truth, label=label), nearest)
    changed = np.isin(truth.label, np.unique(truth.label[label != truth.label])) & (label > 0)
    better = changed & (tops.quality > grasps.quality)
    return replace(
        grasps,
        quality=np.where(better, tops.quality, grasps.quality),
        angle=np.where(better, tops.angle, grasps.angle),
        width=np.where(better, tops.width, grasps.width),
    )


def grasps_in_view(
    grasps: WorldGrasps,
    image: DepthFrame,
    *,
    known: np.ndarray | None = None,
    depth: FloatArray | None = None,
) -> GraspMap:
    """Return world grasps as seen in an image: nearest cell under every pixel, nothing interpolated.

    Args:
        grasps: of the scene.
        image: a depth frame of (H, W) pixels of a camera that looks down.
        known: (H, W) where grasps may be; everywhere by default.
        depth: (H, W) [m] to use in place of the image's, such as a filled one.
    """
    depth = image.depth if depth is None else np.asarray(depth, np.float32)
    result = GraspMap(
        quality=np.zeros_like(depth),
        angle=np.zeros_like(depth),
        width=np.zeros_like(depth),
        depth=depth,
        intrinsics=image.intrinsics,
        T_world_camera=image.T_world_camera,
        time=image.time,
    )
    row, col, inside = grasps.height_map.cells(*result.world_coordinates(0, 1))
    cell = row * grasps.quality.shape[1] + col
    quality = grasps.quality.take(cell)
    quality[~inside if known is None else ~(inside & known)] = 0
    found = np.flatnonzero(quality > 0)
    cell = cell.take(found)
    result.quality.flat[found] = quality.take(found)
    result.angle.flat[found] = world_to_image_angle(grasps.angle.take(cell), image.T_world_camera)
    result.width.flat[found] = grasps.width.take(cell) * image.intrinsics.fx / depth.take(found)
    return result
