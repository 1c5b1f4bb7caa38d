"""`python -m mpgrasp.bench report DIR`: report.html, which opens offline, and report.md for pull requests."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from mpgrasp.bench.analysis.hypotheses import evaluate
from mpgrasp.bench.analysis.summary import paired_tests, summarise
from mpgrasp.bench.report.document import Block, Paragraph, Section, to_html, to_markdown
from mpgrasp.bench.report.gallery import film_blocks, motion_pictures, outcome_pictures, read_traces
from mpgrasp.bench.report.paper_tables import hypothesis_blocks, pair_table, paper_tables
from mpgrasp.bench.report.tables import (
    card_blocks,
    failure_blocks,
    motion_table,
    object_blocks,
    overview_table,
    run_blocks,
    timing_blocks,
)
from mpgrasp.bench.report.thickness import thickness_blocks
from mpgrasp.bench.results.runs import Runs, find_runs
from mpgrasp.exceptions import OutputError
from mpgrasp.files.atomic import replace_file

FILES = ("report.html", "report.md")


def write_report(folders: Sequence[Path], out: Path) -> Path:
    """Write report.html and report.md of some runs into a folder; returns the path of the first.

    Raises:
        OutputError: a run that cannot be read, or a file that cannot be written.
        ConfigError: a cell that two runs have played.
    """
    title, sections = make_report(find_runs(folders))
    for name, text in zip(FILES, (to_html(title, sections), to_markdown(title, sections)), strict=True):
        _replace(out / name, text)
    return out / FILES[0]


def make_report(runs: Runs) -> tuple[str, list[Section]]:
    """Title and sections of the report, which say the same in HTML and Markdown."""
    rows = {(row["suite"], row["detector"], row["controller"]): row for row in summarise(runs.lines)}
    tests = paired_tests(runs.lines)
    traced, troubles = read_traces(runs)
    n, errors = sum(row["n"] for row in rows.values()), sum(row["errors"] for row in rows.values())
    failures = n - sum(row["successes"] for row in rows.values())
    said = (
        f"Suites: {len(runs.suites)}, cells: {len(rows)}, episodes: {n}, failures: {failures}, "
        f"episodes that could not be played: {errors}."
    )
    if any(not run.complete for run in runs.runs):
        said += " Not all is there yet: a run is not complete."
    thin = thickness_blocks(runs)
    pairs: list[Block] = [pair_table(tests)] if tests else [Paragraph(text="No two cells of one suite.")]
    sections = [
        Section(
            title="Results", blocks=[Paragraph(text=said), overview_table(rows), *object_blocks(runs, rows)]
        ),
        Section(title="The paper's tables", blocks=paper_tables(runs, rows, tests)),
        Section(title="The paper's orderings", blocks=hypothesis_blocks(evaluate(runs.cells))),
        Section(title="Paired tests", blocks=pairs),
        Section(title="Success and time", blocks=outcome_pictures(runs, rows)),
        Section(
            title="How the arm moved",
            blocks=[
                motion_table(rows),
                *(Paragraph(text=f"A trace cannot be read: {trouble}") for trouble in troubles),
                *motion_pictures(runs, traced),
            ],
        ),
        *([Section(title="Thin objects", blocks=thin)] if thin else []),
        Section(title="Where the time goes", blocks=timing_blocks(runs)),
        Section(title="Filmstrips", blocks=film_blocks(runs, traced)),
        Section(title="Failures", blocks=failure_blocks(runs)),
        Section(title="Runs", blocks=run_blocks(runs)),
        Section(title="Physics card", blocks=card_blocks(runs)),
    ]
    return f"mpgrasp: {', '.join(runs.suites) or 'no episodes'}", sections


def _replace(file: Path, text: str) -> None:
    """Replace a file as a whole."""
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        replace_file(file, text)
    except OSError as error:
        raise OutputError(
            f"a report cannot be written ({error.strerror})",
            got=str(file),
            allowed="a directory one may write to",
        ) from error
