"""MuJoCo's viewer on an episode while it is played, with maps of detector and controller in its corner."""

from __future__ import annotations

import os
import sys
import time
import warnings
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from mpgrasp.exceptions import ConfigError
from mpgrasp.recording.false_colour import Picture, shade, shade_depth
from mpgrasp.recording.recorder import TickRecord

if TYPE_CHECKING:
    from mpgrasp.scene.simulation import Simulation

SIDE = 180
"""Side of a map in the window [px]."""
_GAP = 8  # [px]


def has_display(environment: Mapping[str, str] = os.environ, platform: str = sys.platform) -> bool:
    """Return True if a window can be opened here, as far as the environment tells."""
    if not platform.startswith("linux"):
        return True
    return bool(environment.get("DISPLAY") or environment.get("WAYLAND_DISPLAY"))


class Window:
    """Recorder that shows an episode in a window, at the pace of its own time.

    Whoever closes the window ends the episode.

    Args:
        speed: simulated time over real time.
        lingers: the last picture stays until the window is closed.
        launch: opens the viewer on a model and its data; MuJoCo's by default.
        sleep: waits for a time [s].

    Raises:
        ConfigError: a speed that is not above 0; or, once it starts, no window can be opened.
    """

    def __init__(
        self,
        speed: float = 1.0,
        lingers: bool = True,
        launch: Callable[[Any, Any], Any] | None = None,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        if not 0 < speed < np.inf:
            raise ConfigError("unusable speed", got=speed, allowed="above 0")
        self._speed, self._lingers = speed, lingers
        self._launch, self._sleep = launch or _launch, sleep
        self._viewer: Any = None
        self._maps: dict[str, Picture] = {}
        self._clock = self._time = 0.0

    def start(self, simulation: Simulation) -> None:
        try:
            self._viewer = self._launch(simulation.model, simulation.data)
        except Exception as error:  # of GLFW, of many kinds
            raise ConfigError(
                f"no window can be opened ({error})", allowed="--out DIR for pictures"
            ) from error
        self._clock, self._time = time.monotonic(), simulation.time

    def tick(self, record: TickRecord) -> None:
        if not self._viewer.is_running():
            raise KeyboardInterrupt
        self._look_at_maps(record)
        ahead = (record.simulation.time - self._time) / self._speed - (time.monotonic() - self._clock)
        if ahead > 0:
            self._sleep(ahead)
        self._caption(record)
        self._show()
        self._viewer.sync()

    def finish(self, event: str) -> None:
        """Leave the last picture until the window is closed, if it is to linger."""
        if self._lingers:
            print(f"{event}; close the window to end", flush=True)
            while self._viewer.is_running():
                self._sleep(0.1)
        self.close()

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._viewer is not None:
            self._viewer.close()
            self._viewer = None

    def _look_at_maps(self, record: TickRecord) -> None:
        if record.frame is not None:
            self._maps["depth"] = shade_depth(record.frame.depth)
        if record.grasp_map is not None:
            self._maps["quality"] = shade(record.grasp_map.quality, 0.0, 1.0)
        value = record.diagnostics.get("utility")
        if isinstance(value, np.ndarray) and value.ndim == 2:
            self._maps["utility"] = shade(value[::-1])  # rows are world y: a view from above

    def _caption(self, record: TickRecord) -> None:
        # without any text, MuJoCo 4.0 draws the images behind the scene
        left, right = (
            "phase\ntime\nsmallest singular value",
            [record.phase, f"{record.simulation.time:.1f} s"],
        )
        values = "\n".join([*right, f"{record.min_singular_value:.3f}", *filter(None, [record.event])])
        self._viewer.set_texts((None, None, left, values))

    def _show(self) -> None:
        """Put the maps along the lower edge of the window, as many as there is room for."""
        import mujoco

        room = self._viewer.viewport
        if room is None:
            return
        overlays = []
        for k, picture in enumerate(self._maps.values()):
            left = _GAP + k * (SIDE + _GAP)
            if left + SIDE <= room.width and room.height >= SIDE + _GAP:
                small = cv2.resize(picture, (SIDE, SIDE), interpolation=cv2.INTER_AREA)
                overlays.append((mujoco.MjrRect(room.left + left, _GAP, SIDE, SIDE), small))
        self._viewer.set_images(overlays)


def _launch(model: Any, data: Any) -> Any:
    import glfw
    import mujoco.viewer

    with warnings.catch_warnings(record=True) as said:  # MuJoCo itself would end the process
        warnings.simplefilter("always")
        if not glfw.init():
            raise OSError(str(said[-1].message) if said else "GLFW does not start")

    return mujoco.viewer.launch_passive(model, data, show_left_ui=False, show_right_ui=False)
