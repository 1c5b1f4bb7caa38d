"""`python -m mpgrasp.bench replay RUN --episode K`: does an episode, played again, come out the same?"""

from __future__ import annotations

import json
from argparse import Namespace
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from msgspec.structs import replace as replace_fields

from mpgrasp.bench.record import Cell, ErrorLine, Line, PlayedLine, Task
from mpgrasp.command_line import EPISODE, Parser
from mpgrasp.exceptions import ConfigError, OutputError
from mpgrasp.files.json_values import difference, differences

if TYPE_CHECKING:
    from mpgrasp.bench.playing.plan import Plan
    from mpgrasp.bench.results.run_card import Configuration

EXIT_DIFFERENT = 1

_EPILOG = """\
The episode is played in this process, by the command that the run was made with. Everything in its line
but `timing` must come out the same, the hash of the final simulation state included.

exit code: 0 the same bit by bit, 1 something differs, 2 unusable input.
"""


def make_parser() -> Parser:
    """The command line's options."""
    parser = Parser(
        prog="python -m mpgrasp.bench replay",
        description="Play one episode of a run again, to look at it or to check that it repeats.",
        epilog=_EPILOG,
    )
    add = parser.add_argument
    add("run", metavar="RUN", type=Path, help="folder of the run")
    add("--episode", metavar="K", type=EPISODE, required=True, help="number of the episode, counted from 0")
    add(
        "--cell",
        metavar="[S/]D/C",
        help="[suite/]detector/controller; may be left out where the run has one cell",
    )
    add("--record", action="store_true", help="record it, for rerun, as GIF and for the report")
    add(
        "--weights",
        metavar="[D=]FILE",
        action="append",
        default=[],
        help="where the weights that the run was given are now, unless they are where they were",
    )
    add("--out", metavar="DIR", type=Path, help="folder of the recording (default: RUN/recordings)")
    return parser


def main(command: Sequence[str]) -> int:
    """Play the episode, print what differs and return the exit code.

    Raises:
        MpgraspError: input that cannot be used.
    """
    from mpgrasp.bench.commands.run import make_parser as run_parser
    from mpgrasp.bench.playing.crew import shared_networks
    from mpgrasp.bench.playing.planning import make_plan
    from mpgrasp.bench.playing.recorded_command import recorded_arguments

    arguments = make_parser().parse_args(command)
    given = [word for file in arguments.weights for word in ("--weights", file)]
    plan, _ = make_plan(recorded_arguments(arguments.run, run_parser(), given))
    with shared_networks(plan.runtime, "processes"):
        return _replay(plan, arguments)


def _replay(plan: Plan, arguments: Namespace) -> int:
    from mpgrasp.bench.playing.description import configuration
    from mpgrasp.bench.playing.player import Player, loss_note
    from mpgrasp.bench.results.provenance import provenance
    from mpgrasp.bench.results.reader import read_run

    run = read_run(arguments.run)
    plan, task = _one_episode(plan, arguments)
    before = _recorded_line(arguments.run, task)
    player = Player(plan)
    changed = _difference_of_configurations(run.configuration, configuration(plan, player), task)
    if changed:
        print(f"The configuration is another one: {changed}")
    for place in differences(run.made_with.as_row(), provenance().as_row()):
        print(f"Not made with the same: {place.words('then', 'now')}")
    line = player.play(task)
    if plan.record and not player.lost:
        print(f"Recorded: {plan.recordings}/{task.stem}.*")
    code = _report(task, before, line)
    if player.lost:
        raise OutputError(loss_note(task, player.lost))
    return code


def _one_episode(plan: Plan, arguments: Namespace) -> tuple[Plan, Task]:
    """The plan with one method left, and the task."""
    from mpgrasp.bench.results.cell_path import choose_cell

    cells = [Cell(suite.name, *method) for suite in plan.suites for method in plan.methods]
    if arguments.episode < 0:
        raise ConfigError("episode out of range", got=arguments.episode, allowed="0, 1, 2, ...")
    cell = choose_cell(cells, arguments.cell)
    task = Task(cell.suite, arguments.episode, cell.detector, cell.controller)
    recordings = arguments.out or arguments.run / "recordings"
    plan = replace(
        plan,
        methods=(cell.method,),
        weights={name: file for name, file in plan.weights.items() if name == cell.detector},
        record=task.episode + 1 if arguments.record else 0,
        recordings=recordings,
        traces=recordings if arguments.record else None,
    )
    return plan, task


def _recorded_line(folder: Path, task: Task) -> Line:
    from mpgrasp.bench.results.reader import read_lines

    lines = read_lines(folder).lines
    places = [place for place, there in enumerate(lines.tasks()) if there == task]
    if not places:
        raise ConfigError(f"the run has no {task}", got=str(folder), allowed="an episode that was played")
    return lines[places[-1]]


def _difference_of_configurations(then: Configuration, now: Configuration, task: Task) -> str | None:
    """Difference in what decides the one cell, in words; other cells of the run do not matter."""
    if not any(part.settings for part in then.parts):  # a run from before run.json had them
        bare = tuple(replace_fields(part, settings={}) for part in now.suites)
        now = replace_fields(now, settings={}, suites=bare)
    alike = replace_fields(
        then,
        cells=now.cells,
        detectors=tuple(card for card in then.detectors if card.name == task.detector),
        controllers=tuple(card for card in then.controllers if card.name == task.controller),
    )
    found = difference(alike.as_row(), now.as_row())
    return found and found.words("then", "now")


def _report(task: Task, before: Line, now: PlayedLine) -> int:
    if isinstance(before, ErrorLine):
        print(f"{task}: an error then ({before.error}), {now.outcome} now")
        return EXIT_DIFFERENT
    row_before, row_now = before.as_row(), now.as_row()
    keys = sorted((row_before.keys() | row_now.keys()) - {"timing"})
    different = [key for key in keys if row_before.get(key) != row_now.get(key)]
    if not different:
        print(f"{task}: {now.outcome}, bit for bit the same as in the run ({now.state_hash[:12]})")
        return 0
    print(f"{task}: {now.outcome}, not the same as in the run")
    for key in different:
        print(f"  {key}: {json.dumps(row_before.get(key))} then, {json.dumps(row_now.get(key))} now")
    return EXIT_DIFFERENT
