"""Pictures of a report: plots and filmstrips as far as there are data for them, else words that say so."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from typing import Any

from mpgrasp.bench.analysis.hypotheses import cell_of
from mpgrasp.bench.analysis.paper import reported
from mpgrasp.bench.record import ERROR
from mpgrasp.bench.report.document import Block, Paragraph, Picture
from mpgrasp.bench.report.names import name_of
from mpgrasp.bench.report.paper_tables import Rows, rate_text
from mpgrasp.bench.report.plots import (
    Bar,
    Way,
    data_uri,
    singular_picture,
    success_picture,
    time_picture,
    way_picture,
)
from mpgrasp.bench.results.runs import Cell, Runs
from mpgrasp.bench.results.trace import Trace
from mpgrasp.exceptions import MpgraspError
from mpgrasp.statistics import wilson_interval

Traced = Mapping[Cell, Sequence[tuple[Mapping[str, Any], Trace]]]
"""Lines that have a trace, with it, by cell and in the order of the episodes."""


def read_traces(runs: Runs) -> tuple[Traced, list[str]]:
    """Every trace that was kept, and what is wrong with those that cannot be read."""
    traced: dict[Cell, list[tuple[Mapping[str, Any], Trace]]] = {}
    troubles = []
    for cell, lines in runs.cells.items():
        traced[cell] = []
        for line in sorted(lines, key=lambda line: int(line["episode"])):
            if line.get("outcome") == ERROR:
                continue
            try:
                trace = runs.owners[cell].trace(line)
            except MpgraspError as error:
                troubles.append(str(error))
                continue
            if trace is not None:
                traced[cell].append((line, trace))
    return traced, troubles


def outcome_pictures(runs: Runs, rows: Rows) -> list[Block]:
    """Success rates and times, a picture of each per suite."""
    blocks: list[Block] = []
    for suite in runs.suites:
        cells = [cell for cell in runs.cells if cell[0] == suite and rows[cell]["n"]]
        if not cells:
            blocks.append(Paragraph(text=f"No episode of suite {suite} could be played."))
            continue
        paper = {cell_of(runs.cells, suite, *method): counts for method, counts in reported(suite).items()}
        bars = [
            Bar(
                label=name_of(*cell[1:]),
                rate=rows[cell]["rate"],
                low=rows[cell]["wilson_low"],
                high=rows[cell]["wilson_high"],
                reported=_rate(*paper[cell]) if cell in paper else None,
            )
            for cell in cells
        ]
        said = "; ".join(f"{name_of(*c[1:])} {rate_text(rows[c]['successes'], rows[c]['n'])}" for c in cells)
        alt = f"Success rates, suite {suite}: {said}."
        blocks.append(Picture(caption=f"{suite}: success", alt=alt, markup=success_picture(bars, alt)))
        times = {name_of(*cell[1:]): _times(runs.cells[cell]) for cell in cells}
        said = "; ".join(f"{name_of(*c[1:])} {rows[c]['median_time_s']:.1f} s" for c in cells)
        alt = f"Times, suite {suite}, medians: {said}."
        caption = f"{suite}: simulated times; boxes show quartiles, whiskers all episodes"
        blocks.append(Picture(caption=caption, alt=alt, markup=time_picture(times, alt)))
    return blocks


def motion_pictures(runs: Runs, traced: Traced) -> list[Block]:
    """Singular values over time and ways over the entropy map, as far as traces were kept."""
    blocks: list[Block] = []
    for suite in runs.suites:
        cells = [cell for cell in runs.cells if cell[0] == suite and traced[cell]]
        if not cells:
            blocks.append(_no_traces(f"singular values and ways of suite {suite}"))
            continue
        ways = [
            Way(
                label=name_of(*cell[1:]),
                traces=[(bool(line["success"]), trace) for line, trace in traced[cell]],
            )
            for cell in cells
        ]
        warning = (runs.owners[cells[0]].about.get("motion") or {}).get("singularity_warning")
        said = "; ".join(
            f"{way.label} down to {min(t.singular_values.min() for _, t in way.traces):.3f} "
            f"in {len(way.traces)} episodes"
            for way in ways
        )
        alt = f"Smallest singular value over time, suite {suite}: {said}."
        caption = f"{suite}: smallest singular value over time, of the episodes whose traces were kept"
        blocks.append(Picture(caption=caption, alt=alt, markup=singular_picture(ways, warning, alt)))
        blocks += [_ways(cell, runs, traced) for cell in cells]
    return blocks


def film_blocks(runs: Runs, traced: Traced) -> list[Block]:
    """A strip of stills of the first success and of the first failure of each cell."""
    blocks: list[Block] = []
    never, lost = [], []
    for cell, lines in runs.cells.items():
        name = f"{cell[0]}: {name_of(*cell[1:])}"
        for success, word in ((True, "success"), (False, "failure")):
            played = [ln for ln in lines if ln.get("outcome") != ERROR and bool(ln.get("success")) is success]
            found = [(ln, t) for ln, t in traced[cell] if bool(ln["success"]) is success and t.stills]
            if not played:
                never.append(f"{name}, {word}")
            elif not found:
                lost.append(f"{name}, {word}")
            else:
                blocks.append(_strip(name, word, *found[0]))
    if lost:
        blocks.append(_no_traces(f"stills of {'; '.join(lost)}"))
    if never:
        blocks.append(Paragraph(text=f"No episode to show: {'; '.join(never)}."))
    return blocks


def _ways(cell: Cell, runs: Runs, traced: Traced) -> Block:
    examples = []
    for success, word in ((True, "success"), (False, "failure")):
        found = [(line, trace) for line, trace in traced[cell] if bool(line["success"]) is success]
        if found:
            examples.append((f"{word}, episode {found[0][0]['episode']}", found[0][1]))
    said = "; ".join(
        f"{title}, from ({t.positions[0, 0]:.2f}, {t.positions[0, 1]:.2f}) m to "
        f"({t.positions[-1, 0]:.2f}, {t.positions[-1, 1]:.2f}) m"
        for title, t in examples
    )
    name, extent = name_of(*cell[1:]), runs.owners[cell].map_extent(cell[2])
    mapped = extent and any(trace.entropy is not None for _, trace in examples)
    under = "over the entropy map of the last look" if mapped else "without an entropy map"
    return Picture(
        caption=f"{cell[0]}: {name}, way of the tool point from above, {under}",
        alt=f"Way of the tool point from above, suite {cell[0]}, {name}: {said}.",
        markup=way_picture(examples, extent, f"Ways from above, suite {cell[0]}, {name}: {said}."),
    )


def _strip(name: str, word: str, line: Mapping[str, Any], trace: Trace) -> Picture:
    images = []
    for picture, time_s, phase in zip(trace.stills, trace.still_times, trace.still_phases, strict=True):
        alt = html.escape(f"{phase} at {time_s:.1f} s", quote=True)
        images.append(f'<img src="{data_uri(picture)}" alt="{alt}" title="{alt}" width="352" height="312">')
    when = ", ".join(f"{time_s:.1f}" for time_s in trace.still_times)
    what = f"{line['object']}, {line['outcome']}"
    return Picture(
        caption=f"{name}, {word}: episode {line['episode']} ({what}), at {when} s; corner: quality map",
        alt=f"{len(images)} stills of episode {line['episode']}, {what}.",
        markup=f'<div class="strip">{"".join(images)}</div>',
        wide=True,
    )


def _no_traces(what: str) -> Paragraph:
    return Paragraph(
        text=f"Not kept: {what}. Playing the run again with this version keeps them in `traces/`."
    )


def _rate(successes: int, n: int) -> tuple[float, float, float]:
    return successes / n, *wilson_interval(successes, n)


def _times(lines: Sequence[Mapping[str, Any]]) -> tuple[list[float], list[float]]:
    played = [line for line in lines if line.get("outcome") != ERROR]
    good = [line["sim_time_s"] for line in played if line["success"]]
    return good, [line["sim_time_s"] for line in played if not line["success"]]
