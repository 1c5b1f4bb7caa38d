"""Laws of the camera beside the table."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from toy_recordings import toy_simulation

from mpgrasp.geometry import looking_down
from mpgrasp.recording.watcher import Watcher


@pytest.fixture
def simulation() -> Any:
    return toy_simulation()


@pytest.mark.parametrize("backend", ["auto", "ray"])
def test_the_watcher_sees_the_red_stick(simulation: Any, backend: str) -> None:
    watcher = Watcher(simulation.model, backend)
    picture = watcher.picture(simulation.data, looking_down([0.5, 0.0, 0.4])).astype(int)
    watcher.close()
    height, width = picture.shape[:2]
    middle = picture[height // 2, width // 2 - 20]
    assert middle[0] > 2 * middle[1]
    assert np.ptp(picture[20, 20]) < 40
