"""Ladders: at which level each method falls through a success rate, and which of two methods falls later."""

from __future__ import annotations

from dataclasses import dataclass, replace

from mpgrasp.bench.record import Cell, Cells, Method, Record, played
from mpgrasp.statistics import holm
from mpgrasp.threshold_difference import Difference, differences
from mpgrasp.thresholds import Fit, Results, Scale, Threshold

RATES = (0.9, 0.5)
"""Success rates whose levels are told, the one that is met first on the way up before the other."""


class LadderCard(Record, frozen=True, kw_only=True):
    """A ladder that was played, and how rungs were chosen."""

    name: str
    title: str
    scalar: str
    """What is varied, in words."""
    unit: str
    rungs: tuple[float, ...]
    """In rising order."""
    harder: str
    """"higher" or "lower"."""
    logarithmic: bool
    points: tuple[str, ...]
    """Suite of each rung."""
    episodes: int
    """Of each method, on all rungs together."""
    first: int
    """Episodes at each rung of the beginning."""
    starts: int
    """Rungs of the beginning."""
    batch: int
    """Episodes that are added at a time."""

    @property
    def scale(self) -> Scale:
        """The rungs, and which are hard."""
        return Scale(levels=self.rungs, logarithmic=self.logarithmic, harder=self.harder)

    def rung(self, suite: str) -> float:
        """Return the rung that a suite stands for."""
        return self.rungs[self.points.index(suite)]


@dataclass(frozen=True, kw_only=True)
class Climb:
    """How far a method got."""

    method: Method
    results: Results
    """Success by rung and episode."""
    fit: Fit
    thresholds: tuple[Threshold, ...]
    """Of `RATES`."""

    @property
    def episodes(self) -> int:
        """Number of episodes that were played."""
        return sum(map(len, self.results.values()))


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """Two methods at one success rate."""

    first: Method
    second: Method
    rate: float
    found: Difference
    p_holm: float
    """After Holm's correction over all comparisons of the ladder at that rate."""


def climbs(card: LadderCard, cells: Cells) -> list[Climb]:
    """Return how far each method got on a ladder, in the order of first appearance."""
    found: dict[Method, dict[float, dict[int, bool]]] = {}
    for cell, lines in cells.items():
        if cell.suite in card.points:
            rungs = found.setdefault(cell.method, {})
            rungs[card.rung(cell.suite)] = {line.episode: line.success for line in played(lines)}
    return [climb(card.scale, method, results) for method, results in found.items()]


def climb(scale: Scale, method: Method, results: Results) -> Climb:
    """Return how far a method got with these results."""
    tally = {rung: (sum(of.values()), len(of)) for rung, of in sorted(results.items()) if of}
    fit = Fit(scale, tally)
    return Climb(
        method=method, results=results, fit=fit, thresholds=tuple(fit.threshold(rate) for rate in RATES)
    )


def comparisons(scale: Scale, methods: list[Climb]) -> list[Comparison]:
    """Return every pair of methods at each of `RATES`."""
    rows = []
    for rate in RATES:
        found = differences(scale, [climb.results for climb in methods], rate)
        of_rate = [
            Comparison(
                first=methods[a].method, second=methods[b].method, rate=rate, found=between, p_holm=1.0
            )
            for (a, b), between in found.items()
        ]
        corrected = holm([row.found.p for row in of_rate])
        rows += [replace(row, p_holm=p) for row, p in zip(of_rate, corrected, strict=True)]
    return rows


def beyond(scale: Scale, level: float) -> str:
    """Return "" for a level on the ladder, "harder" or "easier" for one beyond an end of it."""
    ease, rungs = float(scale.ease([level])[0]), scale.rungs
    return "harder" if ease < rungs[0] else "easier" if ease > rungs[-1] else ""


def cell_at(card: LadderCard, rung: float, method: Method) -> Cell:
    """Return the cell of a method at a rung."""
    return Cell(card.points[card.rungs.index(rung)], *method)
