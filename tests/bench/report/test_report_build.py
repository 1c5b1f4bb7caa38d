from __future__ import annotations

import html
import json
import re
import shutil
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import fakes
import pytest
from bench_runs import PLUG_INS, detector_row, stop_row
from msgspec.structs import replace as changed
from toy_runs import CARD, EPISODES, lines, make_run, show, trace

from mpgrasp.bench.__main__ import main
from mpgrasp.bench.analysis.paper import CLAIMS
from mpgrasp.bench.record import played
from mpgrasp.bench.report.build import write_report
from mpgrasp.bench.results.runs import find_runs
from mpgrasp.recording.recorder import NullRecorder, Recorder


class Page(HTMLParser):
    """References of a page, its tables and the images and figures without a name."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.references: list[str] = []
        self.ids: list[str] = []
        self.unnamed: list[str] = []
        self.tables: list[list[list[str]]] = []
        self._cell = False
        self._open: list[str] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        attributes = dict(attrs)
        self.tags.append(tag)
        self.references += [attributes[k] or "" for k in ("src", "href", "xlink:href") if k in attributes]
        self.references += re.findall(r"url\(([^)]*)\)", " ".join(v or "" for v in attributes.values()))
        self.ids += [attributes["id"] or ""] if "id" in attributes else []
        if (tag == "img" and not attributes.get("alt")) or (
            tag == "svg" and not attributes.get("aria-label")
        ):
            self.unnamed.append(tag)
        if tag == "table":
            self.tables.append([])
        elif tag == "tr":
            self.tables[-1].append([])
        elif tag in ("td", "th"):
            self.tables[-1][-1].append("")
            self._cell = True

    def handle_endtag(self, tag: str) -> None:
        if tag in ("td", "th"):
            self._cell = False

    def handle_data(self, data: str) -> None:
        if self._cell:
            self.tables[-1][-1][-1] += data


def markdown_tables(text: str) -> list[list[list[str]]]:
    tables: list[list[list[str]]] = []
    before = False
    for row in text.splitlines():
        if row.startswith("| "):
            cells = [html.unescape(c.strip().replace("\\|", "|")) for c in re.split(r"(?<!\\)\|", row)[1:-1]]
            if not before:
                tables.append([])
            if set(cells) != {"---"}:
                tables[-1].append(cells)
        before = row.startswith("| ")
    return tables


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = make_run(tmp_path_factory.mktemp("report") / "a run", EPISODES, **CARD)
    trace(made / "traces", EPISODES[0])
    trace(made / "traces", EPISODES[2])
    assert main(["report", str(made)]) == 0
    return made


@pytest.fixture(scope="module")
def page(folder: Path) -> Page:
    return Page((folder / "report.html").read_text())


def test_the_page_loads_nothing_and_runs_nothing(folder: Path, page: Page) -> None:
    assert page.references
    for reference in page.references:
        assert reference.startswith(("data:", "#")), reference
    assert "script" not in page.tags
    assert "@import" not in (folder / "report.html").read_text()
    assert "default-src 'none'" in (folder / "report.html").read_text()


def test_ids_are_unique_links_lead_somewhere_and_figures_have_names(page: Page) -> None:
    assert len(page.ids) == len(set(page.ids))
    assert {r[1:] for r in page.references if r.startswith("#")} <= set(page.ids)
    assert page.tags.count("svg") >= 4
    assert page.tags.count("img") == 2 * 6
    assert page.unnamed == []


def test_every_failure_and_error_has_its_seed_and_the_command_that_plays_it_again(
    folder: Path, page: Page
) -> None:
    (table,) = [t for t in page.tables if "play it again" in t[0]]
    broken = [line for line in EPISODES if not line.success]
    assert len(table) == 1 + len(broken) == 1 + 5
    markdown = (folder / "report.md").read_text()
    for line in broken:
        command = (
            f"python -m mpgrasp.bench replay '{folder}' --episode {line.episode} "
            f"--cell thin/{line.detector}/{line.controller} --record"
        )
        (row,) = [row for row in table if row[-1] == command]
        assert row[3] == str(line.scene_seed)
        assert f"`{command}`" in markdown
    (error,) = [row for row in table if row[5].startswith("error: a bug")]
    assert "errors/4.txt" in error[5]


def test_markdown_and_html_have_the_same_tables(folder: Path, page: Page) -> None:
    found = markdown_tables((folder / "report.md").read_text())
    assert len(found) >= 6
    shown = [[[cell.replace("`", "") for cell in row] for row in table] for table in found]
    assert shown == [[[c.strip().replace("`", "") for c in row] for row in table] for table in page.tables]


def test_numbers_are_those_of_the_summary(
    fake_world: object, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    plug_ins = [word.replace("FakeController", "FakeController,fakes:OtherController") for word in PLUG_INS]
    assert main(["thin", *plug_ins, "--episodes", "7", "--out", str(tmp_path), "--quiet"]) == 0
    summary = json.loads((tmp_path / "summary.json").read_text())
    table = Page((tmp_path / "report.html").read_text()).tables[0]
    assert len(table) == 3
    for row, cell in zip(table[1:], summary["cells"], strict=True):
        n, successes = cell["n"], cell["successes"]
        low, high = 100 * cell["wilson_low"], 100 * cell["wilson_high"]
        assert row[2] == f"{successes}/{n} = {100 * cell['rate']:.1f} % [{low:.1f}-{high:.1f}]"
        assert row[3] == f"{cell['median_time_s']:.1f} s"
        mean, low, high = (cell[f"mean_time_{end}"] for end in ("s", "low", "high"))
        assert row[4] == f"{mean:.1f} s [{low:.1f}-{high:.1f}]"
    (test,) = summary["paired_tests"]
    (pairs,) = [t for t in markdown_tables((tmp_path / "report.md").read_text()) if "McNemar p" in t[0]]
    assert pairs[1][3:7] == [str(test[key]) for key in ("n", "both", "a_alone", "b_alone")]


def test_the_papers_cells_that_are_absent_are_said_to_be_absent(page: Page) -> None:
    (table,) = [t for t in page.tables if t[0][1] == "paper"]
    here = {row[0]: row[1:3] for row in table[1:]}
    assert here["TF-Grasp + MVP"] == ["4/10 = 40.0 % [16.8-68.7]", "not run"]
    assert here["DHRNet + MP-PC"][1].startswith("3/4 = 75.0 % [")
    assert here["DHRNet + MP-PC"][1].endswith(", 1 errors")
    assert here["my_net:Net + MP-PC"][0] == "-"
    (absent,) = [t for t in page.tables if t[0][-1] == "why"]
    claim = "DHRNet + MP-PC < DHRNet + MVP, time"
    assert ["stacked", claim, "Table VI", "published", "suite stacked absent"] in absent
    assert len(absent) - 1 == len(CLAIMS) - 3  # the three between DHRNet with either controller


def test_objects_are_told_apart_and_refused_meshes_are_named(tmp_path: Path) -> None:
    mesh: dict[str, Any] = {"file": "it.obj", "sha256": None, "grasp_qualities": []}
    meshes = [{**mesh, "name": "mug"}, {**mesh, "name": "sieve", "reason": "open: 120 edges"}]
    episodes = [*lines("10", object="mug"), *lines("xx11", object="jug")[2:]]
    run = make_run(tmp_path / "run", episodes, objects=meshes)
    write_report([run], run)
    tables = markdown_tables((run / "report.md").read_text())
    assert [["object", "DHRNet + MP-PC"], ["jug", "2/2"], ["mug", "1/2"]] in tables
    assert [["mesh", "why"], ["sieve", "open: 120 edges"]] in tables


def test_a_table_with_objects_knocked_off_is_a_failure_and_says_how_many(tmp_path: Path) -> None:
    off: dict[str, Any] = {"outcome": "knocked_off", "knocked_off": ["mug", "jug"], "in_basket": ["pen"]}
    run = make_run(tmp_path / "run", lines("0", time_limit_s=900.0, **off))
    write_report([run], run)
    (failures,) = [t for t in markdown_tables((run / "report.md").read_text()) if "what happened" in t[0]]
    assert failures[1][failures[0].index("what happened")] == "knocked_off: 2 objects beside the basket"


def test_singular_stops_stand_in_brackets_behind_all(tmp_path: Path) -> None:
    stop: dict[str, Any] = {"outcome": "reflex", "reflex": stop_row()}
    stopped = [
        changed(lines("0", min_singular_value=value, **stop)[0], episode=episode)
        for episode, value in enumerate((0.01, 0.04, 0.2))
    ]
    run = make_run(tmp_path / "run", [*stopped, *lines("1", controller="mvp", min_singular_value=None)])
    write_report([run], run)
    (motion,) = [
        t for t in markdown_tables((run / "report.md").read_text()) if "reflex stops (singular)" in t[0]
    ]
    column = motion[0].index("reflex stops (singular)")
    assert [row[column] for row in motion[1:]] == ["3 (2)", "0"]


def test_sections_that_have_nothing_to_show_are_left_out(tmp_path: Path) -> None:
    run = make_run(tmp_path / "run", lines("11"))
    write_report([run], run)
    text = (run / "report.md").read_text()
    found = re.findall(r"^## (.*)$", text, re.MULTILINE)
    assert found[0] == "Results"
    assert {"Runs", "Success and time"} <= set(found)
    missing = {
        "Physics card",
        "Paired tests",
        "Failures",
        "The paper's orderings",
        "Ladders",
        "Race",
        "Sweep",
    }
    assert not missing & set(found)


def test_a_report_opens_with_all_rates_in_one_picture_and_a_verdict(tmp_path: Path) -> None:
    cells = [*lines("1" * 30), *lines("1" * 12 + "0" * 18, controller="straight_down")]
    run = make_run(tmp_path / "run", cells)
    write_report([run], run)
    text = (run / "report.md").read_text()
    assert text.index("success with 95 % intervals") < text.index("Suites: 1, cells: 2")
    assert "thin: DHRNet + MP-PC succeeds in 30/30" in text
    assert "significantly more than 1 of 1 others." in text
    page = (run / "report.html").read_text()
    assert "floor: nothing learned" in page
    assert "ceiling: knows the truth" not in page


def test_without_traces_the_report_gives_the_commands_that_make_them(tmp_path: Path) -> None:
    run = make_run(tmp_path / "run", [*lines("x110"), *lines("00", controller="mvp")])
    write_report([run], run)
    text, page = (run / "report.md").read_text(), Page((run / "report.html").read_text())
    replay = f"python -m mpgrasp.bench replay {run} --episode {{}} --cell thin/dhrnet/{{}} --record"
    assert "Not kept: singular values and ways of suite thin (DHRNet + MP-PC, DHRNet + MVP)." in text
    assert f"```sh\n{replay.format(1, 'mppc')}\n{replay.format(0, 'mvp')}\n```" in text
    (table,) = [t for t in page.tables if t[0][-1] == "what makes it"]
    assert table[1:] == [
        ["thin", "DHRNet + MP-PC", "success", "1", replay.format(1, "mppc")],
        ["thin", "DHRNet + MP-PC", "failure", "3", replay.format(3, "mppc")],
        ["thin", "DHRNet + MVP", "failure", "0", replay.format(0, "mvp")],
    ]
    assert "No episode to show: thin: DHRNet + MVP, success." in text
    # all rates at a glance, the figures of rates and times, and no empty ones
    assert page.tags.count("svg") == page.tags.count("figure") == 3
    assert "img" not in page.tags


@pytest.mark.parametrize("where", ["traces", "recordings"])
def test_of_a_cell_with_traces_of_the_run_or_of_a_replay_nothing_is_missing(
    tmp_path: Path, where: str
) -> None:
    run = make_run(tmp_path / "run", [*lines("1"), *lines("1", controller="mvp")])
    trace(run / where, lines("1")[0])
    write_report([run], run)
    text = (run / "report.md").read_text()
    assert "Not kept: singular values and ways of suite thin (DHRNet + MVP)." in text
    assert "Figure in report.html: thin: DHRNet + MP-PC, way of the tool point from above" in text
    assert "Figure in report.html: thin: DHRNet + MP-PC, success: episode 0" in text


def test_a_recorded_replay_brings_the_trace_of_its_episode(
    tmp_path: Path, fake_world: pytest.MonkeyPatch
) -> None:
    def shown(*arguments: Any, recorder: Recorder, **others: Any) -> fakes.FakeResult:
        show(recorder)
        return fakes.run_episode(*arguments, recorder=recorder, **others)

    for kind in ("film.FilmRecorder", "rerun.RerunRecorder"):
        fake_world.setattr(f"mpgrasp.recording.{kind}", lambda *_, **__: NullRecorder())
    fake_world.setattr("mpgrasp.episode.episode.run_episode", shown)
    assert (
        main(["thin", *PLUG_INS, "--episodes", "1", "--camera", "ray", "--out", str(tmp_path), "--quiet"])
        == 0
    )
    shutil.rmtree(tmp_path / "traces")
    (run,) = find_runs([tmp_path]).runs
    assert run.trace(run.lines[0]) is None
    assert main(["replay", str(tmp_path), "--episode", "0", "--record"]) == 0
    found = run.trace(run.lines[0])
    assert found is not None
    assert found.stills


def test_a_tick_without_a_singular_value_hides_no_others(tmp_path: Path) -> None:
    run = make_run(tmp_path / "run", lines("1"))
    trace(run / "traces", lines("1")[0], unmeasured=1)
    write_report([run], run)
    assert "DHRNet + MP-PC down to 0.103 in 1 episodes" in (run / "report.md").read_text()
    trace(run / "traces", lines("1")[0], unmeasured=30)
    write_report([run], run)
    assert "DHRNet + MP-PC not measured in 1 episodes" in (run / "report.md").read_text()


@pytest.mark.parametrize("pattern", ["", "x", "xx"])
def test_runs_without_a_played_episode_have_a_report_too(tmp_path: Path, pattern: str) -> None:
    run = make_run(tmp_path / "run", lines(pattern))
    write_report([run], run)
    assert f"episodes that could not be played: {len(pattern)}" in (run / "report.md").read_text()


def test_a_broken_trace_is_said_and_one_of_another_run_is_not_shown(tmp_path: Path) -> None:
    episodes = lines("110")
    run = make_run(tmp_path / "run", episodes)
    trace(run / "traces", changed(list(played(episodes))[1], state_hash="other"))
    (run / "traces" / "thin-dhrnet-mppc-0000-success.npz").write_bytes(b"PK\3\4 no trace")
    write_report([run], run)
    text = (run / "report.md").read_text()
    assert "A trace cannot be read: not a trace" in text
    assert "Not kept: singular values" in text


def test_differences_between_runs_are_told_with_their_folders(tmp_path: Path) -> None:
    folders = [
        make_run(tmp_path / "a", lines("1"), camera={"name": "it is there and here"}),
        make_run(tmp_path / "b", lines("1", controller="mvp"), camera={"name": "gone"}, noise=False),
    ]
    write_report(folders, tmp_path)
    told = f'name: "it is there and here" in `{folders[0]}`, "gone" in `{folders[1]}`'
    text = (tmp_path / "report.md").read_text()
    assert f"Not the same in all runs: camera.{told}" in text
    assert f"Not the same in all runs: noise: true in `{folders[0]}`, false in `{folders[1]}`" in text


def test_a_ticks_time_is_split_between_the_network_and_all_else(tmp_path: Path) -> None:
    slow = {"render": 1.0, "detect": 6.0, "control": 1.0, "ik": 1.0, "physics": 1.0}
    run = make_run(
        tmp_path / "run",
        # an error row has no times, and of a plug-in's tick not all may be known
        [
            *lines("11x0"),
            *lines("1", controller="mvp", timing=slow),
            *lines("0", detector="oracle", timing=slow),
            *lines("11", controller="mvp", timing={"detect": 9e9})[1:],
        ],
        detectors=[detector_row("oracle", reads_truth=True), detector_row("dhrnet")],
    )
    write_report([run], run)
    text = (run / "report.md").read_text()
    (table,) = [t for t in markdown_tables(text) if "network inference" in t[0]]
    assert [row[1:4] + row[-1:] for row in table[1:]] == [
        ["DHRNet + MP-PC", "3", "10.0", "20.0 %"],
        ["DHRNet + MVP", "1", "10.0", "60.0 %"],
        ["oracle + MP-PC", "1", "10.0", "no network"],
    ]
    # three ticks with 8 ms and one with 4 ms of all else, of 40 ms
    assert "everything apart from network inference: 70.0 %" in text


def test_a_report_of_others_has_no_section_on_thickness(folder: Path) -> None:
    assert "Thin objects" not in (folder / "report.md").read_text()


def test_folders_of_runs_are_put_into_one_report(tmp_path: Path) -> None:
    make_run(tmp_path / "a", lines("1111111111"))
    make_run(tmp_path / "b", lines("0000000000", controller="mvp"), command="python -m mpgrasp.bench other")
    assert main(["report", str(tmp_path)]) == 0
    (pairs,) = [t for t in markdown_tables((tmp_path / "report.md").read_text()) if "McNemar p" in t[0]]
    assert pairs[1][3:] == ["10", "0", "10", "0", f"{2 / 2**10:.3g}", f"{2 / 2**10:.3g} *"]
    assert "python -m mpgrasp.bench other" in (tmp_path / "report.html").read_text()


def test_the_same_runs_give_the_same_bytes(folder: Path, tmp_path: Path) -> None:
    for name in ("one", "two"):
        assert main(["report", str(folder), "--out", str(tmp_path / name)]) == 0
    for name in ("report.html", "report.md"):
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()


def test_unusable_folders_are_one_line_and_exit_code_2(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    twice = [str(make_run(tmp_path / name, lines("1"))) for name in ("a", "b")]
    for command, message in (
        ([str(tmp_path / "absent")], "no run there"),
        ([*twice, "--out", str(tmp_path / "out")], "two runs have played thin/dhrnet/mppc"),
        ([], "required: DIR"),
    ):
        assert main(["report", *command]) == 2
        error = capsys.readouterr().err
        assert error.count("\n") == 1
        assert message in error


@pytest.mark.parametrize("words", [("--help",), ("report", "--help")])
def test_help_loads_no_template_engine(words: tuple[str, ...]) -> None:
    code = (
        "import atexit, runpy, sys; atexit.register(lambda: print('jinja2' in sys.modules))\n"
        f"sys.argv = {['bench', *words]}; runpy.run_module('mpgrasp.bench', run_name='__main__')"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.splitlines()[-1] == "False", done.stderr
