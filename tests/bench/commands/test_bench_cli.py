from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Iterator
from ctypes.util import find_library
from pathlib import Path

import fakes
import pytest
from bench_runs import PLUG_INS, records, same_results, thin_command
from full_disk import room_for
from toy_recordings import shown

from mpgrasp.bench.__main__ import main
from mpgrasp.exceptions import ConfigError
from mpgrasp.plugins import parse_weights
from mpgrasp.scene.objects import catalogue as objects

REPOSITORY = Path(__file__).resolve().parents[3]


def test_a_run_prints_the_table_and_leaves_all_files(
    fake_world: object, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "run"
    assert main(["thin", *PLUG_INS, "--episodes", "5", "--seed", "3", "--out", str(out)]) == 0
    printed = capsys.readouterr()
    assert "fakes:FakeDetector" in printed.out
    assert "interval" in printed.out
    assert printed.err.count("thin episode") == 5
    lines = records(out)
    assert [line["episode"] for line in lines] == list(range(5))
    summary = json.loads((out / "summary.json").read_text())
    assert summary["complete"]
    assert summary["cells"][0]["successes"] == sum(line["success"] for line in lines)
    run = json.loads((out / "run.json").read_text())
    assert run["configuration"]["seed"] == 3
    assert run["configuration"]["suite"]["scenes"][0]["objects"] == ["usb_stick"]
    assert run["configuration"]["episode"]["start_jitter"] == 0.05
    assert run["made_with"]["packages"]["mujoco"]


def test_a_run_without_room_for_its_recordings_keeps_its_episodes_and_says_so_by_its_exit_code(
    fake_world: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    fake_world.setattr("mpgrasp.episode.episode.run_episode", shown)
    command = ["thin", *PLUG_INS, "--episodes", "3", "--record", "2", "--camera", "ray", "--workers", "0"]
    with room_for(200_000):
        assert main([*command, "--quiet", "--out", str(tmp_path / "full")]) == 2
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 2
    for episode, line in enumerate(said):
        assert line.startswith(f"mpgrasp: episode {episode} of thin ")
        assert ".rrd" in line
    assert main([*command, "--quiet", "--out", str(tmp_path / "roomy")]) == 0
    assert capsys.readouterr().err == ""
    for folder in ("full", "roomy"):
        assert [line["episode"] for line in records(tmp_path / folder)] == [0, 1, 2]
        assert json.loads((tmp_path / folder / "summary.json").read_text())["complete"]


def test_lines_have_all_promised_keys_in_sorted_order(fake_world: object, tmp_path: Path) -> None:
    main(["thin", *PLUG_INS, "--episodes", "1", "--out", str(tmp_path), "--quiet"])
    (text,) = (tmp_path / "episodes.jsonl").read_text().splitlines()
    keys = list(json.loads(text))
    assert keys == sorted(keys)
    what = {"suite", "seed", "episode", "object", "detector", "controller", "outcome", "success", "grasp"}
    how = {"sim_time_s", "ticks", "reflex", "min_singular_value", "path_length_m", "jerk_rms"}
    assert set(keys) >= what | how | {"timing", "state_hash"}


def test_quiet_shows_the_table_alone(
    fake_world: object, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    main(["thin", *PLUG_INS, "--episodes", "2", "--out", str(tmp_path), "--quiet"])
    printed = capsys.readouterr()
    assert printed.err == ""
    assert "interval" in printed.out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["thick"], "unknown suite; got 'thick'; allowed: "),
        (["absent.toml"], "unreadable suite"),
        (["thin", "--detector", "resnet"], "unknown detector; got 'resnet'; allowed: dhrnet"),
        (["thin", "--detector", ""], "unknown detector"),
        (["thin", "--controller", "mppc,pid"], "unknown controller; got 'pid'; allowed: mppc"),
        (
            ["thin", *PLUG_INS, "--episodes", "0"],
            "--episodes: unusable number; got '0'; allowed: 1 to 100000",
        ),
        (
            ["thin", *PLUG_INS, "--episodes", "many"],
            "--episodes: unusable number; got 'many'; allowed: 1 to 100000",
        ),
        (["thin", *PLUG_INS, "--seed", "-1"], "--seed: unusable number; got '-1'; allowed: 0 or more"),
        (["thin", *PLUG_INS, "--workers", "-1"], "--workers: unusable number; got '-1'; allowed: 0 to 256"),
        (["thin", *PLUG_INS, "--record", "-1"], "--record: unusable number; got '-1'; allowed: 0 to 100000"),
        (["thin", *PLUG_INS, "--camera", "eye"], "unknown camera backend; got 'eye'; allowed: auto, gl, ray"),
        (["thin", *PLUG_INS, "--weights", "absent.pt"], "no such weights file; got 'absent.pt'"),
        (["thin", "--detector", "fakes:NotADetector"], "lacks reset, predict"),
        (["thin", *PLUG_INS, "--episodes", "9" * 20], "--episodes: unusable number"),
        (["thin", *PLUG_INS, "--seed", "9" * 20], "--seed: unusable number"),
        (["thin", *PLUG_INS, "--hang-after", "inf"], "--hang-after: unusable number"),
        (["thin", *PLUG_INS, "--hang-after", "1e300"], "--hang-after: unusable number"),
        (["thin", *PLUG_INS, "--until-ci", "nan"], "--until-ci: unusable number"),
        (["thin", *PLUG_INS, "--max-episodes", "-5"], "--max-episodes: unusable number"),
        (["thin", *PLUG_INS, "--resume", ""], "--resume: unusable path"),
        (["x" * 300 + ".toml"], "unreadable suite"),
        (["/dev/zero.toml"], "unreadable suite"),
        (["thin", "--frobnicate"], "unrecognized arguments: --frobnicate"),
        ([], "arguments are required: SUITE"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(
    fake_world: object, tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], message: str
) -> None:
    assert main([*arguments, *(["--out", str(tmp_path / "out")] if arguments else [])]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith("mpgrasp: error: ")
    assert printed.err.count("\n") == 1
    assert message in printed.err
    assert not (tmp_path / "out").exists()


def test_results_go_into_no_folder_of_other_things(
    fake_world: object, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["thin", *PLUG_INS, "--episodes", "1", "--workers", "0", "--quiet", "--out"]
    assert main([*command, ""]) == 2
    assert "--out: unusable path; got ''" in capsys.readouterr().err
    (tmp_path / "thesis.tex").write_text("mine")
    assert main([*command, str(tmp_path)]) == 2
    assert "is not empty and holds no run (thesis.tex)" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]
    (tmp_path / "new").mkdir()
    assert main([*command, str(tmp_path / "new")]) == 0
    assert main([*command, str(tmp_path)]) == 2


@pytest.mark.parametrize("asked", ["banana", "osmesa"])
def test_an_opengl_that_mujoco_could_not_load_is_one_line_even_for_rays(tmp_path: Path, asked: str) -> None:
    if asked == "osmesa" and find_library("OSMesa"):
        pytest.skip("OSMesa is installed")
    done = subprocess.run(
        [sys.executable, "-m", "mpgrasp.bench", "thin", "--camera", "ray", "--out", str(tmp_path / "out")],
        env={**os.environ, "MUJOCO_GL": asked}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 2
    assert done.stderr.startswith("mpgrasp: error: ")
    assert "MUJOCO_GL" in done.stderr
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize("words", [["settings", "thin"], ["--help"]])
def test_words_that_standard_output_does_not_take_are_one_line_of_error(words: list[str]) -> None:
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "mpgrasp.bench", *words],
            stdout=full, stderr=subprocess.PIPE, text=True, check=False,
        )  # fmt: skip
    assert done.returncode == 2
    assert done.stderr == "mpgrasp: error: the system refused: No space left on device\n"


def test_where_standard_error_takes_nothing_the_exit_code_still_says_it() -> None:
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "mpgrasp.bench", "thin", "--bogus"],
            stdout=subprocess.PIPE, stderr=full, text=True, check=False,
        )  # fmt: skip
    assert done.returncode == 2
    assert done.stdout == ""


