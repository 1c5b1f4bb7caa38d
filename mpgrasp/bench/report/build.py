"""`python -m mpgrasp.bench report DIR`: report.html, which opens offline, and report.md for pull requests."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from mpgrasp.bench.analysis.hypotheses import evaluate
from mpgrasp.bench.analysis.paper import Baseline
from mpgrasp.bench.analysis.race import state_of
from mpgrasp.bench.report.document import Figure, Table
from mpgrasp.bench.report.evaluation import Evaluation
from mpgrasp.bench.report.filmstrips import NO_FILMS, Films, filmstrips
from mpgrasp.bench.report.glance import Glance, glance
from mpgrasp.bench.report.kept_traces import NO_TRACES, read_traces
from mpgrasp.bench.report.ladder import LadderSection, ladder_sections
from mpgrasp.bench.report.motion_figures import SuiteMotion, motion_figures
from mpgrasp.bench.report.orderings import Orderings, orderings, pair_table
from mpgrasp.bench.report.outcome_figures import outcome_figures
from mpgrasp.bench.report.pair_matrix import pair_matrices
from mpgrasp.bench.report.paper_tables import PaperTables, paper_tables
from mpgrasp.bench.report.recordings import Recording, recordings
from mpgrasp.bench.report.run_tables import (
    card_differences,
    card_tables,
    configuration_differences,
    failure_table,
    run_table,
)
from mpgrasp.bench.report.sweep import SweepSection, sweep_sections
from mpgrasp.bench.report.tables import (
    TickTimes,
    motion_table,
    object_tables,
    overview_table,
    refused_meshes_table,
    tick_times,
)
from mpgrasp.bench.report.thickness import ThinObjects, thin_objects
from mpgrasp.bench.results.runs import Runs, find_runs
from mpgrasp.bench.stored_lines import by_cell
from mpgrasp.exceptions import OutputError
from mpgrasp.files.atomic import replace_file
from mpgrasp.suite import base_name

FILES = ("report.html", "report.md")
DRAWN = 12
"""Suites of a report, the points of a sweep among them, that have figures and filmstrips of their own."""


@dataclass(frozen=True, kw_only=True)
class Report:
    """Everything that a report says; the templates lay it out, in the order of `sections.j2`."""

    suites: Sequence[str]
    """Names without the points of a sweep."""
    counts: str
    """Numbers of what was played, in a sentence."""
    glance: Glance | None
    overview: Table
    races: Sequence[str]
    """How each race ended."""
    ladders: Sequence[LadderSection]
    sweeps: Sequence[SweepSection]
    by_object: Sequence[Table]
    refused_meshes: Table | None
    paper: PaperTables
    orderings: Orderings
    pairs: Table | None
    matrices: Sequence[Table]
    """The same by suite, where enough methods met."""
    outcomes: Mapping[str, Sequence[Figure]]
    """Figures by suite; none where nothing could be played."""
    motion: Table
    motion_by_suite: Sequence[SuiteMotion]
    unreadable_traces: Sequence[str]
    thin_objects: ThinObjects | None
    ticks: TickTimes | None
    films: Films
    not_drawn: str
    """Sentence on figures that are left out; empty where none is."""
    recordings: Sequence[Recording]
    failures: Table | None
    runs: Table
    commands: Sequence[str]
    differences: Sequence[str]
    """Differences of the runs' settings."""
    card: Sequence[Table]
    """Physics card of the first run; empty where it has none."""
    card_differences: Sequence[str]


def write_report(folders: Sequence[Path], out: Path) -> Path:
    """Write report.html and report.md of some runs into a folder; returns the path of the first.

    Raises:
        OutputError: a run that cannot be read, or a file that cannot be written.
        ConfigError: a cell that two runs have played.
    """
    # loads Jinja, which the command's --help needs not
    from mpgrasp.bench.report.rendering import to_html, to_markdown

    runs = find_runs(folders)
    with _writing(out / FILES[0]):  # or it would be known only once all is drawn
        pass
    report = make_report(runs, out)
    for name, text in zip(FILES, (to_html(report), to_markdown(report)), strict=True):
        _replace(out / name, text)
    return out / FILES[0]


def make_report(runs: Runs, out: Path | None = None) -> Report:
    """The report on some runs, as text, numbers and figures; recordings are linked from a folder `out`."""
    evaluation = Evaluation.of(runs)
    ladders = (run.configuration.ladder for run in runs.runs)
    rungs = {point for card in ladders if card is not None for point in card.points}
    tests = [test for test in evaluation.tests if test.suite not in rungs]
    drawn = runs.suites if len(runs.suites) <= DRAWN else []
    kept = read_traces(runs) if drawn else NO_TRACES
    return Report(
        suites=list(dict.fromkeys(map(base_name, runs.suites))),
        counts=_counts_text(evaluation),
        glance=glance(evaluation),
        overview=overview_table(evaluation),
        races=_races(runs),
        ladders=ladder_sections(runs),
        sweeps=sweep_sections(runs),
        by_object=object_tables(evaluation),
        refused_meshes=refused_meshes_table(runs),
        paper=paper_tables(evaluation),
        orderings=orderings({baseline: evaluate(runs.cells, baseline=baseline) for baseline in Baseline}),
        pairs=pair_table(tests),
        matrices=pair_matrices(tests),
        outcomes={suite: outcome_figures(evaluation, suite) for suite in drawn},
        motion=motion_table(evaluation),
        motion_by_suite=[motion_figures(evaluation, suite, kept) for suite in drawn],
        unreadable_traces=kept.unreadable,
        thin_objects=thin_objects(evaluation),
        ticks=tick_times(runs),
        films=filmstrips(runs, kept) if drawn else NO_FILMS,
        not_drawn="" if drawn else _not_drawn_text(runs),
        recordings=recordings(runs, out),
        failures=failure_table(runs),
        runs=run_table(runs),
        commands=[run.about.command for run in runs.runs],
        differences=configuration_differences(runs),
        card=card_tables(runs),
        card_differences=card_differences(runs),
    )


def _races(runs: Runs) -> list[str]:
    return [
        f"{cell.suite}: {state_of(run.configuration.race, cell.suite, by_cell(run.lines))}."
        for run in runs.runs
        if run.configuration.race is not None
        for cell in list(by_cell(run.lines))[:1]
    ]


def _counts_text(evaluation: Evaluation) -> str:
    rows, suites = evaluation.summaries.values(), evaluation.runs.suites
    n, errors = sum(row.n for row in rows), sum(row.errors for row in rows)
    failures = n - sum(row.successes for row in rows)
    text = (
        f"Suites: {len(suites)}, cells: {len(rows)}, episodes: {n}, failures: {failures}, "
        f"episodes that could not be played: {errors}."
    )
    if not all(run.complete for run in evaluation.runs.runs):
        text += " Not all is there yet: a run is not complete."
    return text


def _not_drawn_text(runs: Runs) -> str:
    if not runs.suites:
        return ""
    return f"Not drawn: {len(runs.suites)} suites, of which no more than {DRAWN} are drawn in one report."


def _replace(file: Path, text: str) -> None:
    """Replace a file as a whole."""
    with _writing(file):
        replace_file(file, text)


@contextmanager
def _writing(file: Path) -> Iterator[None]:
    """Make a file's folder, and have what goes wrong on the way to it be an error of output."""
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        yield
    except OSError as error:
        raise OutputError(
            f"a report cannot be written ({error.strerror})",
            got=str(file),
            allowed="a directory one may write to",
        ) from error
