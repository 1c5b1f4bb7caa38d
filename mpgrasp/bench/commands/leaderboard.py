"""`python -m mpgrasp.bench leaderboard DIR ...`: checks submitted runs, and ranks what they played."""

from __future__ import annotations

import io
import random
from argparse import Namespace
from collections.abc import Sequence
from contextlib import redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mpgrasp.command_line import SEED, Parser, whole
from mpgrasp.exceptions import MpgraspError, OutputError

if TYPE_CHECKING:
    from mpgrasp.bench.report.document import Table
    from mpgrasp.bench.results.run_card import SuitePart
    from mpgrasp.bench.results.runs import Run

_EPILOG = """\
A submission is the folder of a finished run: run.json, episodes.jsonl and summary.json. Of each it is
checked that it is complete, that it was played in the worlds of its seed, in a suite as it ships with mpgrasp
and with no setting of the world changed, and from a checkout without changes; and --replay plays some of its
episodes again, which must come out the same bit for bit. Runs that fail are left out of the ranking, and why
is said.

Methods are ranked by paired tests over the worlds that they share: a method's rank is 1 and the number of
methods that are significantly better.

exit code: 0 all runs passed, 1 some did not, 2 unusable input or output.
"""
EXIT_REFUSED = 1


def make_parser() -> Parser:
    """The command line's options."""
    parser = Parser(
        prog="python -m mpgrasp.bench leaderboard",
        description="Check submitted runs and rank their methods, with intervals.",
        epilog=_EPILOG,
        allow_abbrev=False,
    )
    add = parser.add_argument
    add("folders", metavar="DIR", nargs="+", type=Path, help="folder of a run, or of runs")
    add(
        "--replay",
        metavar="N",
        type=whole(0, 1000),
        default=2,
        help="episodes of each run that are played again, drawn by --seed (default: 2)",
    )
    add("--seed", metavar="S", type=SEED, default=0, help="of the draw (default: 0)")
    add("--out", metavar="FILE.md", type=Path, help="write the ranking as Markdown too")
    return parser


def main(command: Sequence[str]) -> int:
    """Check, rank and print; return the exit code.

    Raises:
        MpgraspError: a run that cannot be read, or a file that cannot be written.
    """
    from mpgrasp.bench.report.evaluation import Evaluation
    from mpgrasp.bench.report.terminal_tables import print_report_table
    from mpgrasp.bench.results.runs import find_runs

    arguments = make_parser().parse_args(command)
    runs = find_runs(arguments.folders)
    verdicts = {run.folder: faults(run, arguments) for run in runs.runs}
    passed = [folder for folder, found in verdicts.items() if not found]
    for folder, found in verdicts.items():
        print(f"{folder}: {'passed' if not found else '; '.join(found)}")
    tables = []
    if passed:
        tables = _tables(Evaluation.of(find_runs(passed)))
        for table in tables:
            print_report_table(table)
    if arguments.out is not None:
        _write(arguments.out, tables, verdicts)
    return 0 if len(passed) == len(verdicts) else EXIT_REFUSED


def faults(run: Run, arguments: Namespace) -> list[str]:
    """Return what is wrong with a run, in words; nothing where it passes."""
    from mpgrasp.bench.stored_lines import by_cell
    from mpgrasp.suite import episode_seed

    found = []
    if run.complete is not True:
        found.append("not complete")
    git = run.about.made_with.git
    if git is None or git.modified:
        found.append("not made from a checkout without changes")
    seed = run.configuration.seed
    wrong = sum(
        line.seed != seed or line.scene_seed != episode_seed(line.suite, seed, line.episode)
        for line in run.lines
    )
    if wrong:
        found.append(f"{wrong} episodes in worlds that are not those of seed {seed}")
    found += [text for part in run.configuration.parts if (text := _changed(run, part))]
    if not run.configuration.noise:
        found.append("played without the sensor's noise")
    if not found and arguments.replay:
        tasks = [line.task for lines in by_cell(run.lines).values() for line in lines]
        chosen = random.Random(arguments.seed).sample(tasks, min(arguments.replay, len(tasks)))
        found += [text for task in chosen if (text := _replayed(run, task))]
    return found


