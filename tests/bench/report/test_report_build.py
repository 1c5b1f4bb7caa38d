from __future__ import annotations

import html
import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from bench_runs import PLUG_INS
from toy_runs import CARD, EPISODES, lines, make_run, trace

from mpgrasp.bench.__main__ import main
from mpgrasp.bench.analysis.hypotheses import Verdict, evaluate
from mpgrasp.bench.analysis.paper import CELLS, CLAIMS, STACKED, Claim, Measure, reported
from mpgrasp.bench.record import by_cell
from mpgrasp.bench.report.build import write_report
from mpgrasp.bench.report.document import Folded, Listing, Paragraph, Section, Table, to_html, to_markdown
from mpgrasp.bench.report.paper_tables import hypothesis_blocks
from mpgrasp.bench.results.trace import KEPT, prune_traces, read_trace
from mpgrasp.exceptions import OutputError


class Page(HTMLParser):
    """What a page refers to, its tables and the names of its pictures."""

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


def test_ids_are_unique_links_lead_somewhere_and_pictures_have_names(page: Page) -> None:
    assert len(page.ids) == len(set(page.ids))
    assert {r[1:] for r in page.references if r.startswith("#")} <= set(page.ids)
    assert page.tags.count("svg") >= 4
    assert page.tags.count("img") == 2 * 6
    assert page.unnamed == []


def test_every_failure_and_error_has_its_seed_and_the_command_that_plays_it_again(
    folder: Path, page: Page
) -> None:
    (table,) = [t for t in page.tables if "play it again" in t[0]]
    broken = [line for line in EPISODES if not line["success"]]
    assert len(table) == 1 + len(broken) == 1 + 5
    markdown = (folder / "report.md").read_text()
    for line in broken:
        command = (
            f"python -m mpgrasp.bench replay '{folder}' --episode {line['episode']} "
            f"--cell thin/{line['detector']}/{line['controller']} --record"
        )
        (row,) = [row for row in table if row[-1] == command]
        assert row[3] == str(line["scene_seed"])
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
    assert ["stacked", "DHRNet + MP-PC < DHRNet + MVP, time", "Table VI", "suite stacked absent"] in absent
    assert len(absent) - 1 == len(CLAIMS) - 3  # the three between DHRNet with either controller


def test_objects_are_told_apart_and_refused_meshes_are_named(tmp_path: Path) -> None:
    meshes = [{"name": "mug", "reason": None}, {"name": "sieve", "reason": "open: 120 edges"}]
    episodes = [*lines("10", object="mug"), *lines("xx11", object="jug")[2:]]
    run = make_run(tmp_path / "run", episodes, objects=meshes)
    write_report([run], run)
    tables = markdown_tables((run / "report.md").read_text())
    assert [["object", "DHRNet + MP-PC"], ["jug", "2/2"], ["mug", "1/2"]] in tables
    assert [["mesh", "why"], ["sieve", "open: 120 edges"]] in tables


def test_without_traces_and_card_the_report_says_so(tmp_path: Path) -> None:
    run = make_run(tmp_path / "run", lines("10"))
    write_report([run], run)
    text = (run / "report.md").read_text()
    assert "Not kept: singular values and ways of suite thin" in text
    assert "Not kept: stills of thin: DHRNet + MP-PC, success; thin: DHRNet + MP-PC, failure." in text
    assert "has no physics card" in text
    assert "No two cells of one suite" in text


@pytest.mark.parametrize("pattern", ["", "x", "xx"])
def test_runs_without_a_played_episode_have_a_report_too(tmp_path: Path, pattern: str) -> None:
    run = make_run(tmp_path / "run", lines(pattern))
    write_report([run], run)
    assert f"episodes that could not be played: {len(pattern)}" in (run / "report.md").read_text()


def test_a_broken_trace_is_said_and_one_of_another_run_is_not_shown(tmp_path: Path) -> None:
    episodes = lines("110")
    run = make_run(tmp_path / "run", episodes)
    trace(run / "traces", {**episodes[1], "state_hash": "other"})
    (run / "traces" / "thin-dhrnet-mppc-0000-success.npz").write_bytes(b"PK\3\4 no trace")
    write_report([run], run)
    text = (run / "report.md").read_text()
    assert "A trace cannot be read: not a trace" in text
    assert "Not kept: singular values" in text


