"""Laws of detectors in other processes: their maps arrive whole, and what goes wrong is one clear error."""

from __future__ import annotations

import re
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from mpgrasp.camera.config import D435_INTRINSICS
from mpgrasp.depth import DepthFrame
from mpgrasp.detectors.other_process import OtherProcess
from mpgrasp.exceptions import ConfigError, PlugInError
from mpgrasp.geometry import looking_down

CLIENT = re.findall(
    r"```python\n(import json.*?)```",
    (Path(__file__).resolve().parents[2] / "docs" / "extending.md").read_text(encoding="utf-8"),
    re.DOTALL,
)
NET = """
import torch  # a stand-in beside this file, which no other process could use

def predict(depth, rgb, told):
    assert torch.VERSION == "0.0.conflict"
    return np.clip(1 - depth, 0, 1), depth * 0 + 0.5, depth * 0 + told["fx"] / 10

serve("conflicting", predict)
"""


@pytest.fixture
def program(tmp_path: Path) -> Path:
    (client,) = CLIENT
    (tmp_path / "torch.py").write_text('VERSION = "0.0.conflict"')
    (tmp_path / "net.py").write_text(client + NET)
    return tmp_path / "net.py"


def frame() -> DepthFrame:
    depth = np.full((480, 640), 0.5, np.float32)
    depth[200:260, 300:360] = 0.45
    depth[100:120, 200:230] = np.nan
    return DepthFrame(
        depth=depth, intrinsics=D435_INTRINSICS, T_world_camera=looking_down([0.5, 0, 0.5]), time=0.3
    )


def test_the_client_of_the_documents_serves_a_network_whose_torch_is_another(program: Path) -> None:
    assert len(CLIENT[0].splitlines()) <= 40
    detector = OtherProcess([sys.executable, str(program)])
    assert detector.name == "conflicting"
    for _ in range(2):
        detector.reset(None)
        found = detector.predict(frame())
        assert np.allclose(found.quality, np.clip(1 - found.depth, 0, 1))
        assert (found.angle == np.float32(0.5)).all()
        assert np.allclose(found.width, found.intrinsics.fx / 10)
        assert found.measured is not None
        assert not found.measured.all(), "holes are told as holes"
        assert found.time == 0.3
    process = detector._process
    detector.close()
    assert process.poll() == 0, "it ends when its input ends"


def test_it_ends_with_the_detector_that_nobody_uses_any_more(program: Path) -> None:
    detector = OtherProcess([sys.executable, str(program)])
    process = detector._process
    del detector
    assert process.poll() is not None


READY = 'import sys, json, time\nprint(json.dumps({"kind": "ready", "name": "bad"}), flush=True)\n'
LOOP = (
    READY
    + "for line in sys.stdin.buffer:\n    if b'predict' in line:\n        sys.stdin.buffer.read(4 * 224**2); "
)


def saying(text: str) -> str:
    return LOOP + f"print({text!r}, flush=True); time.sleep(9)"


@pytest.mark.parametrize(
    ("source", "said"),
    [
        (READY + "sys.stdin.buffer.readline()\nsys.exit(3)", "has ended with code 3|it has ended"),
        (saying("hello"), "no line of JSON"),
        (LOOP + "time.sleep(9)", "no answer in time"),
        (saying('{"kind": "error", "said": "out of memory"}'), "out of memory"),
        (saying('{"kind": "maps", "height": 1, "width": 1}'), "maps of 1 x 1"),
        (saying("x" * 99999), "no line of JSON"),
    ],
)
def test_a_program_that_breaks_its_word_is_one_error_and_is_ended(source: str, said: str) -> None:
    detector = OtherProcess([sys.executable, "-c", source], answer_limit=1.0)
    start = time.monotonic()
    with pytest.raises(PlugInError, match=said):
        detector.predict(frame())
    assert time.monotonic() - start < 4
    assert detector._process.poll() is not None
    with pytest.raises(PlugInError, match="it has ended"):
        detector.predict(frame())


@pytest.mark.parametrize(
    ("command", "start_limit", "said"),
    [
        (["no-such-program-here"], 20.0, "cannot be started"),
        ([sys.executable, "-c", "pass"], 20.0, "did not get ready.*ended with code 0"),
        ([sys.executable, "-c", "import time; time.sleep(9)"], 1.0, "did not get ready.*no answer in time"),
        ([sys.executable, "-c", "print('{}')"], 20.0, "did not get ready.*said '{}' in the place of 'ready'"),
        ("python net.py", 20.0, "unusable command"),
        ([], 20.0, "unusable command"),
    ],
)
def test_a_program_that_does_not_get_ready_is_refused(
    command: list[str], start_limit: float, said: str
) -> None:
    with pytest.raises(ConfigError, match=said):
        OtherProcess(command, start_limit=start_limit)
