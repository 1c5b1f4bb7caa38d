"""The free hand is moved as the arm would be: in straight lines, braked on demand, stopped by force."""

from __future__ import annotations

import numpy as np
import pytest

from mpgrasp.geometry import looking_down
from mpgrasp.motion.hand_driver import HandDriver
from mpgrasp.robot import hand
from mpgrasp.scene.config import SceneConfig
from mpgrasp.scene.free_hand import FreeHand
from mpgrasp.scene.scene import build_scene

SPOT = (0.75, 0.4)
"""World x, y of a bare place on the table, beside the cloth [m]."""


@pytest.fixture
def driver() -> HandDriver:
    free = FreeHand(build_scene(SceneConfig(objects=("usb_stick",)), 3, robot=False))
    free.place([*SPOT, 0.2], 0.0, 0.04)
    return HandDriver(free)


def test_a_move_is_straight_keeps_its_speed_and_tells_every_tick(driver: HandDriver) -> None:
    ticks: list[np.ndarray] = []
    start, end = np.array([*SPOT, 0.2]), np.array([0.65, 0.3, 0.15])
    told = ticks.append
    assert driver.move_to(looking_down(end), 0.1, on_tick=lambda d: told(d.T_desired[:3, 3].copy()))
    way = np.vstack([start, ticks])
    assert way[-1] == pytest.approx(end)
    along = (way - start) @ (end - start) / np.linalg.norm(end - start)
    aside = np.linalg.norm(way - start - np.outer(along, (end - start) / np.linalg.norm(end - start)), axis=1)
    assert aside.max() < 1e-9
    assert np.diff(along).max() / driver.config.dt <= 0.1 * 1.03
    assert driver.simulation.lag < 1e-3
    assert driver.reflex is None


def test_a_move_that_is_cut_short_brakes_and_says_so(driver: HandDriver) -> None:
    low = looking_down([*SPOT, 0.05])
    assert not driver.move_to(low, 0.1, until=lambda: driver.T_desired[2, 3] < 0.12, deceleration=1.5)
    # v^2 / 2 a is 3.3 mm
    assert 0.12 - 0.006 < driver.T_desired[2, 3] < 0.12


def test_waiting_ends_when_something_holds(driver: HandDriver) -> None:
    start = driver.simulation.time
    driver.wait(1.0, until=lambda: driver.simulation.time - start > 0.3)
    assert driver.simulation.time - start == pytest.approx(0.31, abs=0.011)


def test_pressing_on_ends_in_a_stop_and_no_later_motion(driver: HandDriver) -> None:
    assert not driver.move_to(looking_down([*SPOT, hand.FINGERTIP_BEYOND_TCP - 0.05]), 0.05)
    assert driver.reflex is not None
    assert driver.reflex.limit in ("contact_force", "tracking_position")
    stopped = driver.simulation.time
    driver.wait(1.0)
    driver.follow(lambda _: np.zeros(3), 1.0)
    assert driver.simulation.time == stopped
