"""Episodes of a run, played again and written as demonstrations."""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from mpgrasp.bench.playing.crew import shared_networks
from mpgrasp.bench.playing.plan import Plan
from mpgrasp.bench.playing.player import Player
from mpgrasp.bench.record import Cell, ErrorLine, PlayedLine
from mpgrasp.bench.results.cell_path import choose_cell
from mpgrasp.bench.results.reader import read_lines
from mpgrasp.exceptions import ConfigError, OutputError
from mpgrasp.recording.demonstration import DemonstrationRecorder
from mpgrasp.recording.demonstration_files import DemonstrationWriter, Hdf5Writer, NumpyWriter

EXIT_SOME_LEFT_OUT = 1


def export(plan: Plan, arguments: Namespace) -> int:
    """Play the episodes that are wanted again, write those that come out the same, and return the exit code.

    Args:
        plan: of the run, as its command says.
        arguments: of `bench export`.

    Raises:
        ConfigError: a cell that the run has not, tables that are cleared, no such episode, or a format
            whose package is not installed.
        OutputError: no run there, or a folder that cannot be written to.
    """
    cell = _cell(plan, arguments.cell)
    wanted = [line for line in _lines(arguments.run, cell) if line.success or not arguments.successes]
    wanted = wanted[: arguments.episodes]
    if not wanted:
        raise ConfigError(
            "no episode to export", got=str(arguments.run), allowed="one that was played, and is wanted"
        )
    _check_empty(arguments.out)
    plan = replace(
        plan,
        methods=(cell.method,),
        weights={name: file for name, file in plan.weights.items() if name == cell.detector},
        record=0,
        traces=None,
    )
    suite = plan.suite(cell.suite)
    about = {
        "run": arguments.run.name,
        "suite": cell.suite,
        "detector": cell.detector,
        "controller": cell.controller,
        "seed": plan.seed,
        "fps": round(1 / suite.episode_config().control_dt),
        "task": f"{suite.title}: lift it",
    }
    writer = _writer(arguments.format, arguments.out, about)
    with shared_networks(plan.runtime, "processes"):
        left_out = _write(Player(plan), wanted, writer)
    writer.close()
    print(f"{len(wanted) - left_out} demonstrations: {arguments.out}")
    return EXIT_SOME_LEFT_OUT if left_out else 0


def _write(player: Player, wanted: list[PlayedLine], writer: DemonstrationWriter) -> int:
    """Play and write them; the number of those that did not come out the same."""
    from rich.console import Console
    from rich.progress import track

    console, left_out = Console(stderr=True), 0
    for line in track(wanted, "episodes", console=console, disable=not console.is_terminal):
        recorder = DemonstrationRecorder()
        again = player.play(line.task, recorder)
        if _facts(again) != _facts(line):
            left_out += 1
            print(
                f"{line.task} does not come out as in the run, and is left out: {again.outcome}",
                file=sys.stderr,
            )
            continue
        writer.add(recorder.demonstration(success=line.success, about=_facts(line)))
    return left_out


def _facts(line: PlayedLine) -> dict[str, Any]:
    """All of a line but the time that it took."""
    return {key: value for key, value in line.as_row().items() if key != "timing"}


def _cell(plan: Plan, name: str | None) -> Cell:
    cells = [Cell(suite.name, *method) for suite in plan.suites for method in plan.methods]
    cell = choose_cell(cells, name)
    if plan.suite(cell.suite).trial != "grasp":
        raise ConfigError(
            "demonstrations are of one grasp", got=cell.suite, allowed="a suite with one grasp an episode"
        )
    return cell


def _lines(folder: Path, cell: Cell) -> Iterator[PlayedLine]:
    """Lines of a cell that were played, in the order of their episodes."""
    lines = read_lines(folder).lines
    found = {
        line.episode: line for line in lines if not isinstance(line, ErrorLine) and line.task.cell == cell
    }
    return (found[episode] for episode in sorted(found))


def _writer(kind: str, folder: Path, about: dict[str, Any]) -> DemonstrationWriter:
    if kind == "npz":
        return NumpyWriter(folder, about)
    if kind == "hdf5":
        return Hdf5Writer(folder, about)
    from mpgrasp.recording.lerobot_files import LeRobotWriter

    return LeRobotWriter(folder, about)


def _check_empty(folder: Path) -> None:
    """Raise OutputError where something lies already."""
    try:
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise OutputError(
                "there is something already", got=str(folder), allowed="a new folder, or an empty one"
            )
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"demonstrations cannot be written: {error.strerror}", got=str(folder)) from error