def test_a_reader_that_has_had_enough_ends_a_command_silently() -> None:
    command = subprocess.Popen(
        [sys.executable, "-m", "mpgrasp.bench", "settings", "stacked"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip
    assert command.stdout is not None
    command.stdout.close()  # before anything is written
    assert command.stderr is not None
    assert command.stderr.read() == b""
    assert command.wait(60) == 141


@pytest.fixture
def catalogue(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """An object catalogue of one's own, to be written into."""

    def forget() -> None:
        objects._declarations.cache_clear()
        objects.load_object.cache_clear()

    monkeypatch.setattr(objects, "OBJECT_ASSETS", tmp_path)
    forget()
    yield tmp_path
    forget()


TRIANGLES = "o a\nv 0 0 0\nv {0} 0 0\nv 0 {0} 0\nv 0 0 {0}\n"


@pytest.mark.parametrize(
    ("mesh", "mass", "message"),
    [
        ("", "0.1", "mesh is empty"),
        (TRIANGLES.format(40), "0.1", "too large [m]; got 40.0; allowed: edges up to 0.3 m"),
        ("v 0 0 0\nv .1 0 0\nv .1 .1 0\nv 0 .1 0\n", "0.1", "mesh is flat"),
        (TRIANGLES.format("wide"), "0.1", "broken vertex; got 'v wide 0 0'"),
        ("v 0 0\n", "0.1", "broken vertex"),
        (TRIANGLES.format(0.04), '"heavy"', "unusable declaration of object thing"),
        (TRIANGLES.format(0.04), "-1", "unusable mass"),
    ],
)
def test_an_object_that_cannot_be_used_is_one_line_and_exit_code_2(
    catalogue: Path, capsys: pytest.CaptureFixture[str], mesh: str, mass: str, message: str
) -> None:
    (catalogue / "thing.obj").write_text(mesh)
    (catalogue / "objects.toml").write_text(
        f'[thing]\nmesh = "thing.obj"\nmass = {mass}\nfriction = 0.5\nrgba = [1, 1, 1, 1]\nprovenance = ""\n'
    )
    (catalogue / "mine.toml").write_text('title = "Mine"\n[scene]\nobjects = ["thing"]\n')
    out = catalogue / "out"
    assert main([str(catalogue / "mine.toml"), "--detector", "oracle", "--out", str(out)]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith("mpgrasp: error: ")
    assert printed.err.count("\n") == 1
    assert message in printed.err
    assert not out.exists()


@pytest.mark.parametrize("detector", ["dhrnet", "ggcnn"])
def test_wrong_weights_are_one_line_and_exit_code_2(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], detector: str
) -> None:
    file = tmp_path / "not-weights.pt"
    file.write_bytes(b"these are no weights")
    assert main(["thin", "--detector", detector, "--weights", str(file), "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert error.startswith("mpgrasp: error: ")
    assert error.count("\n") == 1


def test_a_directory_of_another_run_is_refused(
    fake_world: object, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    common = ["thin", *PLUG_INS, "--episodes", "2", "--out", str(tmp_path), "--quiet"]
    assert main(common) == 0
    before = (tmp_path / "episodes.jsonl").read_bytes()
    assert main([*common, "--seed", "1"]) == 2
    assert "already holds another run (seed: 0 there, 1 here)" in capsys.readouterr().err
    assert (tmp_path / "episodes.jsonl").read_bytes() == before
    assert main(common) == 0


def test_a_directory_that_cannot_be_written_is_refused(
    fake_world: object, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("")
    assert main(["thin", *PLUG_INS, "--out", str(tmp_path / "file" / "run")]) == 2
    assert "cannot be written" in capsys.readouterr().err


def test_a_bug_on_the_way_is_counted_apart_from_failures_with_its_traceback(
    fake_world: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    fake_world.setattr("mpgrasp.episode.episode.run_episode", fakes.breaks_off)
    assert main(["thin", *PLUG_INS, "--out", str(tmp_path), "--quiet"]) == 1
    assert "ZeroDivisionError: a bug in a detector" in capsys.readouterr().err
    lines = records(tmp_path)
    assert [line["outcome"] for line in lines[1:]] == ["error"] * 3
    assert lines[0]["outcome"] != "error"
    for line in lines[1:]:
        assert line["success"] is None
        trace = (tmp_path / line["traceback"]).read_text()
        assert "fakes.py" in trace
        assert trace.count("ZeroDivisionError: a bug in a detector") >= 2
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert not summary["complete"]
    (cell,) = summary["cells"]
    assert (cell["n"], cell["errors"], sum(cell["failures"].values())) == (1, 3, 1 - cell["successes"])


def test_weights_go_to_the_detector_they_name() -> None:
    assert parse_weights(["a.pt"], ["x"]) == {"x": Path("a.pt")}
    assert parse_weights(["x=a.pt"], ["x"]) == {"x": Path("a.pt")}
    assert parse_weights(["y=b=c.pt", "x=a.pt"], ["x", "y"]) == {"x": Path("a.pt"), "y": Path("b=c.pt")}
    assert parse_weights(["m:C=a.pt"], ["m:C", "y"]) == {"m:C": Path("a.pt")}
    with pytest.raises(ConfigError, match=r"whose.*x=FILE, y=FILE"):
        parse_weights(["a.pt"], ["x", "y"])
    with pytest.raises(ConfigError, match="twice"):
        parse_weights(["a.pt", "x=b.pt"], ["x"])


def test_help_loads_neither_torch_nor_opengl_nor_mujoco() -> None:
    script = """
        import sys
        from mpgrasp.bench.__main__ import main
        try:
            main(["--help"])
        except SystemExit as end:
            loaded = {name.partition(".")[0] for name in sys.modules}
            sys.exit(end.code or sorted(loaded & {"torch", "OpenGL", "mujoco", "rerun", "openvino"}) or 0)
    """
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(script)], cwd=REPOSITORY, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    for word in (
        "thin",
        "unseen",
        "dhrnet",
        "mppc",
        "--record",
        "--resume",
        "--runtime",
        "compare",
        "exit code",
    ):
        assert word in done.stdout


@pytest.mark.parametrize("workers", [0, 2])
def test_ctrl_c_keeps_every_finished_episode(tmp_path: Path, workers: int) -> None:
    script = """
        import sys, time
        import fakes, mpgrasp.episode.episode, mpgrasp.bench.playing.world_card
        mpgrasp.bench.playing.world_card.world_card = lambda *_: fakes.WORLD
        mpgrasp.episode.episode.run_episode = fakes.unhurried
        from mpgrasp.bench.__main__ import main
        if __name__ == "__main__":
            sys.exit(main(sys.argv[1:]))
    """
    (tmp_path / "command.py").write_text(textwrap.dedent(script))
    out = tmp_path / "out"
    path = os.pathsep.join([str(REPOSITORY), str(REPOSITORY / "tests")])
    command = [
        sys.executable,
        str(tmp_path / "command.py"),
        *["thin", *PLUG_INS, "--episodes", "200", "--out", str(out), "--workers", str(workers)],
    ]
    process = subprocess.Popen(
        command,
        env={**os.environ, "PYTHONPATH": path},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        # who runs the tests in the background has them ignore it, and so would the command
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    deadline = time.monotonic() + 60
    lines = out / "episodes.jsonl"
    while not (lines.exists() and lines.read_bytes().count(b"\n") >= 3) and time.monotonic() < deadline:
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to the whole group
    printed, errors = process.communicate(timeout=30)
    assert process.returncode == 130, errors
    assert "Traceback" not in errors
    kept = records(out)
    assert 3 <= len(kept) < 200
    assert [line["episode"] for line in kept] == sorted(line["episode"] for line in kept)
    summary = json.loads((out / "summary.json").read_text())
    assert not summary["complete"]
    assert summary["cells"][0]["n"] == len(kept)
    assert "fakes:FakeDetector" in printed


def test_a_run_without_a_report_has_all_else_and_gets_one_later(fake_world: object, tmp_path: Path) -> None:
    with_one, without = tmp_path / "with", tmp_path / "without"
    assert main(thin_command(with_one, episodes=2)) == 0
    assert main([*thin_command(without, episodes=2), "--no-report"]) == 0
    made = {name for name in os.listdir(with_one) if name not in os.listdir(without)}
    assert made >= {"report.html", "report.md"}
    assert made <= {"report.html", "report.md", "traces"}
    assert same_results(with_one, without)
    assert main(["report", str(without)]) == 0
    assert (without / "report.html").is_file()
