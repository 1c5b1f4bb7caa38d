"""Several suites in one run, and episodes in which a table is cleared: lines, summary, table, replay."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any

import fakes
import pytest
from bench_runs import clearing_row, grasp_row, pick_row, records, stop_row
from rich.console import Console

from mpgrasp.bench.__main__ import main
from mpgrasp.bench.analysis.paper import Baseline
from mpgrasp.bench.analysis.summary import ClearingCounts, summarise, time_limits
from mpgrasp.bench.playing.plan import Plan
from mpgrasp.bench.playing.programme import PROGRAMMES, Programme, load_suites
from mpgrasp.bench.record import Line, Method, line_of
from mpgrasp.bench.report.terminal_tables import print_table
from mpgrasp.bench.stored_lines import by_cell
from mpgrasp.episode.config import ClearingConfig
from mpgrasp.exceptions import ConfigError
from mpgrasp.scene.objects.model import ObjectModel
from mpgrasp.suite import load_suite, parse_suite, suite_names

DETECTOR, CONTROLLER = "fakes:FakeDetector", "fakes:FakeController"


def clearing(episode: int = 0, *, success: bool = True, time: float = 200.0, **changes: Any) -> Line:
    """A line of a clearing of three objects."""
    picks = [pick_row(success=success) for success in (True, False, True, True)]
    row = clearing_row(
        suite="stacked", episode=episode, scene_seed=episode, object="3 objects", success=success,
        sim_time_s=time, picks=picks, in_basket=["a", "b"], knocked_off=["c"],
    )  # fmt: skip
    return line_of({**row, **({} if success else {"outcome": "no_grasp"}), **changes})


def grasp(episode: int = 0) -> Line:
    """A line of a single grasp."""
    return line_of(grasp_row(suite="thin", episode=episode, object="usb_stick", sim_time_s=12.0))


PUBLISHED, ROBUST = ("mvp", "mppc"), ("mvp_robust", "mppc_robust")


@pytest.mark.parametrize(
    ("baseline", "controllers"),
    [(None, (*PUBLISHED, *ROBUST)), (Baseline.PUBLISHED, PUBLISHED), (Baseline.ROBUST, ROBUST)],
)
def test_the_paper_is_three_detectors_with_the_controllers_of_its_baselines_a_ceiling_and_floors(
    baseline: Baseline | None, controllers: tuple[str, ...]
) -> None:
    paper = PROGRAMMES["paper"]
    assert paper.suites == ("single", "unseen", "thin", "stacked")
    cells = [(d, c) for d in ("ggcnn", "tfgrasp", "dhrnet") for c in controllers]
    assert [tuple(method) for method in paper.methods(baseline=baseline)] == [
        *cells,
        ("oracle", "mppc"),
        ("dhrnet", "open_loop"),
        ("heuristic", "mppc_robust"),
        ("dhrnet", "straight_down"),
    ]


@pytest.mark.parametrize("more", [["thin"], ["paper", "--controller", "mppc"]])
def test_a_baseline_is_refused_where_it_decides_nothing(
    more: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*more, "--baseline", "robust", "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "--baseline" in error


def test_who_is_named_plays_instead_of_the_papers_cells() -> None:
    paper = PROGRAMMES["paper"]
    assert paper.methods(["oracle"]) == tuple(("oracle", name) for name in (*PUBLISHED, *ROBUST))
    assert paper.methods(["oracle"], baseline=Baseline.ROBUST) == tuple(("oracle", name) for name in ROBUST)
    assert paper.methods(None, ["mppc"]) == tuple((d, "mppc") for d in paper.detectors)
    assert paper.methods(["a"], ["b"]) == (("a", "b"),)


def test_a_suite_is_played_as_often_as_the_paper_did_unless_told_otherwise() -> None:
    suites = (load_suite("unseen"), load_suite("thin"))
    plan = Plan(suites=suites, programme="p", methods=(Method("d", "c"), Method("e", "c")))
    tasks = list(plan.tasks())
    assert [sum(task.suite == name for task in tasks) for name in ("unseen", "thin")] == [80, 20]
    assert [task.suite for task in tasks] == ["unseen"] * 80 + ["thin"] * 20
    few = Plan(suites=suites, methods=plan.methods, episodes=3)
    assert len(list(few.tasks())) == few.count() == 2 * 2 * 3
    assert len({task.stem for task in tasks}) == len(set(tasks)) == 100


def test_stacked_is_a_table_to_be_cleared() -> None:
    suite = load_suite("stacked")
    config = suite.episode_config(camera="ray", noise=False)
    assert suite.trial == "clear"
    assert isinstance(config, ClearingConfig)
    assert config.time_limit > 721  # the slowest in Table VI
    assert (config.camera_backend, config.noise) == ("ray", False)
    assert not isinstance(load_suite("thin").episode_config(), ClearingConfig)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"trial": "juggle"}, "trial is unusable; got 'juggle'; allowed: grasp, clear"),
        ({"trial": "clear"}, "clearing needs a basket"),
        ({"trials": 0}, "trials out of range; got 0"),
        ({"trials": "many"}, "trials is unusable; got 'many'"),
        ({"scene": {"objects": [{"box": [0.1]}]}}, "box is unusable; got .*; allowed: a list of 3"),
        ({"scene": {"objects": [{"box": 0.1}]}}, "box is unusable; got 0.1; allowed: a list of 3"),
        ({"scene": {"objects": [{"ball": 0.1}]}}, "unknown key; got 'ball'"),
    ],
)
def test_faulty_trials_and_boxes_are_refused(changes: dict[str, Any], message: str) -> None:
    from mpgrasp.exceptions import MpgraspError

    with pytest.raises(MpgraspError, match=message):
        parse_suite("s", {"title": "t", "scene": {"objects": ["key"]}, **changes})


def test_thickness_is_what_the_declaration_says_and_all_else_is_alike() -> None:
    suite = load_suite("thickness")
    sticks = [scene.objects[0] for scene in suite.scenes]
    assert all(isinstance(stick, ObjectModel) for stick in sticks)
    sizes = [stick.size for stick in sticks if isinstance(stick, ObjectModel)]
    assert [round(1000 * float(size[2])) for size in sizes] == [2, 3, 4, 5, 6, 8, 10, 12]
    assert {(round(size[0], 6), round(size[1], 6)) for size in sizes} == {(0.06, 0.018)}
    assert suite.trials % len(suite.scenes) == 0


def test_the_thin_variants_lie_under_the_conditions_of_thin() -> None:
    thin, variants = load_suite("thin").scene, load_suite("thin_variants")
    assert [scene.objects[0] for scene in variants.scenes] == ["key", "washer", "ruler", "plate_brick"]
    for scene in variants.scenes:
        for name in ("half_extent", "cloth_unevenness", "cloth_wavelength", "camouflage", "pose"):
            assert getattr(scene, name) == getattr(thin, name)


def test_unknown_names_list_suites_and_programmes() -> None:
    with pytest.raises(ConfigError, match=r"unknown suite; got 'thick'; allowed: .*thin.*paper"):
        load_suites("thick")
    assert not set(suite_names()) & set(PROGRAMMES)


def test_a_programme_can_be_played_in_parts_that_keep_its_order() -> None:
    assert [suite.name for suite in load_suites("paper", ["thin", "unseen"])] == ["unseen", "thin"]
    with pytest.raises(ConfigError, match=r"unknown suite of paper; got 'thick'; allowed: .*thin"):
        load_suites("paper", ["thick"])
    with pytest.raises(ConfigError, match="--suites with a single suite; got 'thin'; allowed: paper"):
        load_suites("thin", ["thin"])


def test_a_clearing_that_came_to_no_end_counts_as_its_time_limit() -> None:
    lines = [clearing(0, time=200.0), clearing(1, time=300.0), clearing(2, success=False, time=50.0)]
    (cell,) = summarise(lines)
    assert cell.time_limit_s == 900.0
    assert cell.mean_time_s == pytest.approx((200 + 300 + 900) / 3)
    assert (cell.median_time_s, cell.successes) == (300.0, 2)
    assert cell.median_time_low is not None
    assert cell.median_time_high is not None
    assert cell.median_time_low <= 300.0 <= cell.median_time_high
    assert time_limits(by_cell(lines[:2])) == {"stacked": None}


def test_attempts_and_objects_add_up_over_clearings_and_all_stops_count() -> None:
    stops = [stop_row(limit="contact_force"), stop_row(limit="joint_velocity")]
    cleared, thin = summarise([clearing(0), clearing(1, stops=stops, reflex=stops[0]), grasp()])
    assert cleared.clearing == ClearingCounts(
        attempts=8, failed_attempts={"missed": 2}, in_basket=4, knocked_off=2, left=0
    )
    assert cleared.reflexes == {"contact_force": 1, "joint_velocity": 1}
    assert thin.clearing is None


def test_the_table_shows_picks_only_where_something_was_cleared() -> None:
    for lines, shown in (([grasp()], False), ([grasp(), clearing()], True)):
        out = Console(file=io.StringIO(), width=200)
        print_table(summarise(lines), out)
        assert isinstance(out.file, io.StringIO)
        assert ("missed:1" in out.file.getvalue()) is shown
        assert ("knocked" in out.file.getvalue()) is shown


@pytest.fixture
def two_suites(fake_world: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    """A programme of two suites that takes no time."""
    programme = Programme(
        title="t", suites=("thin", "stacked"), detectors=(DETECTOR,), controllers=(CONTROLLER,),
        references=(Method(DETECTOR, "fakes:OtherController"),),
    )  # fmt: skip
    fake_world.setitem(PROGRAMMES, "both", programme)
    fake_world.setattr("mpgrasp.episode.clearing.run_clearing", fakes.run_episode)
    return fake_world


def run_both(out: Path, *more: str) -> int:
    return main(["both", "--workers", "0", "--quiet", "--episodes", "2", "--out", str(out), *more])


def test_a_programme_is_one_run_in_one_directory(two_suites: object, tmp_path: Path) -> None:
    assert run_both(tmp_path) == 0
    lines = records(tmp_path)
    assert [line["suite"] for line in lines] == ["thin"] * 4 + ["stacked"] * 4
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["complete"]
    assert [(cell["suite"], cell["n"]) for cell in summary["cells"]] == [("thin", 2)] * 2 + [
        ("stacked", 2)
    ] * 2
    assert [test["suite"] for test in summary["paired_tests"]] == ["thin", "stacked"]
    run = json.loads((tmp_path / "run.json").read_text())
    assert run["configuration"]["suite"] == "both"
    assert [part["suite"]["name"] for part in run["configuration"]["suites"]] == ["thin", "stacked"]
    assert run["configuration"]["suites"][1]["episode"]["recovery_time"] > 0
    assert set(run["worlds"]) == {"thin", "stacked"}


def test_a_programme_that_was_cut_short_is_finished_in_its_second_suite(
    two_suites: object, tmp_path: Path
) -> None:
    assert run_both(tmp_path) == 0
    file = tmp_path / "episodes.jsonl"
    whole = [{k: v for k, v in line.items() if k != "timing"} for line in records(tmp_path)]
    file.write_text("".join(file.read_text().splitlines(keepends=True)[:5]))
    assert main(["--resume", str(tmp_path)]) == 0
    assert [{k: v for k, v in line.items() if k != "timing"} for line in records(tmp_path)] == whole


def test_until_ci_goes_on_in_each_suite_by_itself(two_suites: object, tmp_path: Path) -> None:
    assert run_both(tmp_path, "--until-ci", "70", "--max-episodes", "8") == 0
    summary = json.loads((tmp_path / "summary.json").read_text())
    for cell in summary["cells"]:
        assert 100 * (cell["wilson_high"] - cell["wilson_low"]) < 70 or cell["n"] == 8


def test_an_episode_of_a_programme_is_replayed_by_suite_and_cell(
    two_suites: object, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run_both(tmp_path)
    capsys.readouterr()
    cell = f"{DETECTOR}/{CONTROLLER}"
    assert main(["replay", str(tmp_path), "--episode", "1", "--cell", f"stacked/{cell}"]) == 0
    assert "episode 1 of stacked" in capsys.readouterr().out
    assert main(["replay", str(tmp_path), "--episode", "1", "--cell", cell]) == 2
    assert f"stacked/{cell}" in capsys.readouterr().err
