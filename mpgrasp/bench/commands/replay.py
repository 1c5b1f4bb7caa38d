"""`python -m mpgrasp.bench replay RUN --episode K`: does an episode, played again, come out the same?"""

from __future__ import annotations

import json
from argparse import RawDescriptionHelpFormatter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from mpgrasp.bench.playing.description import configuration
from mpgrasp.bench.playing.plan import Plan
from mpgrasp.bench.playing.player import Player
from mpgrasp.bench.playing.recorded_command import recorded_arguments
from mpgrasp.bench.playing.run import make_plan
from mpgrasp.bench.record import ERROR, Cell, Line, Task
from mpgrasp.bench.results.cell_path import find_cell
from mpgrasp.bench.results.provenance import provenance
from mpgrasp.bench.results.reader import read_lines, read_run
from mpgrasp.command_line import Parser
from mpgrasp.exceptions import ConfigError
from mpgrasp.files.json_values import difference, plain

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
        formatter_class=RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("run", metavar="RUN", type=Path, help="folder of the run")
    add("--episode", metavar="K", type=int, required=True, help="number of the episode, counted from 0")
    add(
        "--cell",
        metavar="[S/]D/C",
        help="[suite/]detector/controller; may be left out where the run has one cell",
    )
    add("--record", action="store_true", help="record it, for rerun and as GIF")
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

    arguments = make_parser().parse_args(command)
    run = read_run(arguments.run)
    given = [word for file in arguments.weights for word in ("--weights", file)]
    plan, _ = make_plan(recorded_arguments(arguments.run, run_parser(), given))
    plan, task = _one_episode(plan, arguments)
    before = _recorded_line(arguments.run, plan, task)
    player = Player(plan)
    changed = _difference_of_configurations(run["configuration"], plain(configuration(plan, player)), task)
    if changed:
        print(f"The configuration is another one: {changed}")
    made_with = difference(run.get("made_with"), plain(provenance()))
    if made_with:
        print(f"Not made with the same: {made_with.words('then', 'now')}")
    line = plain(player.play(task))
    if plan.record:
        print(f"Recorded: {plan.recordings}/{task.stem}.*")
    return _report(task, before, line)


def _one_episode(plan: Plan, arguments: Any) -> tuple[Plan, Task]:
    """The plan with one cell left, and the task."""
    cells = [(suite.name, *cell) for suite in plan.suites for cell in plan.cells]
    if arguments.cell is None and len(cells) > 1:
        names = [f"{s}/{d}/{c}" if len(plan.suites) > 1 else f"{d}/{c}" for s, d, c in cells]
        raise ConfigError("the run has several cells", allowed=[f"--cell {name}" for name in names])
    if arguments.episode < 0:
        raise ConfigError("episode out of range", got=arguments.episode, allowed="0, 1, 2, ...")
    cell = find_cell(cells, arguments.cell or "/".join(cells[0]))
    task = Task(
        suite=cell.suite, episode=arguments.episode, detector=cell.detector, controller=cell.controller
    )
    plan = replace(
        plan,
        cells=(Cell(cell.detector, cell.controller),),
        weights={name: file for name, file in plan.weights.items() if name == cell.detector},
        record=task.episode + 1 if arguments.record else 0,
        recordings=arguments.out or arguments.run / "recordings",
        traces=None,
    )
    return plan, task


def _recorded_line(folder: Path, plan: Plan, task: Task) -> Line:
    lines = [line for line in read_lines(folder).lines if Task.of(line) == task]
    if not lines:
        raise ConfigError(f"the run has no {task}", got=str(folder), allowed="an episode that was played")
    return lines[-1]


def _difference_of_configurations(then: dict[str, Any], now: dict[str, Any], task: Task) -> str | None:
    """What has changed of the one cell, in words; other cells of the run do not matter."""
    names = {"detectors": task.detector, "controllers": task.controller}
    kept = {key: [item for item in then[key] if item["name"] == name] for key, name in names.items()}
    found = difference({**then, **kept, "cells": now["cells"]}, now)
    return found and found.words("then", "now")


def _report(task: Task, before: Line, now: Line) -> int:
    if before["outcome"] == ERROR:
        print(f"{task}: an error then ({before['error']}), {now['outcome']} now")
        return EXIT_DIFFERENT
    keys = sorted((before.keys() | now.keys()) - {"timing"})
    different = [key for key in keys if before.get(key) != now.get(key)]
    if not different:
        print(f"{task}: {now['outcome']}, bit for bit the same as in the run ({now['state_hash'][:12]})")
        return 0
    print(f"{task}: {now['outcome']}, not the same as in the run")
    for key in different:
        print(f"  {key}: {json.dumps(before.get(key))} then, {json.dumps(now.get(key))} now")
    return EXIT_DIFFERENT
