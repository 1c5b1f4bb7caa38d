"""Laws of sweeps: a grid of settings, played as the cells of one run."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from itertools import product
from pathlib import Path
from typing import Any

import fakes
import pytest
from bench_runs import PLUG_INS, records, same_results

from mpgrasp.bench.__main__ import main
from mpgrasp.bench.record import Task
from mpgrasp.bench.results.reader import read_run
from mpgrasp.suite import base_name, episode_seed, point_name

ORACLE = ["thin", "--detector", "oracle", "--workers", "0", "--quiet"]
GRID = ["--set", "controller.gamma=0,4/3,8", "--set", "controller.alpha=0.2,1"]
POINTS = [f"thin[gamma={g},alpha={a}]" for g, a in product(("0", "4/3", "8"), ("0.2", "1"))]
REFERENCE = "thin[gamma=4/3,alpha=0.2]"
TUNABLE = ["thin", "--detector", "fakes:TunableDetector", *PLUG_INS[2:], "--quiet", "--episodes", "1"]


def sweep(out: Path, *more: str, episodes: int = 3) -> list[str]:
    return ["sweep", *ORACLE, *GRID, "--episodes", str(episodes), "--out", str(out), *more]


@pytest.fixture
def swept(fake_world: object, tmp_path: Path) -> Path:
    """A sweep of 6 points with 3 episodes each."""
    assert main(sweep(tmp_path / "run")) == 0
    return tmp_path / "run"


@pytest.fixture
def played(fake_world: pytest.MonkeyPatch) -> list[dict[str, Any]]:
    """What every episode was played with."""
    found: list[dict[str, Any]] = []

    def run_episode(scene: Any, seed: int, **parts: Any) -> fakes.FakeResult:
        found.append({**parts, "scene": scene, "seed": seed})
        return fakes.FakeResult(seed, scene)

    fake_world.setattr("mpgrasp.episode.episode.run_episode", run_episode)
    return found


def test_every_point_is_a_cell_over_the_same_worlds_as_the_suite(swept: Path, tmp_path: Path) -> None:
    lines = records(swept)
    assert [line["suite"] for line in lines] == [name for name in POINTS for _ in range(3)]
    assert main([*ORACLE, "--episodes", "3", "--out", str(tmp_path / "plain")]) == 0
    seeds = [line["scene_seed"] for line in records(tmp_path / "plain")]
    assert [line["scene_seed"] for line in lines] == seeds * len(POINTS)


def test_every_point_is_played_with_its_settings(played: list[dict[str, Any]], tmp_path: Path) -> None:
    assert main(sweep(tmp_path / "run", episodes=2)) == 0
    found = [(item["controller"].config.gamma, item["controller"].config.alpha) for item in played]
    assert found == [point for point in product((0.0, 4 / 3, 8.0), (0.2, 1.0)) for _ in range(2)]


SETTINGS: list[tuple[str, Callable[[dict[str, Any]], Any], list[Any]]] = [
    ("scene.half_extent=0.05,0.1", lambda p: p["scene"].half_extent, [0.05, 0.1]),
    ("scene.objects=['key'],['ruler']", lambda p: p["scene"].objects, [("key",), ("ruler",)]),
    ("sensor.subpixel=0.05,0.1", lambda p: p["config"].sensor.subpixel, [0.05, 0.1]),
    ("camera.crop=300,none", lambda p: p["config"].camera.crop, [300, None]),
    ("camera.intrinsics.cx=319.5,320", lambda p: p["config"].camera.intrinsics.cx, [319.5, 320.0]),
    ("execution.lift=0.12,0.15", lambda p: p["config"].execution.lift, [0.12, 0.15]),
    ("motion.smoothing=3,5", lambda p: p["config"].motion.smoothing, [3, 5]),
    ("ik.collisions=true,false", lambda p: p["config"].ik.collisions, [True, False]),
    ("reflex.contact_force=80,100", lambda p: p["config"].reflex.contact_force, [80.0, 100.0]),
    ("episode.start_jitter=0,0.05", lambda p: p["config"].start_jitter, [0.0, 0.05]),
    ("episode.ik.damping=1e-6,1e-7", lambda p: p["config"].ik.damping, [1e-6, 1e-7]),
    ("controller.grid.extent=0.34,0.68", lambda p: p["controller"].config.grid.extent, [0.34, 0.68]),
    ("controller.choice=grid,pool", lambda p: p["controller"].config.choice, ["grid", "pool"]),
    ("controller.cost_heights=none,[0.4, 0.5]",
     lambda p: p["controller"].config.cost_heights, [None, (0.4, 0.5)]),
    ("detector.play=0.002,2*0.002", lambda p: p["detector"].config.play, [0.002, 0.004]),
]  # fmt: skip


@pytest.mark.parametrize(("text", "read", "values"), SETTINGS, ids=[text for text, _, _ in SETTINGS])
def test_any_setting_of_any_group_can_be_swept(
    played: list[dict[str, Any]],
    tmp_path: Path,
    text: str,
    read: Callable[[dict[str, Any]], Any],
    values: list[Any],
) -> None:
    assert main(["sweep", *ORACLE, "--episodes", "1", "--out", str(tmp_path / "run"), "--set", text]) == 0
    assert [read(item) for item in played] == values
    assert len({line["scene_seed"] for line in records(tmp_path / "run")}) == 1


TEN = ("controller.gamma=1,2", "controller.v_1=0.1,0.08", "sensor.subpixel=0.05,0.06",
       "execution.lift=0.12,0.15", "episode.start_jitter=0,0.05", "controller.alpha=1",
       "controller.window=0.1", "sensor.min_z=0.1", "ik.damping=1e-6", "motion.smoothing=3")  # fmt: skip


def test_ten_settings_are_set_at_once(played: list[dict[str, Any]], tmp_path: Path) -> None:
    words = [word for text in TEN for word in ("--set", text)]
    out = tmp_path / "run"
    assert main(["sweep", *ORACLE, "--episodes", "1", "--out", str(out), *words]) == 0
    assert len(played) == len({line["suite"] for line in records(out)}) == 2**5
    assert {item["config"].motion.smoothing for item in played} == {3}
    report = (out / "report.md").read_text()
    assert "## Sweep" in report
    assert "Not drawn: 32 suites" in report


def test_ten_settings_of_two_values_each_are_laid_out() -> None:
    from mpgrasp.bench.commands.sweep import make_parser
    from mpgrasp.bench.playing.planning import make_plan

    several = [
        text if "," in text else text.replace("=", "=0.9*") + "," + text.partition("=")[2] for text in TEN
    ]
    several[-1] = "motion.smoothing=3,4"
    words = [word for text in several for word in ("--set", text)]
    plan, _ = make_plan(make_parser().parse_args(["thin", "--detector", "oracle", *words]))
    assert len(plan.suites) == len({task.stem for task in plan.tasks() if task.episode == 0}) == 2**10
    gammas = [plan.settings_of(suite.name).controllers["mppc"] for suite in plan.suites]
    assert {getattr(config, "gamma", None) for config in gammas} == {1.0, 2.0}


def test_run_json_has_the_grid_and_all_settings_of_every_point(swept: Path) -> None:
    configuration = read_run(swept).configuration
    grid = configuration.sweep
    assert grid is not None
    assert configuration.suite == grid.suite == "thin"
    assert [(axis.setting, axis.name, axis.texts) for axis in grid.axes] == [
        ("controller.gamma", "gamma", ("0", "4/3", "8")), ("controller.alpha", "alpha", ("0.2", "1")),
    ]  # fmt: skip
    assert [axis.values for axis in grid.axes] == [(0, 1.33333333, 8), (0.2, 1)]
    assert grid.references == {"oracle/mppc": REFERENCE}
    assert (
        [part.suite.name for part in configuration.parts] == [point.suite for point in grid.points] == POINTS
    )
    found = [part.settings["controller"]["mppc"] for part in configuration.parts]
    assert [(item["gamma"], item["alpha"]) for item in found] == list(
        product((0.0, 1.33333333, 8.0), (0.2, 1.0))
    )
    assert "worlds" not in json.loads((swept / "run.json").read_text())  # a controller changes no world


def test_worlds_that_differ_from_the_first_stand_in_run_json(
    fake_world: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def card(suite: Any, config: Any, seed: int) -> Any:
        return fakes.WORLD.__class__(
            physics={}, camera={"crop": config.camera.crop}, motion={}, ik={}, reflex={}
        )

    fake_world.setattr("mpgrasp.bench.playing.world_card.world_card", card)
    words = ["--set", "camera.crop=300,350", "--set", "controller.gamma=1,2"]
    assert main(["sweep", *ORACLE, "--episodes", "1", "--out", str(tmp_path / "run"), *words]) == 0
    run = read_run(tmp_path / "run")
    assert run.camera == {"crop": 300}
    assert set(run.worlds) == {"thin[crop=350,gamma=1]", "thin[crop=350,gamma=2]"}


def test_the_reference_is_the_point_with_the_suite_s_own_values_of_each_method(
    fake_world: object, tmp_path: Path
) -> None:
    words = ["--controller", "mvp,mppc,open_loop", "--set", "controller.alpha=0.5,0.2,1"]
    assert main(["sweep", *ORACLE, "--episodes", "1", "--out", str(tmp_path / "a"), *words]) == 0
    grid = read_run(tmp_path / "a").configuration.sweep
    assert grid is not None
    assert grid.references == {
        "oracle/mvp": "thin[alpha=1]",
         "oracle/mppc": "thin[alpha=0.2]", "oracle/open_loop": "thin[alpha=0.5]",
    }  # fmt: skip
    # idle beside the suite's own alpha, so that no point is like the suite: the first one
    words = [
        "--controller",
        "mvp",
        "--set",
        "controller.alpha=0.5,0.2",
        "--set",
        "controller.peak_threshold=0.1",
    ]
    assert main(["sweep", *ORACLE, "--episodes", "1", "--out", str(tmp_path / "b"), *words]) == 0
    grid = read_run(tmp_path / "b").configuration.sweep
    assert grid is not None
    assert grid.references == {"oracle/mvp": "thin[alpha=0.5]"}


def test_a_sweep_that_was_killed_is_resumed(
    swept: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    part = tmp_path / "part"
    shutil.copytree(swept, part)
    lines = (part / "episodes.jsonl").read_text().splitlines(keepends=True)
    (part / "episodes.jsonl").write_text("".join([lines[4], *lines[:2], lines[9]]))
    (part / "summary.json").unlink()
    assert main(["--resume", str(part)]) == 0
    assert same_results(part, swept)
    assert main(["sweep", "--resume", str(part)]) == 0
    assert (
        main(
            [
                *[word for word in sweep(part, "--resume", str(part)) if word not in ("--out",)][:-3],
                "--resume",
                str(part),
            ]
        )
        == 0
    )
    assert same_results(part, swept)
    capsys.readouterr()
    other = [*ORACLE, "--set", "controller.gamma=0,8", "--episodes", "3"]
    assert main(["sweep", *other, "--resume", str(part)]) == 2
    assert "cannot resume with another configuration" in capsys.readouterr().err


def test_a_run_that_is_no_sweep_is_not_resumed_as_one(
    fake_world: object, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*ORACLE, "--episodes", "1", "--out", str(tmp_path / "plain")]) == 0
    capsys.readouterr()
    assert main(["sweep", "--resume", str(tmp_path / "plain")]) == 2
    assert "is no sweep" in capsys.readouterr().err


def test_a_point_is_replayed_bit_for_bit(swept: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    cell = f"{POINTS[4]}/oracle/mppc"
    assert main(["replay", str(swept), "--episode", "1", "--cell", cell]) == 0
    printed = capsys.readouterr().out
    assert "bit for bit" in printed
    assert "configuration is another one" not in printed
    assert main(["replay", str(swept), "--episode", "1"]) == 2
    assert f"--cell {cell}" in capsys.readouterr().err


def test_points_are_compared_with_each_other_and_with_a_run_of_the_suite(
    swept: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*ORACLE, "--episodes", "2", "--out", str(tmp_path / "plain")]) == 0
    capsys.readouterr()
    for a, n in ((str(swept / POINTS[0] / "oracle" / "mppc"), 3), (str(tmp_path / "plain"), 2)):
        assert main(["compare", a, str(swept / POINTS[5] / "oracle" / "mppc")]) == 0
        printed = capsys.readouterr().out
        assert f" {n} " in printed
        assert "thin[gamma=8,alpha=1]" in printed.replace("\n", "")
        assert ".controller.mppc.gamma: " in printed
        assert ".suite.name" not in printed
    assert main(["compare", str(swept), str(swept)]) == 0


def test_terminal_and_report_show_the_points_side_by_side(
    swept: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    capsys.readouterr()
    assert main(sweep(tmp_path / "again")) == 0
    printed = capsys.readouterr().out
    assert all(name in printed for name in POINTS)  # brackets are no markup
    report = (swept / "report.md").read_text()
    for text in (printed, report):
        rows = [line.replace("|", " ").split()[:2] for line in text.splitlines() if "reference" in line]
        assert ["4/3", "0.2"] in rows
    assert "success by controller.gamma and controller.alpha" in report
    assert report.startswith("# mpgrasp: thin\n")


def test_one_numeric_setting_is_drawn_over_its_values(fake_world: object, tmp_path: Path) -> None:
    for text, drawn in (("controller.gamma=0,4/3,8", True), ("controller.choice=grid,pool", False)):
        out = tmp_path / text.partition("=")[0]
        words = ["--controller", "mppc,mvp", "--episodes", "2", "--out", str(out), "--set", text]
        assert main(["sweep", *ORACLE, *words]) == 0
        page, alt = (
            (out / "report.html").read_text(),
            "Success and mean time over controller.gamma, suite thin.",
        )
        assert (alt in page) is drawn


def test_a_plug_in_gets_the_settings_of_each_point(played: list[dict[str, Any]], tmp_path: Path) -> None:
    words = ["--set", "detector.threshold=0.2,0.4", "--set", "camera.crop=300,350"]
    assert main(["sweep", *TUNABLE, "--out", str(tmp_path / "run"), *words]) == 0
    found = [(item["detector"].threshold, item["config"].camera.crop) for item in played]
    assert found == list(product((0.2, 0.4), (300, 350)))


def test_files_of_points_have_names_of_their_own() -> None:
    labels = ("a=4/3", "a=4*3", "a=4-3", "a=" + "9" * 300, "a=" + "9" * 301)
    stems = [Task(point_name("thin", label), 0, "d", "c").stem for label in labels]
    assert len(set(stems)) == len(labels)
    assert max(map(len, stems)) < 120
    assert Task("thin", 0, "d", "c").stem == "thin-d-c-0000"


def test_a_point_has_the_seeds_of_its_suite_and_other_brackets_are_names() -> None:
    assert base_name("thin[gamma=4/3,pattern=[[0, 1]]]") == "thin"
    assert episode_seed("thin[gamma=8]", 3, 5) == episode_seed("thin", 3, 5)
    for name in ("thin", "thin[1]", "[a=1]", "thin[a=1]b"):
        assert base_name(name) == name


BAD = [
    (["lighting.power=1,2"], "unknown group of settings; got 'lighting'"),
    (["controller.gama=1,2"], "at gama=1: setting controller.gama: no setting of mppc"),
    (["controller.gamma=1,nan"], "at gamma=nan: setting controller of mppc, gamma is not finite"),
    (["controller.gamma=1,-inf"], "at gamma=-inf: setting controller of mppc, gamma is not finite"),
    (["controller.gamma=1,-1"], "at gamma=-1: setting controller of mppc: unusable gamma; got -1.0"),
    (["controller.gamma=1,4/3m"], "--set controller.gamma is unusable; got '4/3m'"),
    (["controller.gamma=1,2,"], "--set controller.gamma has an empty value"),
    (["controller.gamma=1,high"], "at gamma=high: setting controller of mppc, gamma is unusable"),
    (["controller.gamma=[1, 2],1"], "at gamma=[1, 2]: setting controller of mppc, gamma is unusable"),
    (["controller.gamma=1,1.0"], "has a value twice"),
    (["controller.gamma=1,2", "controller.gamma=3"], "is given twice"),
    (["controller.gamma=1"], "a sweep has no setting with several values"),
    ([], "a sweep has no setting with several values"),
    (["controller.grid=0.34,0.68"], "at grid=0.34: setting controller of mppc, grid is not a table"),
    (["controller.grid.size=1,2"], "at size=1: setting controller of mppc, grid: unknown key; got 'size'"),
    (["controller.grid.cell.x=1,2"], "cell is unusable"),
    (["controller.grid.weighted=true,false"], "controller.grid.weighted has no effect: choice is pool"),
    (["controller.alpha=0.2,1", "controller.peak_threshold=0.1,0.5"], "at alpha=1,peak_threshold=0.1: "),
    (["sensor.subpixel=0,0.1", "sensor.correlation_px=1,2"], "correlation_px has no effect: subpixel is 0"),
    (["sensor.shadows=1,0"], "at shadows=1: --set sensor, shadows is unusable"),
    (["camera.crop=300,481"], "at crop=481: --set camera: unusable crop of the camera; got 481"),
    (["scene.jitter=[0, 0],[1, 1]"],
     "at jitter=[0, 0]: --set scene.jitter has no effect: placing is not stack"),
    (["episode.noise=true,false"], "at noise=true: --set episode: no suite decides noise"),
    (["episode.sensor.subpixels=1,2"], "at subpixels=1: --set sensor: unknown key; got 'subpixels'"),
    (["execution.lift=0.1,0.2", "execution.lift.x=1"], "lift has a value already"),
    (["detector.threshold=0.1,0.2"], "at threshold=0.1: setting detector.threshold: no setting of oracle"),
    (["detector.max_opening=0.08,0"], "at max_opening=0: setting detector of oracle: contact width outside"),
    (["reflex.q_min=[0, 0],[1, 1]"], "q_min has the wrong shape"),
    (["ik.posture_cost=0,0.01", "ik.posture_rate=0.1"],
     "at posture_cost=0: --set ik.posture_rate has no effect"),
    (["gamma=1,2"], "unusable --set; got 'gamma=1,2'"),
    (["controller.gamma"], "unusable --set; got 'controller.gamma'"),
    ([f"controller.gamma={','.join(map(str, range(1025)))}"],
     "too many points in the grid of a sweep; got 1025"),
]  # fmt: skip


@pytest.mark.parametrize(("texts", "message"), BAD, ids=[" ".join(texts)[:60] for texts, _ in BAD])
def test_a_bad_point_is_one_line_and_exit_code_2_before_anything_is_played(
    played: list[dict[str, Any]],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    texts: list[str],
    message: str,
) -> None:
    words = [word for text in texts for word in ("--set", text)]
    refused(["sweep", *ORACLE, *words], message, tmp_path / "out", capsys)
    assert played == []


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["paper", *GRID], "a sweep of several suites; got 'paper'; allowed: one suite"),
        (["thin", "--no-noise", "--set", "sensor.subpixel=0,1"],
         "sensor.subpixel has no effect; got '--no-noise'"),
        (["thin", "--no-noise", "--set", "episode.sensor.subpixel=0,1"], "has no effect; got '--no-noise'"),
        ([*TUNABLE[:-2], "--set", "detector.limit=1,2"],
         "detector.limit: no setting of fakes:TunableDetector"),
        (["thick", *GRID], "unknown suite; got 'thick'"),
        (GRID, "arguments are required: SUITE"),
    ],
)  # fmt: skip
def test_a_sweep_that_cannot_be_is_refused(
    fake_world: object, tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], message: str
) -> None:
    refused(["sweep", *words], message, tmp_path / "out", capsys)


def test_a_plug_in_that_refuses_a_later_point_does_so_before_anything_is_played(
    played: list[dict[str, Any]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["thin", "--detector", f"{__name__}:Picky", *PLUG_INS[2:], "--set", "detector.threshold=0.5,2"]
    refused(
        ["sweep", *words], "plug-in cannot be made (ValueError: threshold of 2)", tmp_path / "out", capsys
    )
    assert played == []


class Picky(fakes.FakeDetector):
    """Checks its settings when it is made, as plug-ins do."""

    def __init__(self, threshold: float) -> None:
        super().__init__()
        if threshold > 1:
            raise ValueError(f"threshold of {threshold}")


def refused(words: list[str], message: str, out: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*words, "--out", str(out)]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith("mpgrasp: error: ")
    assert printed.err.count("\n") == 1
    assert message in printed.err
    assert not out.exists()
