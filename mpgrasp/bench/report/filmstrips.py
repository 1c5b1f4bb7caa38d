"""Filmstrips of the first success and of the first failure of each cell, from the stills that were kept."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass

from mpgrasp.bench.record import PlayedLine, played
from mpgrasp.bench.report.document import Filmstrip, Still, Table
from mpgrasp.bench.report.kept_traces import KeptTraces
from mpgrasp.bench.report.names import name_of
from mpgrasp.bench.report.shell_commands import replay_command
from mpgrasp.bench.results.runs import Runs
from mpgrasp.bench.results.trace import Trace


@dataclass(frozen=True, kw_only=True)
class Films:
    """Filmstrips of a report."""

    strips: Sequence[Filmstrip]
    missing: Table | None
    """Filmstrips whose stills were not kept, with the commands that make them."""
    without_episode: Sequence[str]
    """Cells, with an ending that no episode of theirs had."""


NO_FILMS = Films(strips=(), missing=None, without_episode=())
"""Filmstrips of a report that shows none."""


def filmstrips(runs: Runs, kept: KeptTraces) -> Films:
    """Filmstrips as far as stills were kept."""
    strips, missing, without = [], [], []
    for cell, lines in runs.cells.items():
        name = name_of(cell.method)
        for word, success in (("success", True), ("failure", False)):
            ended = (line for line in played(lines) if line.success is success)
            first = min(ended, key=lambda line: line.episode, default=None)
            shown = [
                (ln, trace) for ln, trace in kept.by_cell[cell] if ln.success is success and trace.stills
            ]
            if first is None:
                without.append(f"{cell.suite}: {name}, {word}")
            elif not shown:
                command = replay_command(runs.owners[cell].folder, first.task)
                missing.append((cell.suite, name, word, str(first.episode), f"`{command}`"))
            else:
                strips.append(_strip(f"{cell.suite}: {name}, {word}", *shown[0]))
    return Films(strips=strips, missing=_missing_table(missing) if missing else None, without_episode=without)


def _strip(name: str, line: PlayedLine, trace: Trace) -> Filmstrip:
    stills = [
        Still(
            source=f"data:image/webp;base64,{base64.b64encode(image).decode()}",
            alt=f"{phase} at {time_s:.1f} s",
        )
        for image, time_s, phase in zip(trace.stills, trace.still_times, trace.still_phases, strict=True)
    ]
    when = ", ".join(f"{time_s:.1f}" for time_s in trace.still_times)
    what = f"{line.object}, {line.outcome}"
    return Filmstrip(
        caption=f"{name}: episode {line.episode} ({what}), at {when} s; corner: quality map",
        alt=f"{len(stills)} stills of episode {line.episode}, {what}.",
        stills=stills,
    )


def _missing_table(rows: Sequence[Sequence[str]]) -> Table:
    return Table(
        caption=f"Filmstrips that are not kept: {len(rows)}",
        headings=("suite", "cell", "ending", "episode", "what makes it"),
        rows=rows,
    )
