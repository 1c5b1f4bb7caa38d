"""Does what is measured on single images foretell what happens in closed loop?

    python benchmarks/across.py

Detectors, and networks after either stage of training, are ranked by three rates of their best grasps in
single held-out views (`held_out.py`): right by the rectangle metric, a hit of the labels, lifted in the true
scene. They are ranked again by the level at which half of their grasps fail in closed loop, on ladders
(`bench ladder`), all with one controller. Kendall's tau says how far the two orders agree: 1 for the same,
0 for no relation. Its interval comes from drawing detectors anew, its p from all orders (scipy.stats). Beside
it: of the pairs of detectors that a ladder tells apart, how many the rate puts the same way round.
"""

from __future__ import annotations

import json
import sys
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import study

from mpgrasp.bench.analysis.ladder import Climb, LadderCard, climbs
from mpgrasp.bench.results.reader import read_run
from mpgrasp.bench.results.writer import RunDirectory
from mpgrasp.bench.stored_lines import by_cell
from mpgrasp.command_line import SEED
from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import FloatArray
from mpgrasp.statistics import SIGNIFICANCE, holm
from mpgrasp.threshold_difference import differences

if TYPE_CHECKING:
    from matplotlib.figure import Figure

METRICS = ("rectangle", "hit", "lifted")
CONTROLLER = "mppc_robust"
RATE, PLACE = 0.5, 1
"""Success rate whose level is compared, and where it stands among the levels of a climb."""
RESAMPLES = 2000
FEWEST = 4
"""Detectors that an order takes."""
OFFLINE = ("held-out", "held-out-stage1")
LADDERS = ("thickness", "cloth", "noise")

Rates = dict[str, dict[str, dict[str, float]]]


def offline_rates(folders: Sequence[Path]) -> tuple[Rates, int]:
    """Return the rates of `METRICS` by detector over all views with a labelled grasp, and their number.

    Raises:
        ConfigError: a folder without them, or folders of other views.
    """
    rates: Rates = {}
    views, data = set(), []
    for folder in folders:
        try:
            found = json.loads((folder / "held-out.json").read_text("utf-8"))
            data.append(json.loads((folder / "run.json").read_text("utf-8"))["data"])
            for row in found["accuracy"]:
                if row["group"] == "all":
                    views.add(row["n"])
                    rates[row["detector"]] = {metric: row[metric] for metric in METRICS}
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise ConfigError(f"no rates of single views: {error!r}", got=str(folder)) from error
    if len(views) != 1 or data != data[:1] * len(data):
        raise ConfigError("folders of other views", got=sorted(views), allowed="the same ones in all")
    return rates, views.pop()


def ladder(folders: Sequence[Path]) -> tuple[LadderCard, list[Climb]]:
    """Return a ladder, and who has climbed it with `CONTROLLER` in one of the runs.

    Raises:
        ConfigError: runs of other ladders, or of none.
    """
    card: LadderCard | None = None
    found: dict[str, Climb] = {}
    for folder in folders:
        there = read_run(folder).configuration.ladder
        if there is None or (card is not None and (there.rungs, there.name) != (card.rungs, card.name)):
            raise ConfigError(
                "not a run of this ladder", got=str(folder), allowed=None if card is None else card.name
            )
        card = there
        for one in climbs(card, by_cell(RunDirectory(folder).episodes())):
            if one.method.controller == CONTROLLER:
                found.setdefault(one.method.detector, one)
    assert card is not None
    return card, list(found.values())


def agreement(card: LadderCard, found: Sequence[Climb], rates: Rates, seed: int) -> list[dict[str, Any]]:
    """Return a row for each of `METRICS`: how far it and the levels of a ladder agree.

    Raises:
        ConfigError: too few detectors have both.
    """
    both = [one for one in found if one.method.detector in rates]
    if len(both) < FEWEST:
        raise ConfigError("too few detectors with both", got=len(both), allowed=f"{FEWEST} or more")
    ease = np.array([_reached(card, one) for one in both])
    apart = _told_apart(card, both)
    rows = []
    for metric in METRICS:
        values = np.array([rates[one.method.detector][metric]["rate"] for one in both])
        tau, low, high, p = kendall(values, ease, np.random.default_rng(seed))
        alike = sum(bool((values[i] - values[k]) * (ease[k] - ease[i]) > 0) for i, k in apart)
        rows.append({
            "ladder": card.name, "metric": metric, "detectors": len(both), "tau": tau, "low": low,
            "high": high, "p": p, "told_apart": len(apart), "alike": alike,
        })  # fmt: skip
    return rows


def kendall(
    values: FloatArray, ease: FloatArray, rng: np.random.Generator
) -> tuple[float, float, float, float]:
    """Return how far a rising rate goes with a harder level: Kendall's tau, its 95 % interval, and p.

    Args:
        values: rate of each detector (n,).
        ease: level that each still stands (n,), the harder the smaller.
        rng: of the detectors that are drawn anew.
    """
    from scipy.stats import kendalltau

    def tau(who: Any) -> float:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of a draw in which all are the same
            return float(kendalltau(values[who], -ease[who]).statistic)

    whole = kendalltau(values, -ease)
    drawn = np.array([tau(rng.integers(len(values), size=len(values))) for _ in range(RESAMPLES)])
    low, high = np.nanpercentile(drawn, (2.5, 97.5))
    return float(whole.statistic), float(low), float(high), float(whole.pvalue)


def _reached(card: LadderCard, one: Climb) -> float:
    """Return the ease of the level that a method reaches, at most that of the last rung."""
    rungs = card.scale.rungs
    return float(np.clip(card.scale.ease([one.thresholds[PLACE].level])[0], rungs[0], rungs[-1]))


