"""Laws of lifts in validation: a grasp is executed where the camera saw it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from toy_shards import CAMERA

from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import line_angle_difference
from mpgrasp.grasp import Grasp
from mpgrasp.motion.lift_trial import LiftResult
from mpgrasp.outcome import Outcome
from mpgrasp.training import lifts
from mpgrasp.training.dataset import GraspDataset
from mpgrasp.training.lifts import images_to_lift


def test_shards_without_poses_cannot_be_lifted(shards: Path) -> None:
    dataset = GraspDataset([shards])
    dataset.columns[dataset.columns.index("turn_x")] = "other"
    with pytest.raises(ConfigError, match="turn_x"):
        images_to_lift(dataset, np.arange(80), 4)


def test_lifts_are_spread_over_scenes(shards: Path) -> None:
    dataset = GraspDataset([shards])
    dataset.meta[:, dataset.columns.index("scene")] //= 2  # two images a scene
    chosen = images_to_lift(dataset, np.arange(80), 50)
    assert len(set(chosen)) == 50
    assert {dataset.scene(i) for i in chosen[:40]} == {(0, k) for k in range(40)}


def test_the_best_grasp_is_executed_where_the_camera_saw_it(
    shards: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tried: list[Grasp] = []

    class Rig:
        def __init__(self, scene: tuple[int, int]) -> None:
            made.append(scene)

        def attempt(self, grasp: Grasp) -> LiftResult:
            tried.append(grasp)
            return LiftResult(outcome=Outcome.SUCCESS if len(tried) == 1 else Outcome.MISSED, reason="")

    made: list[tuple[int, int]] = []
    monkeypatch.setattr(lifts, "make_scene", lambda seed, index: ((seed, index), None))
    monkeypatch.setattr(lifts, "LiftRig", Rig)
    dataset = GraspDataset([shards])
    truth = dataset.sample(3)
    quality = np.zeros((64, 64), np.float32)
    quality[20, 50] = 0.8
    angle, width = np.full_like(quality, 0.25), np.full_like(quality, 10.0)
    check = lifts.LiftCheck(dataset)
    assert check.lifts(3, truth, quality, angle, width)
    assert not check.lifts(3, truth, quality, angle, width)
    assert made == [(0, 3)]
    # by hand: 350 of the sensor's pixels at 385 px focal length in 64 px, seen from 0.4 m at heading 0.3
    z = float(truth.depth[20, 50])
    right, down = (z * (k + 0.5 - 32) * 350 / 64 / 385 for k in (50, 20))
    x_axis, y_axis = (CAMERA[:3, k] for k in range(2))
    expected = CAMERA[:3, 3] + right * x_axis + down * y_axis + z * np.array([0, 0, -1])
    assert np.allclose(tried[0].position, expected, atol=1e-3)
    assert tried[0].width == pytest.approx(10 * z * 350 / 64 / 385, rel=1e-3)
    closing = np.cos(0.25) * x_axis - np.sin(0.25) * y_axis
    assert line_angle_difference(tried[0].angle, np.arctan2(closing[1], closing[0])) < 1e-6
