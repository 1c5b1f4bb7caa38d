"""The window keeps the pace of the episode, shows the maps that there is room for, and ends with its user."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mpgrasp.exceptions import ConfigError
from mpgrasp.recording.window import SIDE, Window, has_display
from mpgrasp.view.play import play


class Viewer:
    """Stands for MuJoCo's: keeps what it is asked to show, and is closed after so many looks at it."""

    def __init__(self, looks: int, width: int = 1000, height: int = 700) -> None:
        self.looks, self.images, self.texts, self.synced = looks, [[]], [], 0  # type: ignore[var-annotated]
        self.viewport: Any = SimpleNamespace(left=0, bottom=0, width=width, height=height)
        self.closed = False

    def is_running(self) -> bool:
        self.looks -= 1
        return self.looks >= 0

    def set_images(self, images: Any) -> None:
        self.images.append(images)

    def set_texts(self, text: Any) -> None:
        self.texts.append(text[3])

    def sync(self) -> None:
        self.synced += 1

    def close(self) -> None:
        self.closed = True


def watch(viewer: Viewer, speed: float = 1.0) -> tuple[float, Any]:
    """Play a short episode to a window; the time that it slept, and the result."""
    slept: list[float] = []
    window = Window(speed, launch=lambda model, data: viewer, sleep=slept.append)
    result = play(
        "thin", "heuristic", "mppc_robust", window, settings=["episode.start_height=0.2"], camera="ray"
    )
    return sum(slept), result


def test_every_tick_is_shown_with_maps_in_the_corner_and_waits_for_its_time() -> None:
    viewer = Viewer(looks=1000)
    slept, result = watch(viewer)
    assert viewer.closed
    assert viewer.synced == len(viewer.texts) > 60
    assert viewer.texts[0].startswith("reach\n")
    assert {text.split("\n")[0] for text in viewer.texts} >= {"reach", "lift", "hold"}
    last = viewer.images[-1]
    assert [(area.left, area.bottom, area.width) for area, _ in last] == [
        (8, 8, SIDE), (8 + SIDE + 8, 8, SIDE), (8 + 2 * (SIDE + 8), 8, SIDE)
    ]  # fmt: skip
    assert all(picture.shape == (SIDE, SIDE, 3) and picture.dtype == np.uint8 for _, picture in last)
    # nobody slept in truth, so that every tick waits for its whole time since the start
    assert slept > result.sim_time_s


def test_twice_the_speed_waits_for_half_the_time() -> None:
    once, twice = watch(Viewer(1000))[0], watch(Viewer(1000), 2.0)[0]
    assert twice == pytest.approx(once / 2, rel=0.2)


def test_a_window_that_is_closed_ends_the_episode() -> None:
    with pytest.raises(KeyboardInterrupt):
        watch(Viewer(looks=5))


def test_a_small_window_shows_as_many_maps_as_have_room() -> None:
    viewer = Viewer(1000, width=2 * SIDE)
    watch(viewer)
    assert len(viewer.images[-1]) == 1
    gone = Viewer(1000)
    gone.viewport = None
    watch(gone)
    assert gone.images == [[]]


def test_what_cannot_be_shown_is_refused() -> None:
    with pytest.raises(ConfigError, match="unusable speed; got 0"):
        Window(0.0)

    def fails(model: Any, data: Any) -> Any:
        raise OSError("no X server")

    with pytest.raises(ConfigError, match=r"no window can be opened \(no X server\); allowed: --out DIR"):
        Window(launch=fails).start(SimpleNamespace(model=None, data=None, time=0.0))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("environment", "platform", "there"),
    [
        ({}, "linux", False),
        ({"DISPLAY": ""}, "linux", False),
        ({"DISPLAY": ":0"}, "linux", True),
        ({"WAYLAND_DISPLAY": "wayland-0"}, "linux", True),
        ({}, "darwin", True),
    ],
)
def test_a_display_is_known_by_the_environment(
    environment: dict[str, str], platform: str, there: bool
) -> None:
    assert has_display(environment, platform) is there