def _changed(run: Run, part: SuitePart) -> str:
    """Return how a suite, or its world, differs from what ships; nothing where it does not."""
    from mpgrasp.bench.playing.description import suite_card
    from mpgrasp.exceptions import ConfigError
    from mpgrasp.files.json_values import difference, json_value
    from mpgrasp.settings.tree import WORLD_GROUPS, tree
    from mpgrasp.suite import load_suite

    name = part.suite.name
    try:
        shipped = load_suite(name)
    except ConfigError:
        return f"{name} is no suite that ships"
    before, now = suite_card(shipped).as_row(), part.suite.as_row()
    settings = json_value(tree(shipped.episode_config(camera=run.configuration.camera), {}, {}))
    for own in ("controller", "detector"):  # are the submission's own affair
        before.pop(own, None)
        now.pop(own, None)
    where = difference(before, now)
    if where is None and part.settings:
        world: dict[str, Any] = {group: settings.get(group) for group in (*WORLD_GROUPS, "execution")}
        there = {group: part.settings.get(group) for group in world}
        where = difference(_as_far_as(world, there), there)
    return "" if where is None else f"{name} was changed ({where.words('as it ships', 'here')})"


def _as_far_as(settings: Any, there: Any) -> Any:
    """Return settings without those that were not there yet when a run was made."""
    if not (isinstance(settings, dict) and isinstance(there, dict)):
        return settings
    return {key: _as_far_as(value, there[key]) for key, value in settings.items() if key in there}


def _replayed(run: Run, task: Any) -> str:
    """Return what came of an episode that was played again; nothing where it is the same bit for bit."""
    from mpgrasp.bench.commands import replay

    words = [str(run.folder), "--episode", str(task.episode), "--cell", str(task.cell)]
    if len({line.suite for line in run.lines}) == 1 and run.configuration.suites == ():
        words[-1] = str(task.cell.method)
    said = io.StringIO()
    try:
        with redirect_stdout(said):
            code = replay.main(words)
    except MpgraspError as error:
        return f"{task} cannot be played again here ({error})"
    return "" if code == 0 else f"{task} does not come out the same"


def _tables(evaluation: Any) -> list[Table]:
    from mpgrasp.bench.analysis.leaderboard import ranks
    from mpgrasp.bench.report.document import Table
    from mpgrasp.bench.report.intervals import rate_text
    from mpgrasp.bench.report.names import name_of

    return [
        Table(
            caption=f"{suite}",
            headings=("rank", "method", "success", "median time", "stops"),
            rows=[
                (
                    str(row.rank),
                    name_of(row.summary.cell.method),
                    rate_text(row.summary.successes, row.summary.n),
                    "-" if row.summary.median_time_s is None else f"{row.summary.median_time_s:.1f} s",
                    str(row.summary.reflex_stops),
                )
                for row in ranks(suite, evaluation.summaries, evaluation.tests)
            ],
            note="Rank: 1 and the number of methods that are significantly better (McNemar, Holm p < 0.05).",
        )
        for suite in evaluation.runs.suites
    ]


def _write(file: Path, tables: Sequence[Table], verdicts: dict[Path, list[str]]) -> None:
    from mpgrasp.files.atomic import replace_file

    lines = ["# Leaderboard", ""]
    for table in tables:
        lines += [f"## {table.caption}", "", "| " + " | ".join(table.headings) + " |"]
        lines += ["|" + " --- |" * len(table.headings)]
        lines += ["| " + " | ".join(row) + " |" for row in table.rows]
        lines += ["", table.note, ""]
    lines += [f"- `{folder.name}`: {'; '.join(found) or 'passed'}" for folder, found in verdicts.items()]
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        replace_file(file, "\n".join(lines) + "\n")
    except OSError as error:
        raise OutputError(f"the ranking cannot be written: {error}", got=str(file)) from error
