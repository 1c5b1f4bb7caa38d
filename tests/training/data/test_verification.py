"""Laws of the lifts behind the labels, on a stick whose lifts are decided by the test."""

from __future__ import annotations

import numpy as np
import pytest
from height_maps import Solid, height_map

from mpgrasp.detectors.antipodal.analysis import WorldGrasps, antipodal_grasps
from mpgrasp.exceptions import SimulationError
from mpgrasp.geometry import line_angle_difference
from mpgrasp.grasp import Grasp
from mpgrasp.outcome import Outcome
from mpgrasp.scene.config import SceneConfig
from mpgrasp.scene.scene import build_scene
from mpgrasp.training.data import verification as v
from mpgrasp.training.data.data_card import lift_table
from mpgrasp.training.data.verification import (
    GOOD,
    TRIAL_COLUMNS,
    Verified,
    draw_negatives,
    draw_positives,
    verify,
)

STICKS = (
    Solid(x=0.50, y=0.02, yaw=0.3, length=0.12, breadth=0.02, height=0.02),
    Solid(x=0.52, y=-0.12, yaw=-0.6, length=0.10, breadth=0.02, height=0.010),
)


@pytest.fixture(scope="module")
def grasps() -> WorldGrasps:
    return antipodal_grasps(height_map(*STICKS))


def lifted_by(outcome: Outcome, grasps: WorldGrasps, seed: int = 0) -> Verified:
    return verify(None, grasps, np.random.default_rng(seed), index=7, lift=lambda grasp: outcome)  # type: ignore[arg-type]


def columns(verified: Verified) -> dict[str, np.ndarray]:
    return dict(zip(TRIAL_COLUMNS, verified.trials.T, strict=True))


def test_what_lifts_leaves_the_labels_as_they_were(grasps: WorldGrasps) -> None:
    verified = lifted_by(Outcome.SUCCESS, grasps)
    assert np.array_equal(verified.grasps.quality, grasps.quality)
    told = columns(verified)
    assert told["lifted"].all()
    assert np.allclose(told["shipped"][told["positive"] > 0], told["quality"][told["positive"] > 0])


def test_what_fails_lowers_the_labels_around_it_and_nothing_else(grasps: WorldGrasps) -> None:
    truth = grasps.height_map
    row, col = map(int, np.unravel_index(grasps.quality.argmax(), grasps.quality.shape))
    grasp = v._grasp_at(grasps, row, col)
    lost = v._Trial(row=row, col=col, grasp=grasp, positive=True, outcome=Outcome.SLIPPED)
    after = v.corrected(grasps, [lost]).quality
    assert after[row, col] < 0.25 * grasps.quality[row, col]
    rows, cols = np.indices(after.shape)
    distance = np.hypot(rows - row, cols - col) * truth.cell
    mine = truth.label == truth.label[row, col]
    near, far = mine & (distance < 0.006) & (grasps.quality > 0), mine & (distance > 0.03)
    aligned = line_angle_difference(grasps.angle, grasp.angle) < np.deg2rad(10)
    assert np.all(after[near & aligned] < 0.6 * grasps.quality[near & aligned])
    assert np.allclose(after[far], grasps.quality[far], rtol=1e-2)
    assert np.array_equal(after[~mine], grasps.quality[~mine])
    assert np.all(after <= grasps.quality)


def test_a_lift_nearby_protects_a_label_from_a_failure(grasps: WorldGrasps) -> None:
    row, col = map(int, np.unravel_index(grasps.quality.argmax(), grasps.quality.shape))
    grasp = v._grasp_at(grasps, row, col)
    lost, won = (
        v._Trial(row=row, col=col, grasp=grasp, positive=True, outcome=outcome)
        for outcome in (Outcome.MISSED, Outcome.SUCCESS)
    )
    alone, both = (v.corrected(grasps, trials).quality[row, col] for trials in ([lost], [lost, won]))
    assert alone < both < grasps.quality[row, col]


def test_positives_come_from_every_object_and_from_grasps_alone(grasps: WorldGrasps) -> None:
    cells = draw_positives(grasps, np.random.default_rng(1))
    assert len(cells) == v.POSITIVES
    assert all(grasps.quality[cell] > 0 for cell in cells)
    labels = {int(grasps.height_map.label[cell]) for cell in cells}
    assert labels >= {1, 2}
    qualities = [grasps.quality[cell] for cell in cells]
    assert max(qualities) - min(qualities) > 0.2


