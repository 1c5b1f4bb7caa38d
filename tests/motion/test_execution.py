"""Grasps by hand from the true pose: thin sticks come up, and every failure gets its own name."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import looking_down, wrap_half_pi
from mpgrasp.grasp import Grasp
from mpgrasp.motion.arm_driver import ArmDriver
from mpgrasp.motion.execution import execute_grasp
from mpgrasp.motion.execution_config import ExecutionConfig
from mpgrasp.motion.ik import solve_pose
from mpgrasp.outcome import Outcome
from mpgrasp.scene.config import SceneConfig
from mpgrasp.scene.objects.model import ObjectModel, Part
from mpgrasp.scene.scene import Scene, build_scene
from mpgrasp.scene.simulation import Simulation


def stick(height: float, width: float | None = None, length: float = 0.06, **changes: Any) -> ObjectModel:
    width = height if width is None else width
    values: dict[str, Any] = {
        "name": "stick", "friction": 0.5, "rgba": (0.5, 0.5, 0.5, 1.0),
        "mass": max(0.004, 900 * height * width * length),
        "parts": (Part(shape="box", size=(length / 2, width / 2, height / 2)),),
    }  # fmt: skip
    return ObjectModel(**(values | changes))


def scene_with(model: ObjectModel, seed: int) -> Scene:
    return build_scene(SceneConfig(objects=(model,), half_extent=0.12), seed)


def driver_over(
    scene: Scene, x: float = 0.45, y: float = 0.0, z: float = 0.175, yaw: float = 0.0
) -> ArmDriver:
    simulation = Simulation(scene)
    simulation.set_q(solve_pose(simulation.q, looking_down([x, y, z], yaw)))
    return ArmDriver(simulation)


def grasp_of(
    driver: ArmDriver, height: float, width: float, offset: tuple[float, float] = (0.0, 0.0)
) -> Grasp:
    """Across the stick, which lies along its x axis; the offset is in its own axes."""
    T = driver.simulation.object_pose("stick")
    position = T[:3, 3] + T[:3, 0] * offset[0] + T[:3, 1] * offset[1] + [0.0, 0.0, height / 2]
    angle = float(wrap_half_pi(np.arctan2(T[1, 1], T[0, 1])))
    return Grasp(position=position, angle=angle, width=width, quality=1.0)


@pytest.mark.parametrize("height", [0.008, 0.0045])
@pytest.mark.parametrize("seed", range(2))
def test_a_thin_stick_on_an_uneven_cloth_is_lifted(height: float, seed: int) -> None:
    driver = driver_over(scene_with(stick(height), seed))
    phases: list[str] = []

    def watch(phase: str, _: ArmDriver) -> None:
        if phase not in phases:
            phases.append(phase)

    result = execute_grasp(driver, grasp_of(driver, height, height), on_tick=watch)
    assert result.outcome is Outcome.SUCCESS, result.reason
    assert (result.lifted, result.between) == ("stick", ("stick",))
    assert phases == ["pregrasp", "descend", "close", "lift", "hold", "shake"]
    assert result.duration < 8.0
    assert result.contact_height is not None
    # felt the cloth, rose a little, and closed below the stick's top
    assert result.contact_height < result.tip_height < result.contact_height + 0.001
    assert result.width == pytest.approx(height, abs=0.0015)
    assert driver.simulation.object_pose("stick")[2, 3] > 0.12


@pytest.mark.parametrize(
    ("held", "rise", "outcome"),
    [
        (True, 0.15, "success"),
        (True, 0.051, "success"),
        (True, 0.049, "slipped"),
        (False, 0.15, "slipped"),
    ],
)
def test_success_takes_a_grip_and_five_centimetres_at_the_end(
    monkeypatch: pytest.MonkeyPatch, held: bool, rise: float, outcome: str
) -> None:
    driver = driver_over(scene_with(stick(0.02), 0))
    simulation, grasp = driver.simulation, grasp_of(driver, 0.02, 0.02)
    rest, shaken = simulation.object_pose("stick"), False

    def shake(*_: Any) -> None:
        nonlocal shaken
        shaken = True

    def pose(_: str) -> np.ndarray:
        T = rest.copy()
        T[2, 3] += rise if shaken else 0.0
        return T

    def clamped() -> set[str]:
        return {"stick"} if held or not shaken else set()

    # nothing moves: what the fingers clamp and how high the object is are scripted
    monkeypatch.setattr(driver, "move_to", lambda *_, **__: True)
    monkeypatch.setattr(driver, "wait", lambda *_, **__: None)
    monkeypatch.setattr(driver, "follow", shake)
    monkeypatch.setattr(simulation, "object_pose", pose)
    monkeypatch.setattr(simulation, "held", clamped)
    result = execute_grasp(driver, grasp)
    assert result.outcome == outcome
    assert result.lifted == ("stick" if outcome == "success" else None)


def test_a_tall_block_is_gripped_as_deep_as_the_palm_allows_and_without_contact() -> None:
    model = stick(0.08, width=0.04, length=0.04)
    driver = driver_over(scene_with(model, 0), z=0.3)
    result = execute_grasp(driver, grasp_of(driver, 0.08, 0.04))
    assert result.outcome is Outcome.SUCCESS, result.reason
    top = result.planned_height + ExecutionConfig().palm_depth
    assert result.contact_height is None
    assert result.tip_height == pytest.approx(top - 0.042, abs=0.001)
    # the forces of both pads cancel: what is left is the weight
    assert driver.external_force == pytest.approx(9.81 * model.mass, abs=0.05)


def test_the_start_may_be_below_the_pregrasp() -> None:
    driver = driver_over(scene_with(stick(0.008), 1), x=0.35, y=0.15, z=0.03)
    result = execute_grasp(driver, grasp_of(driver, 0.008, 0.008))
    assert result.outcome is Outcome.SUCCESS, result.reason


def test_closing_beside_the_object_is_a_miss() -> None:
    driver = driver_over(scene_with(stick(0.008), 0))
    result = execute_grasp(driver, grasp_of(driver, 0.008, 0.008, offset=(0.0, 0.06)))
    assert result.outcome is Outcome.MISSED
    assert (result.between, result.lifted) == ((), None)
    assert result.width < 0.001


@pytest.mark.parametrize(("mass", "friction"), [(0.03, 0.5), (0.2, 0.5), (0.2, 0.9)])
def test_what_hangs_on_the_closed_fingers_like_a_ring_on_a_hook_is_not_grasped(
    mass: float, friction: float
) -> None:
    # a portal: the fingers straddle its beam and close in the opening below
    beam = Part(shape="box", size=(0.035, 0.008, 0.004), position=(0.0, 0.0, 0.066))
    posts = [Part(shape="box", size=(0.004, 0.008, 0.031), position=(x, 0.0, 0.031)) for x in (-0.031, 0.031)]
    driver = driver_over(
        scene_with(stick(0.07, mass=mass, friction=friction, parts=(beam, *posts), rolls=False), 0), z=0.3
    )
    T = driver.simulation.object_pose("stick")
    angle = float(wrap_half_pi(np.arctan2(T[1, 1], T[0, 1])))
    grasp = Grasp(position=T[:3, 3] + [0.0, 0.0, 0.07], angle=angle, width=0.016, quality=1.0)
    result = execute_grasp(driver, grasp)
    assert driver.simulation.object_pose("stick")[2, 3] - T[2, 3] > 0.1
    assert (result.outcome, result.lifted, result.between) == (Outcome.MISSED, None, ())
    assert "stick came up hanging on the fingers" in result.reason


def test_what_the_fingers_clamp_above_their_pads_is_grasped() -> None:
    # an H on its side: the mounts, 11 mm behind the pads' planes, clamp its head of 30 mm from either side
    head = Part(shape="box", size=(0.03, 0.015, 0.004), position=(0.0, 0.0, 0.022))
    web = Part(shape="box", size=(0.03, 0.001, 0.018))
    foot = Part(shape="box", size=(0.03, 0.02, 0.004), position=(0.0, 0.0, -0.022))
    model = stick(0.052, mass=0.05, parts=(head, web, foot))
    driver = driver_over(scene_with(model, 0), z=0.3)
    grasp = grasp_of(driver, 0.052, 0.03)
    result = execute_grasp(driver, grasp)
    assert (result.outcome, result.lifted, result.between) == (Outcome.SUCCESS, "stick", ("stick",)), result
    simulation = driver.simulation
    touching = {simulation.model.geom(g).name for g in np.ravel(simulation.data.contact.geom)}
    assert touching >= {"panda/left_mount", "panda/right_mount"}
    assert not touching & {"panda/left_pad", "panda/right_pad"}
    np.testing.assert_allclose(simulation.finger_forces()["stick"], 40.0, atol=1.0)
    assert result.width == pytest.approx(0.008, abs=0.0005)


def test_landing_on_an_object_is_a_collision() -> None:
    model = stick(0.03, width=0.06, length=0.15, mass=0.2)
    driver = driver_over(scene_with(model, 0))
    # fingers come down on top of it: they open to 20 mm over a width of 60
    result = execute_grasp(driver, grasp_of(driver, 0.03, 0.01))
    assert result.outcome is Outcome.COLLISION
    assert result.contact_height is not None
    assert result.contact_height > 0.025
    assert "planned" in result.reason


def test_an_object_too_slippery_to_lift_has_slipped() -> None:
    # 1.2 kg on a grip of two times 40 N times friction that cannot carry it
    model = stick(0.03, width=0.03, length=0.10, mass=1.2, friction=0.02)
    driver = driver_over(scene_with(model, 0))
    # pads have their own friction: make them as slippery, and hold on to the rest of the world
    simulation_model = driver.simulation.model
    before = simulation_model.geom_friction.copy()
    for side in ("left_pad", "right_pad"):
        simulation_model.geom_friction[simulation_model.geom(f"panda/{side}").id, 0] = 0.02
    try:
        result = execute_grasp(driver, grasp_of(driver, 0.03, 0.03))
    finally:
        simulation_model.geom_friction[:] = before
    assert result.outcome is Outcome.SLIPPED, result.reason
    assert result.between == ("stick",)


def test_a_grasp_out_of_reach_ends_in_a_named_reflex() -> None:
    driver = driver_over(scene_with(stick(0.008), 0))
    far = Grasp(position=np.array([0.95, 0.0, 0.01]), angle=0.0, width=0.02, quality=1.0)
    result = execute_grasp(driver, far)
    assert result.outcome is Outcome.REFLEX
    assert result.reflex is driver.reflex
    assert result.reflex is not None
    assert result.reflex.limit in result.reason
    assert "pregrasp" in result.reason


def test_the_same_scene_and_grasp_end_in_the_same_state() -> None:
    hashes = set()
    for _ in range(2):
        driver = driver_over(scene_with(stick(0.006), 4))
        execute_grasp(driver, grasp_of(driver, 0.006, 0.006))
        hashes.add(driver.simulation.state_hash())
    assert len(hashes) == 1


@pytest.mark.parametrize(
    "bad", [{"lift_speed": 0.0}, {"grip_force": 100.0}, {"success_height": 0.2}, {"back_off": -0.001}]
)
def test_unusable_settings_are_refused(bad: dict[str, float]) -> None:
    with pytest.raises(ConfigError):
        ExecutionConfig(**bad)


def test_a_grasp_that_is_not_finite_is_refused() -> None:
    driver = driver_over(scene_with(stick(0.008), 0))
    with pytest.raises(ConfigError, match="finite"):
        execute_grasp(driver, Grasp(position=np.array([0.5, np.nan, 0]), angle=0.0, width=0.02, quality=1.0))