def _told_apart(card: LadderCard, found: Sequence[Climb]) -> list[tuple[int, int]]:
    """Return the pairs of methods whose levels differ significantly, corrected after Holm."""
    tests = differences(card.scale, [one.results for one in found], RATE)
    corrected = holm([test.p for test in tests.values()])
    return [pair for pair, p in zip(tests, corrected, strict=True) if p < SIGNIFICANCE]


def points(card: LadderCard, found: Sequence[Climb], rates: Rates) -> list[dict[str, Any]]:
    """Return a row for each detector: its level, with its interval, and its rates."""
    rows = []
    for one in found:
        if one.method.detector in rates:
            level = one.thresholds[PLACE]
            own = {metric: rates[one.method.detector][metric]["rate"] for metric in METRICS}
            rows.append({
                "ladder": card.name, "detector": one.method.detector, "level": level.level, "low": level.low,
                "high": level.high, "episodes": one.episodes, **own,
            })  # fmt: skip
    return rows


def draw(results: Mapping[str, Any]) -> Figure:
    """Levels in closed loop, with intervals, over the rate of single views: a panel for each ladder."""
    names = list(dict.fromkeys(row["ladder"] for row in results["points"]))
    figure, panels = study.figure(len(names))
    for axes, name in zip(panels, names, strict=True):
        rows = [row for row in results["points"] if row["ladder"] == name]
        for k, row in enumerate(sorted(rows, key=lambda row: float(row["rectangle"]))):
            network, _, weights = row["detector"].partition("@")
            level = [[row["level"] - row["low"]], [row["high"] - row["level"]]]
            place = 100 * row["rectangle"], row["level"]
            axes.errorbar(*place, yerr=level, capsize=3, **study.style(int(bool(weights))))
            axes.annotate(
                weights or network, place, (5, 5 - 12 * (k % 2)), textcoords="offset points", fontsize=8
            )
        tau = {row["metric"]: row["tau"] for row in results["agreement"] if row["ladder"] == name}
        title = f"{name}: tau {tau['rectangle']:.2f}; lifted {tau['lifted']:.2f}"
        axes.set(xlabel="right by the rectangle metric, single views [%]", title=title)
        axes.set_ylabel(f"level at 50 % in closed loop [{results['units'][name]}]")
        rungs = results["rungs"][name]
        if results["logarithmic"][name]:
            axes.set_yscale("log")
            axes.minorticks_off()
        axes.set_yticks(rungs, [f"{rung:g}" for rung in rungs])
        shown = [r for r in rungs if any(row["low"] / 1.5 <= r <= 1.5 * row["high"] for row in rows)]
        axes.set_ylim(*(shown[:: -1 if results["harder"][name] == "lower" else 1][k] for k in (0, -1)))
        axes.margins(x=0.2)
    return figure


def table(results: Mapping[str, Any]) -> str:
    """A line for each ladder and rate."""
    lines = [f"{'ladder':<12}{'rate':<12}{'tau':<26}{'p':<9}pairs told apart, the same way round"]
    for row in results["agreement"]:
        tau = f"{row['tau']:+.2f} ({row['low']:+.2f} to {row['high']:+.2f})"
        pairs = f"{row['alike']} of {row['told_apart']}"
        lines.append(f"{row['ladder']:<12}{row['metric']:<12}{tau:<26}{row['p']:<9.3f}{pairs}")
    return "\n".join(lines)


def _runs(name: str) -> list[Path]:
    """Return the published runs of a ladder."""
    folders = [study.RESULTS / "ladders" / name, study.RESULTS / "ladders" / f"networks-{name}"]
    return [folder for folder in folders if (folder / "run.json").is_file()] or folders[:1]


def _study(command: Sequence[str]) -> None:
    parser = study.Parser(description=__doc__)
    add = parser.add_argument
    add("--offline", metavar="DIR[,DIR]", help="results of held_out.py (default: the published ones)")
    add(
        "--ladder",
        metavar="DIR[,DIR]",
        action="append",
        help="runs of one ladder, given once for each (default: the published ones of "
        + ", ".join(LADDERS)
        + ")",
    )
    add("--seed", metavar="S", type=SEED, default=0, help="of the bootstrap (default: 0)")
    add("--out", metavar="DIR", type=Path, default=study.RESULTS / "across")
    options = parser.parse_args(command)
    study.prepare(options.out)
    offline = (
        [Path(text) for text in options.offline.split(",")]
        if options.offline
        else [study.RESULTS / name for name in OFFLINE]
    )
    ladders = (
        [[Path(text) for text in texts.split(",")] for texts in options.ladder]
        if options.ladder
        else [_runs(name) for name in LADDERS]
    )
    rates, views = offline_rates(offline)
    results: dict[str, Any] = {
        "views": views, "agreement": [], "points": [], "units": {}, "rungs": {}, "logarithmic": {},
        "harder": {},
    }  # fmt: skip
    for folders in study.track(ladders, "ladders", len(ladders)):
        card, found = ladder(folders)
        results["agreement"] += agreement(card, found, rates, options.seed)
        results["points"] += points(card, found, rates)
        results["units"][card.name], results["rungs"][card.name] = card.unit, card.rungs
        results["logarithmic"][card.name], results["harder"][card.name] = card.logarithmic, card.harder
    about = study.about("across", command, seed=options.seed, controller=CONTROLLER, resamples=RESAMPLES)
    study.publish(options.out, "across", about, results, results["points"], draw(results))
    print(f"{views} views.\n{table(results)}\nResults: {options.out}")


def main(command: Sequence[str] | None = None) -> int:
    """Run the command line (`sys.argv` if not given) and return the exit code; 2 for unusable input."""
    return study.run_command(_study, command)


if __name__ == "__main__":
    sys.exit(main())
