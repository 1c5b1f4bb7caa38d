"""The real command, headless, once with each camera: oracle and MP-PC on the thin suite."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from mpgrasp.bench.suite import load_suite
from mpgrasp.camera import WristCamera
from mpgrasp.exceptions import CameraError
from mpgrasp.scene import build_scene

REPOSITORY = Path(__file__).parent.parent


@pytest.mark.parametrize("camera", ["ray", "gl"])
def test_one_real_episode_leaves_a_whole_run(camera: str, tmp_path: Path) -> None:
    if camera == "gl":
        try:
            WristCamera(build_scene(load_suite("thin").scene, 0).model, backend="gl").close()
        except CameraError as error:
            pytest.skip(f"no OpenGL here: {error}")
    command = [sys.executable, "-m", "mpgrasp.bench", "thin", "--detector", "oracle", "--controller", "mppc"]
    options = ["--episodes", "1", "--seed", "0", "--camera", camera, "--record", "1", "--out", str(tmp_path)]
    done = subprocess.run([*command, *options], cwd=REPOSITORY, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    (line,) = [json.loads(text) for text in (tmp_path / "episodes.jsonl").read_text().splitlines()]
    assert line["object"] == "usb_stick"
    assert line["ticks"] > 0
    assert set(line["timing"]) >= {"render", "detect", "control", "ik", "physics"}
    run = json.loads((tmp_path / "run.json").read_text())
    assert run["camera"]["backend"] == camera
    assert run["physics"]["timestep"] == 0.002
    assert json.loads((tmp_path / "summary.json").read_text())["complete"]
    recordings = list((tmp_path / "recordings").iterdir())
    assert {".rrd", ".gif"} <= {file.suffix for file in recordings}
    assert all(file.stat().st_size > 1000 for file in recordings)
