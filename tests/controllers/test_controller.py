"""The contract that every controller keeps."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from toy_ticks import NOTHING, OBJECT, THIN, blind_map, observe, same
from toy_views import Blob, flat_map, fly

from mpgrasp.controllers import CONTROLLERS, make_controller
from mpgrasp.controllers.config import PRESETS, ReachConfig, preset
from mpgrasp.controllers.controller import ControllerExtras, remember_failures, remembers_failures
from mpgrasp.controllers.grid_map import GridConfig
from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import looking_down
from mpgrasp.grasp import GraspMap

ALL = sorted(CONTROLLERS)


def settings_of(name: str) -> ReachConfig:
    """Settings that a controller has unless others are given."""
    controller: Any = make_controller(name)
    config: ReachConfig = controller.config
    return config


@pytest.mark.parametrize("name", ALL)
def test_a_controller_is_called_by_its_name(name: str) -> None:
    assert make_controller(name).name == name


def test_an_unknown_controller_or_preset_is_named_with_what_would_have_worked() -> None:
    with pytest.raises(ConfigError, match="mppc, mvp, mppc_robust, mvp_robust, open_loop"):
        make_controller("teleport")
    with pytest.raises(ConfigError, match="table1, published-grid, robust"):
        preset("napkin", "mvp")
    with pytest.raises(ConfigError, match="mvp, mppc"):
        preset("table1", "teleport")


@pytest.mark.parametrize("name", ALL)
@pytest.mark.parametrize("blob", [NOTHING, THIN], ids=["nothing", "thin"])
@pytest.mark.parametrize("settings", sorted(PRESETS))
@pytest.mark.parametrize("of", ["mvp", "mppc"])
def test_every_command_is_finite_bounded_and_the_last_one_is_done_and_still(
    name: str, blob: Blob, settings: str, of: str
) -> None:
    config = preset(settings, of)
    flight = fly(make_controller(name, config), blob, seed=1)
    for command in flight.commands:
        assert command.twist.shape == (6,)
        assert np.isfinite(command.twist).all()
        assert np.hypot(*command.twist[:2]) <= config.v_1 + 1e-9
        assert 0 <= -command.twist[2] <= max(config.v_z, config.v_1)
        assert not command.twist[3:5].any()
        assert abs(command.twist[5]) <= config.yaw_rate_max
        assert command.gripper == config.gripper_open
    assert [c.done for c in flight.commands] == [False] * (len(flight.commands) - 1) + [True]
    assert not flight.commands[-1].twist.any()


@pytest.mark.parametrize("name", ALL)
def test_the_same_seed_gives_the_same_commands_and_seed_zero_is_a_seed(name: str) -> None:
    controller = make_controller(name)
    first, second = (fly(controller, NOTHING, seed=0) for _ in range(2))
    assert all(same(a, b) for a, b in zip(first.commands, second.commands, strict=True))


@pytest.mark.parametrize("name", ALL)
def test_reset_forgets_the_last_episode(name: str) -> None:
    controller = make_controller(name)
    fly(controller, OBJECT)
    assert controller.final_grasp() is not None
    controller.reset(0)
    assert controller.final_grasp() is None
    assert controller.diagnostics() == {}


@pytest.mark.parametrize("name", ALL)
@pytest.mark.parametrize("view", [0.0, np.nan, blind_map()], ids=["empty", "nan", "blind"])
def test_a_map_that_says_nothing_yields_no_grasp_and_no_yaw(name: str, view: GraspMap | float) -> None:
    controller = make_controller(name)
    for height in (0.5, 0.3):
        command = controller.update(observe((0.4, 0.0, height), view))
        assert np.isfinite(command.twist).all()
        if name not in ("mppc", "mvp"):  # published ones grasp at the best of whatever was seen
            assert command.twist[5] == 0
            assert controller.final_grasp() is None
    if isinstance(view, GraspMap):  # nobody grasps where nothing was seen at all
        assert controller.final_grasp() is None


@pytest.mark.parametrize("name", ALL)
@pytest.mark.parametrize(
    "blob",
    [Blob(x=0.5, y=0.36, radius=0.008), Blob(x=0.155, y=0.0, radius=0.002)],
    ids=["beside", "before"],
)
def test_a_grasp_outside_of_the_workspace_is_never_taken(name: str, blob: Blob) -> None:
    controller = make_controller(name)
    grasps = []
    for _ in range(6):
        controller.update(observe((blob.x - 0.05, blob.y, 0.4), blob))
        grasps.append(controller.final_grasp())
    for grasp in grasps:
        assert grasp is None or max(abs(grasp.position[0] - 0.5), abs(grasp.position[1])) <= 0.34
    # the same object within the workspace is taken
    controller = make_controller(name)
    for _ in range(6):
        controller.update(observe((0.45, 0.0, 0.4), replace(blob, x=0.5, y=0.0, radius=0.008)))
    assert controller.final_grasp() is not None


@pytest.mark.parametrize("name", ALL)
def test_a_grasp_above_the_ceiling_or_below_the_table_is_never_taken(name: str) -> None:
    for surface in (0.2, -0.05):
        controller = make_controller(name)
        view = flat_map(0.9, looking_down([0.5, 0, 0.463]), surface=surface)
        controller.update(observe((0.43, 0.0, 0.4), view))
        assert controller.final_grasp() is None
    controller = make_controller(name)
    view = flat_map(0.9, looking_down([0.5, 0, 0.463]), surface=0.05)
    controller.update(observe((0.43, 0.0, 0.4), view))
    assert controller.final_grasp() is not None


@pytest.mark.parametrize("name", ALL)
def test_a_grasp_below_the_least_quality_is_not_attempted(name: str) -> None:
    weak = Blob(x=0.5, y=0.0, quality=lambda height: 0.25)
    for threshold, taken in ((0.1, True), (0.6, False)):  # a cell hardly seen has 0.5 in the published mean
        controller = make_controller(name, replace(settings_of(name), min_quality=threshold))
        for _ in range(4):
            controller.update(observe((0.43, 0.0, 0.4), weak))
        assert (controller.final_grasp() is not None) == taken


@pytest.mark.parametrize("name", ALL)
def test_a_remembered_failure_sends_the_next_attempt_elsewhere(name: str) -> None:
    better, worse = Blob(x=0.5, y=0.0), Blob(x=0.56, y=0.04, quality=lambda height: 0.8)
    controller: Any = make_controller(name)
    for attempt, expected in enumerate([better, worse]):
        controller.reset(attempt)
        if attempt:
            controller.remember_failure(np.array([better.x, better.y, 0.0]))
        for _ in range(4):
            one = observe((0.45, 0.0, 0.4), better)
            other = observe((0.45, 0.0, 0.4), worse)
            both = np.maximum(one.grasp_map.quality, other.grasp_map.quality)
            controller.update(replace(one, grasp_map=replace(one.grasp_map, quality=both)))
        grasp = controller.final_grasp()
        assert np.hypot(grasp.position[0] - expected.x, grasp.position[1] - expected.y) < 0.01


@pytest.mark.parametrize("name", ALL)
def test_diagnostics_are_grids_of_the_map_and_scalars(name: str) -> None:
    controller = make_controller(name)
    controller.update(observe((0.43, 0.0, 0.45)))
    entries = controller.diagnostics()
    assert {"mean_quality", "best_quality"} <= entries.keys()
    for entry in entries.values():
        assert isinstance(entry, bool | float) or np.shape(entry) == GridConfig().shape


@pytest.mark.parametrize("name", ALL)
def test_the_projects_controllers_remember_failures(name: str) -> None:
    controller: Any = make_controller(name)
    extras: ControllerExtras = controller
    assert remembers_failures(controller)
    assert extras.config == settings_of(name)


def test_failures_are_told_oldest_first_to_those_alone_that_want_to_know() -> None:
    class Remembers:
        def __init__(self) -> None:
            self.told: list[float] = []

        def remember_failure(self, position: np.ndarray) -> None:
            self.told.append(position[0])

    one: Any = Remembers()
    remember_failures(one, [np.array([x, 0, 0]) for x in (0.4, 0.5)])
    assert one.told == [0.4, 0.5]
    other: Any = object()
    assert not remembers_failures(other)
    remember_failures(other, [np.zeros(3)])