def test_negatives_lie_on_objects_where_nothing_closes_along_their_angle(grasps: WorldGrasps) -> None:
    rng = np.random.default_rng(2)
    for _ in range(10):
        for row, col, angle in draw_negatives(grasps.height_map, rng):
            label = int(grasps.height_map.label[row, col])
            assert label > 0
            # along the middle of a stick a grasp across it is no negative
            stick = STICKS[label - 1]
            x = grasps.height_map.x0 + col * grasps.height_map.cell - stick.x
            y = grasps.height_map.y0 + row * grasps.height_map.cell - stick.y
            along = x * np.cos(stick.yaw) + y * np.sin(stick.yaw)
            across = -x * np.sin(stick.yaw) + y * np.cos(stick.yaw)
            off = line_angle_difference(angle, stick.yaw + np.pi / 2)
            assert abs(along) > 0.03 or abs(across) > 0.004 or off > np.deg2rad(5)


def test_audits_are_fresh_and_good(grasps: WorldGrasps) -> None:
    for seed in range(5):
        told = columns(lifted_by(Outcome.SUCCESS, grasps, seed))
        audit = told["audit"] > 0
        assert audit.sum() == v.AUDITS
        assert np.all(told["shipped"][audit] >= GOOD)
        places = {(x, y) for x, y in zip(told["x"][~audit], told["y"][~audit], strict=True)}
        assert not any((x, y) in places for x, y in zip(told["x"][audit], told["y"][audit], strict=True))


def test_nothing_is_drawn_where_nothing_lies() -> None:
    verified = lifted_by(Outcome.SUCCESS, antipodal_grasps(height_map()))
    assert verified.trials.shape == (0, len(TRIAL_COLUMNS))


def test_the_record_says_what_was_tried(grasps: WorldGrasps) -> None:
    tried: list[Grasp] = []

    def lift(grasp: Grasp) -> Outcome:
        tried.append(grasp)
        return Outcome.MISSED

    verified = verify(None, grasps, np.random.default_rng(0), index=7, lift=lift)  # type: ignore[arg-type]
    told = columns(verified)
    assert np.all(told["scene"] == 7)
    assert np.allclose(np.column_stack([told[c] for c in "xyz"]), [g.position for g in tried])
    assert np.allclose(told["angle"], [g.angle for g in tried])
    assert not told["lifted"].any()
    assert {v.LIFT_OUTCOMES[int(k)] for k in told["outcome"]} == {"missed"}
    heights = told["thickness"][told["positive"] == 0]
    assert np.all(np.abs(heights[:, None] - [0.02, 0.01]).min(axis=1) < 1e-4)


def test_the_gripper_itself_lifts_a_plain_stick() -> None:
    scene = build_scene(SceneConfig(objects=("usb_stick",), cloth_unevenness=0.0), 0, robot=False)
    verified = verify(scene, antipodal_grasps(scene.height_map()), np.random.default_rng(0), index=0)
    told = columns(verified)
    good = (told["positive"] > 0) & (told["quality"] >= GOOD)
    assert good.any()
    assert told["lifted"][good].all()


def test_the_table_counts_by_thickness_and_kind() -> None:
    def row(**told: float) -> list[float]:
        return [told.get(name, 0.0) for name in TRIAL_COLUMNS]

    trials = np.array(
        [
            row(positive=1, quality=0.9, lifted=1, thickness=0.005),
            row(positive=1, quality=0.9, lifted=0, thickness=0.05),
            row(positive=0, lifted=1, thickness=0.05),
            row(positive=1, audit=1, quality=0.9, shipped=0.8, lifted=1, thickness=0.05),
        ]
    )
    lines = {line.split("|")[1].strip(): line.split("|")[2:5] for line in lift_table(trials).splitlines()[2:]}
    first = {name: [cell.split("=")[0].strip() for cell in cells] for name, cells in lines.items()}
    assert first["analytic positives, any quality"] == ["1/2", "1/1", "0/1"]
    assert first["analytic negatives"] == ["1/1", "none", "1/1"]
    assert first[f"shipped positives ({GOOD} or better)"] == ["1/1", "none", "1/1"]


def test_a_lift_that_the_simulator_breaks_off_is_no_trial_and_teaches_nothing(grasps: WorldGrasps) -> None:
    def broken(_: Grasp) -> Outcome:
        raise SimulationError("the simulator warned")

    verified = verify(None, grasps, np.random.default_rng(0), index=7, lift=broken)  # type: ignore[arg-type]
    assert verified.trials.shape == (0, len(TRIAL_COLUMNS))
    assert np.array_equal(verified.grasps.quality, grasps.quality)
