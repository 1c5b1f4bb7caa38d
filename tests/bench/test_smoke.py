"""The real command, headless, once with each camera: oracle and MP-PC on the thin suite."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from bench_runs import records, records_without_timing

from mpgrasp.bench.__main__ import main
from mpgrasp.camera.wrist_camera import WristCamera
from mpgrasp.exceptions import CameraError
from mpgrasp.scene.scene import build_scene
from mpgrasp.suite import load_suite

REPOSITORY = Path(__file__).resolve().parents[2]


COMMAND = [sys.executable, "-m", "mpgrasp.bench", "thin", "--detector", "oracle", "--controller", "mppc"]


def play(out: Path, *options: str) -> dict[str, Any]:
    """One real episode; returns its line."""
    command = [*COMMAND, "--episodes", "1", "--out", str(out), *options]
    done = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    (line,) = records(out)
    return line


@pytest.mark.parametrize("camera", ["ray", "gl"])
def test_one_real_episode_leaves_a_whole_run(camera: str, tmp_path: Path) -> None:
    if camera == "gl":
        try:
            WristCamera(build_scene(load_suite("thin").scene, 0).model, backend="gl").close()
        except CameraError as error:
            pytest.skip(f"no OpenGL here: {error}")
    line = play(tmp_path / "a", "--camera", camera, "--record", "1")
    assert line["object"] == "usb_stick"
    assert line["ticks"] > 0
    assert set(line["timing"]) >= {"render", "detect", "control", "ik", "physics"}
    run = json.loads((tmp_path / "a" / "run.json").read_text())
    assert run["camera"]["backend"] == camera
    assert run["physics"]["timestep"] == 0.002
    assert json.loads((tmp_path / "a" / "summary.json").read_text())["complete"]
    recordings = list((tmp_path / "a" / "recordings").iterdir())
    assert {".rrd", ".gif", ".mp4"} <= {file.suffix for file in recordings}
    assert all(file.stat().st_size > 1000 for file in recordings)


def test_the_same_seed_plays_the_same_episode_in_any_process_and_unrecorded(tmp_path: Path) -> None:
    options = ["--camera", "ray", "--seed", "1"]
    first = play(tmp_path / "a", *options, "--record", "1")
    second = play(tmp_path / "b", *options, "--workers", "2", "--quiet")
    del first["timing"], second["timing"]
    assert first == second


@pytest.mark.xdist_group("shared memory")
def test_workers_that_share_their_networks_play_what_workers_with_their_own_do(tmp_path: Path) -> None:
    options = ["--detector", "ggcnn2", "--controller", "open_loop", "--episodes", "2", "--workers", "2"]
    for runtime in ("auto", "shared"):
        out = tmp_path / runtime
        assert main(["thin", *options, "--runtime", runtime, "--quiet", "--out", str(out)]) == 0
    assert records_without_timing(tmp_path / "auto") == records_without_timing(tmp_path / "shared")
    assert main(["replay", str(tmp_path / "shared"), "--episode", "0"]) == 0


def test_a_ladder_of_real_episodes_ends_with_levels(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["ladder", "thickness", "--detector", "heuristic", "--controller", "straight_down"]
    assert main([*words, "--episodes", "3", "--workers", "2", "--quiet", "--out", str(tmp_path / "run")]) == 0
    assert "to 50 %" in capsys.readouterr().out
    assert len(records(tmp_path / "run")) == 3
    assert (tmp_path / "run" / "report.html").is_file()