def test_differences_between_runs_are_told_with_their_folders(tmp_path: Path) -> None:
    folders = [
        make_run(tmp_path / "a", lines("1"), camera={"name": "it is there and here"}),
        make_run(tmp_path / "b", lines("1", controller="mvp"), camera={"name": "gone"}),
    ]
    write_report(folders, tmp_path)
    told = f'name: "it is there and here" in `{folders[0]}`, "gone" in `{folders[1]}`'
    assert f"Not the same in all runs: camera.{told}" in (tmp_path / "report.md").read_text()


def test_a_ticks_time_is_split_between_the_network_and_all_else(tmp_path: Path) -> None:
    slow = {"render": 1.0, "detect": 6.0, "control": 1.0, "ik": 1.0, "physics": 1.0}
    run = make_run(
        tmp_path / "run",
        # an error row and the line of an older version have no times
        [
            *lines("11x0"),
            *lines("1", controller="mvp", timing=slow),
            *lines("0", detector="oracle", timing=slow),
            {**lines("11")[1], "controller": "mvp", "timing": {"detect": 9e9}},
        ],
        detectors=[{"name": "oracle", "reads_truth": True}, {"name": "dhrnet", "reads_truth": False}],
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


def test_text_is_escaped_and_code_is_marked() -> None:
    blocks = (
        Paragraph(text="a < b & `c<d>`"),
        Listing(lines=["x > y"]),
        Folded(summary="more", blocks=(Table(caption="t", headings=("h",), rows=[("p|q `r",)]),)),
    )
    page = to_html("<T>", [Section(title="S & S", blocks=blocks)])
    assert "<p>a &lt; b &amp; <code>c&lt;d&gt;</code></p>" in page
    assert "<h1>&lt;T&gt;</h1>" in page
    assert "<td>p|q `r</td>" in page
    markdown = to_markdown("<T>", [Section(title="S & S", blocks=blocks)])
    assert "| p\\|q `r |" in markdown
    assert "```sh\nx > y\n```" in markdown


@pytest.mark.parametrize(
    "cell",
    [
        "two\nlines",
        "two\r\nlines",
        "<script>alert(1)</script>",
        "a | b",
        "a \\| b",
        "``` <script> `",
        "` <b>",
    ],
)
def test_no_cell_of_markdown_tears_its_table_or_brings_html(cell: str) -> None:
    table = Table(caption=cell, headings=("a", cell), rows=[(cell, "last")], note=cell)
    blocks = (table, Paragraph(text=cell))
    markdown = to_markdown("T", [Section(title="S", blocks=blocks)])
    assert "<" not in markdown
    rows = [line for line in markdown.split("\n") if line.startswith("| ")]
    assert len(rows) == 3
    for row in rows:
        # a bar is the table's unless it is behind a backslash that is not itself behind one
        assert len(re.findall(r"(?<!\\)(?:\\\\)*\|", row)) == 3
    assert rows[2].endswith(" | last |")


def test_code_in_markdown_keeps_its_angle_brackets() -> None:
    markdown = to_markdown("T", [Section(title="S", blocks=(Paragraph(text="a < b, `c < d`"),))])
    assert "a &lt; b, `c < d`" in markdown


def claim(measure: Measure = Measure.SUCCESS) -> Claim:
    return Claim(
        suite="thin", measure=measure, better=("DHRNet", "MP-PC"), worse=("DHRNet", "MVP"), source="here"
    )


@pytest.mark.parametrize(
    ("better", "worse", "verdict"),
    [
        ("1" * 20, "0" * 20, Verdict.CONFIRMED),
        ("0" * 20, "1" * 20, Verdict.CONTRADICTED),
        ("11110" * 4, "01111" * 4, Verdict.NOT_CONFIRMED),
        ("1" * 20, "1" * 16 + "0" * 4, Verdict.NOT_CONFIRMED),
        ("xxxx", "1111", Verdict.ABSENT),
    ],
)
def test_a_claim_is_confirmed_only_by_a_significant_difference(
    better: str, worse: str, verdict: Verdict
) -> None:
    (found,) = evaluate(by_cell([*lines(better), *lines(worse, controller="mvp")]), [claim()])
    assert found.verdict is verdict


def test_p_is_corrected_over_the_claims_that_could_be_tested() -> None:
    cells = by_cell([*lines("1" * 8), *lines("0" * 8, controller="mvp")])
    once = evaluate(cells, [claim()])[0]
    assert once.p == once.p_holm == pytest.approx(2 / 2**8)
    absent = Claim(
        suite="single",
        measure=Measure.SUCCESS,
        better=("DHRNet", "MP-PC"),
        worse=("GG-CNN", "MP-PC"),
        source="",
    )
    both = evaluate(cells, [claim(), absent, claim(Measure.REFLEX)])
    assert both[0].p_holm == pytest.approx(4 / 2**8)
    assert both[1].absent == "suite single absent"


@pytest.mark.parametrize("measure", [Measure.SUCCESS, Measure.TIME])
@pytest.mark.parametrize(
    ("n", "verdict"), [(3, Verdict.UNDECIDABLE), (5, Verdict.UNDECIDABLE), (6, Verdict.CONFIRMED)]
)
def test_a_claim_cannot_be_decided_where_no_outcome_would_be_significant(
    measure: Measure, n: int, verdict: Verdict
) -> None:
    # better in every world: the smallest p there is, 2 / 2^n
    best = [*lines("1" * n, time_limit_s=100.0), *lines("0" * n, controller="mvp", time_limit_s=100.0)]
    (found,) = evaluate(by_cell(best), [claim(measure)])
    assert (found.verdict, found.agrees) == (verdict, True)
    assert found.p == pytest.approx(2 / 2**n)


def test_what_cannot_be_decided_is_counted_apart_and_no_part_of_the_correction() -> None:
    few = [*lines("111", suite="stacked"), *lines("000", suite="stacked", controller="mvp")]
    cells = by_cell([*lines("1" * 6), *lines("0" * 6, controller="mvp"), *few])
    stacked = replace(claim(), suite="stacked")
    decided, open_one = evaluate(cells, [claim(), stacked])
    assert decided.p_holm == decided.p
    assert decided.verdict is Verdict.CONFIRMED
    assert np.isnan(open_one.p_holm)
    text, table = hypothesis_blocks([decided, open_one])
    assert isinstance(text, Paragraph)
    assert isinstance(table, Table)
    assert "1 confirmed, 1 cannot be decided" in text.text
    assert "from 6 worlds on" in text.text
    assert [row[-2:] for row in table.rows] == [("0.0312", "confirmed"), ("-", "cannot be decided")]
    (alone,) = (block for block in hypothesis_blocks([decided]) if isinstance(block, Paragraph))
    assert "worlds" not in alone.text


def test_times_are_compared_in_pairs_and_whoever_failed_took_the_limit() -> None:
    fast = lines("1" * 8, time_limit_s=100.0)
    slow = [{**line, "sim_time_s": line["sim_time_s"] + 1} for line in lines("1" * 8, controller="mvp")]
    (found,) = evaluate(by_cell([*fast, *slow]), [claim(Measure.TIME)])
    assert found.p == pytest.approx(2 / 2**8)  # all eight signs alike
    assert found.verdict is Verdict.CONFIRMED
    assert found.worse - found.better == pytest.approx(1.0)
    gave_up = [{**line, "success": False, "sim_time_s": 1.0} for line in fast]
    (found,) = evaluate(by_cell([*gave_up, *slow]), [claim(Measure.TIME)])
    assert found.better == 100.0
    assert found.verdict is Verdict.CONTRADICTED


def test_reflexes_and_drift_count_less_as_better() -> None:
    stopped = [
        {**line, "reflex": {"limit": "joint_velocity"}, "blind_drift_m": 0.2} for line in lines("0" * 9)
    ]
    calm = lines("1" * 9, controller="mvp")
    for found in evaluate(by_cell([*stopped, *calm]), [claim(Measure.REFLEX), claim(Measure.DRIFT)]):
        assert found.verdict is Verdict.CONTRADICTED
    old = [{k: v for k, v in line.items() if k != "blind_drift_m"} for line in calm]
    (found,) = evaluate(by_cell([*stopped, *old]), [claim(Measure.DRIFT)])
    assert found.verdict is Verdict.ABSENT


def test_claims_agree_with_the_papers_own_tables() -> None:
    for item in CLAIMS:
        if item.measure is Measure.SUCCESS:
            (k, n), (j, m) = (reported(item.suite)[side] for side in (item.better, item.worse))
            assert k / n > j / m
        elif item.measure is Measure.TIME:
            seconds = dict(zip(CELLS, STACKED, strict=True))
            assert seconds[item.better] < seconds[item.worse]
    assert len(CLAIMS) == len(set(CLAIMS))
    assert reported("unseen")["DHRNet", "MP-PC"] == (36, 40)
    assert reported("mine") == {}


def test_a_trace_is_read_as_it_was_recorded(tmp_path: Path) -> None:
    (line,) = lines("0")
    trace(tmp_path, line)
    found = read_trace(tmp_path, "thin-dhrnet-mppc-0000", line)
    assert found is not None
    np.testing.assert_allclose(found.times, np.arange(30) / 10, atol=1e-6)
    np.testing.assert_allclose(found.positions[-1], [0.558, 0.0, 0.355], atol=1e-6)
    assert found.singular_values[0] == pytest.approx(0.2)
    assert found.entropy is not None
    assert found.entropy[0, 0] == pytest.approx(2.9, abs=1e-2)
    assert len(found.stills) == len(found.still_times) == 6
    assert found.still_phases[0] == "reach"
    assert found.still_phases[-1] == "lift"
    assert all(still[:4] == b"RIFF" for still in found.stills)
    assert read_trace(tmp_path, "thin-dhrnet-mppc-0000", {**line, "success": True}) is None
    assert read_trace(tmp_path, "thin-dhrnet-mppc-0000", {**line, "state_hash": "x"}) is None


def test_the_same_traces_are_kept_in_whatever_order_episodes_end(tmp_path: Path) -> None:
    episodes = lines("0" * KEPT + "0110")
    orders = (range(len(episodes)), reversed(range(len(episodes))))
    for folder, order in zip((tmp_path / "a", tmp_path / "b"), orders, strict=True):
        for k in order:
            trace(folder, episodes[k], ticks=3)
        prune_traces(folder)
    kept = {path.name: path.read_bytes() for path in (tmp_path / "a").iterdir()}
    assert kept.keys() == {path.name for path in (tmp_path / "b").iterdir()}
    name = "thin-dhrnet-mppc-{:04d}-{}.npz"
    ways = {name.format(k, "failure") for k in range(KEPT)} | {name.format(KEPT + 1, "success")}
    stills = {name.format(0, "failure-stills"), name.format(KEPT + 1, "success-stills")}
    assert kept.keys() == ways | stills


def test_an_episode_that_ends_otherwise_replaces_its_trace(tmp_path: Path) -> None:
    (line,) = lines("0")
    trace(tmp_path, line, ticks=3)
    trace(tmp_path, {**line, "success": True}, ticks=3)
    assert {path.name.rpartition("-0000-")[2] for path in tmp_path.iterdir()} == {
        "success.npz", "success-stills.npz",
    }  # fmt: skip


def test_a_long_episode_is_thinned_out_evenly(tmp_path: Path) -> None:
    (line,) = lines("1")
    trace(tmp_path, line, ticks=9000)
    found = read_trace(tmp_path, "thin-dhrnet-mppc-0000", line)
    assert found is not None
    assert len(found.times) <= 4001
    assert np.ptp(np.diff(found.times)) < 1e-3
    assert found.still_times[0] == 0.0
    assert found.still_times[-1] == pytest.approx(899.9, abs=30)


def test_traces_that_cannot_be_written_are_an_output_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="a trace cannot be written"):
        trace(tmp_path / "file" / "traces", lines("1")[0], ticks=2)
