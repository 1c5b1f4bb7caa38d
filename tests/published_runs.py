"""Numbers of published runs of the benchmark, computed from their episodes.

Rates and p-values come from scipy, not from mpgrasp: an independent computation. Shares are (percent, lower,
upper bound of the 95 % Wilson interval).
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache
from pathlib import Path
from statistics import mean, median
from typing import Any

from scipy.stats import binomtest, wilcoxon

RESULTS = Path(__file__).resolve().parent.parent / "benchmarks" / "results"
NAMES = {"DHRNet": "dhrnet", "TF-Grasp": "tfgrasp", "GG-CNN": "ggcnn", "GG-CNN2": "ggcnn2"}
REAL_CELL = "real-cell/"
RUNGS: dict[str, tuple[str, str | None]] = {
    **{f"{mm} mm": (f"oracle/stick-{mm}mm", None) for mm in ("1", "1.5", "2", "3")},
    **{f"cloth {mm} mm": ("oracle/cloth", f"thin[cloth_unevenness=0.00{mm}]") for mm in (2, 3, 4)},
    "single": ("oracle/single", None),
}
"""Runs of the oracle by the rung's name in docs/results.md, and the suite in them where there are several."""
SINGLE, SINGLE_QUOTED = "single-unseen-thin", "single-quoted"
"""Runs of `single`: of the paper's own methods, and of those that its Table III quotes."""
TIME_LIMIT = 900.0
"""Simulated time that a table which was not cleared counts as [s]."""

Share = tuple[float, float, float]
Line = dict[str, Any]
Cell = dict[int, Line]
Method = tuple[str, str]


@cache
def episodes(run: str) -> list[Line]:
    text = (RESULTS / run / "episodes.jsonl").read_text(encoding="utf-8")
    return [json.loads(line) for line in text.splitlines()]


@cache
def cells(run: str) -> dict[tuple[str, str, str], Cell]:
    """Return the lines of a run by suite, detector and controller, then by episode."""
    found: dict[tuple[str, str, str], Cell] = {}
    for line in episodes(run):
        key = line["suite"], line["detector"], line["controller"]
        found.setdefault(key, {})[line["episode"]] = line
    return found


def cell(run: str, detector: str, controller: str, suite: str | None = None) -> Cell:
    (found,) = (
        lines for (name, *method), lines in cells(run).items()
        if method == [detector, controller] and suite in (None, name)
    )  # fmt: skip
    return found


def entry(entries: Iterable[Mapping[str, Any]], **wanted: Any) -> Mapping[str, Any]:
    """Return the one entry whose items are as wanted."""
    (found,) = (item for item in entries if all(item[key] == value for key, value in wanted.items()))
    return found


def share(count: int, n: int) -> Share:
    bounds = binomtest(count, n).proportion_ci(method="wilson")
    return 100 * count / n, 100 * bounds.low, 100 * bounds.high


def holm(values: Iterable[float]) -> list[float]:
    """Return the values corrected after Holm, in ascending order."""
    ordered = sorted(values)
    corrected = [(len(ordered) - k) * p for k, p in enumerate(ordered)]
    return [min(1.0, max(corrected[: k + 1])) for k in range(len(ordered))]


# runs of the benchmark


def success(run: str, detector: str, controller: str, suite: str | None = None) -> Share:
    lines = cell(run, detector, controller, suite).values()
    return share(sum(line["success"] for line in lines), len(lines))


def robust_range(run: str) -> tuple[float, float]:
    """Return the lowest and the highest rate of the networks of a run with a robust controller [%]."""
    rates = [
        100 * mean(line["success"] for line in lines.values())
        for (_, detector, controller), lines in cells(run).items()
        if controller.endswith("_robust") and detector != "heuristic"
    ]
    return min(rates), max(rates)


def episodes_of(run: str) -> int:
    """Return the number of episodes of each cell of a run."""
    (n,) = {len(lines) for lines in cells(run).values()}
    return n


def objects_of(run: str) -> int:
    return len({line["object"] for line in episodes(run)})


def mean_time(run: str, detector: str, controller: str, suite: str | None = None) -> Share:
    """Return the mean simulated time with its bootstrap interval [s], of summary.json."""
    summary = json.loads((RESULTS / run / "summary.json").read_text(encoding="utf-8"))
    wanted = {"detector": detector, "controller": controller} | ({"suite": suite} if suite else {})
    found = entry(summary["cells"], **wanted)
    return found["mean_time_s"], found["mean_time_low"], found["mean_time_high"]


def played(detector: str, controller: str, column: str) -> Share | None:
    """Return what a column of the tables of suites says of a method; None where it was not played."""
    heading = re.fullmatch(r"([\w-]+)(?:(?: cleared)? %, n = (\d+)|, time \[s\])", column)
    assert heading, f"unknown column {column}"
    suite, n = heading.groups()
    for path in sorted(RESULTS.glob("*/episodes.jsonl")):
        if (suite, detector, controller) in cells(path.parent.name):
            if n is None:
                return mean_time(path.parent.name, detector, controller, suite)
            assert len(cell(path.parent.name, detector, controller, suite)) == int(n)
            return success(path.parent.name, detector, controller, suite)
    return None


def failed(run: str, detector: str, controller: str, suite: str | None = None) -> list[Line]:
    return [line for line in cell(run, detector, controller, suite).values() if not line["success"]]


def failures(run: str, detector: str, controller: str, **wanted: str) -> int:
    """Return the number of failures of a cell, by `suite`, `outcome` or `object` where given."""
    lines = failed(run, detector, controller, wanted.get("suite"))
    return sum(all(line[key] == value for key, value in wanted.items()) for line in lines)


def claimed_when_lifted(run: str, detector: str, controller: str) -> float:
    """Return the median quality of the grasps of a cell that lifted."""
    lifted = [line for line in cell(run, detector, controller).values() if line["success"]]
    return median(float(line["grasp"]["quality"]) for line in lifted)


def all_failures(run: str, **wanted: str) -> int:
    return sum(failures(run, detector, controller, **wanted) for _, detector, controller in cells(run))


def share_of_inference(run: str, detector: str, controller: str, suite: str | None = None) -> float:
    """Return the share of a control tick that the detector takes [%], of the mean times over all episodes."""
    times = [line["timing"] for line in cell(run, detector, controller, suite).values()]
    ticks = [sum(t for stage, t in of.items() if stage != "episode") for of in times]
    return 100 * float(sum(t["detect"] for t in times) / sum(ticks))


def alone(run: str, method: Method, other: Method, suite: str | None = None) -> int:
    """Return the number of episodes in which one method succeeded and the other did not."""
    ours, theirs = cell(run, *method, suite), cell(run, *other, suite)
    assert ours.keys() == theirs.keys()
    return sum(line["success"] and not theirs[k]["success"] for k, line in ours.items())


def p_of_success(run: str, method: Method, other: Method, suite: str | None = None) -> float:
    """Return p of McNemar's exact test."""
    ours, theirs = alone(run, method, other, suite), alone(run, other, method, suite)
    return float(binomtest(ours, ours + theirs, 0.5).pvalue)


def table_iii(method: str, column: str) -> Any:
    """Return a cell of the table of Table III's methods, with MP-PC, in the worlds that all of them met."""
    name = {**NAMES, "Lenz et al.": "lenz", "Pinto et al.": "pinto"}[method]
    run = SINGLE_QUOTED if name in ("lenz", "pinto") else SINGLE
    if column == "here %":
        return success(run, name, "mppc", "single")
    assert column == "p against DHRNet"
    return p_against_dhrnet(run, name)


def p_against_dhrnet(run: str, detector: str) -> float:
    """Return p of McNemar's exact test between a detector and DHRNet in `single`, both with MP-PC."""
    ours, theirs = cell(run, detector, "mppc", "single"), cell(SINGLE, "dhrnet", "mppc", "single")
    assert {k: line["scene_seed"] for k, line in ours.items()} == {
        k: line["scene_seed"] for k, line in theirs.items()
    }
    better = sum(line["success"] > theirs[k]["success"] for k, line in ours.items())
    worse = sum(line["success"] < theirs[k]["success"] for k, line in ours.items())
    return float(binomtest(better, better + worse, 0.5).pvalue) if better + worse else 1.0


def stopped(run: str, detector: str, controller: str) -> int:
    """Return the number of episodes that ended in a protective stop."""
    return sum(line["reflex"] is not None for line in cell(run, detector, controller).values())


def singular(run: str, detector: str, controller: str) -> int:
    """Return the number of episodes whose smallest singular value fell below 0.05."""
    return sum(line["min_singular_value"] < 0.05 for line in cell(run, detector, controller).values())


def least_singular_value(run: str, detector: str, controller: str) -> float:
    return float(min(line["min_singular_value"] for line in cell(run, detector, controller).values()))


def blind_drift(run: str, detector: str, controller: str) -> float:
    """Return the mean drift to the side before the first detection [mm]."""
    return float(1e3 * mean(line["blind_drift_m"] for line in cell(run, detector, controller).values()))


def sticks_of_2mm(detector: str, controller: str, column: str) -> Any:
    """Return a cell of the table of the sticks of 2 mm, by the names that stand in it."""
    name = NAMES[detector]
    measures: dict[str, Callable[[str, str, str], Any]] = {
        "lifted %": success,
        "protective stops": stopped,
        "below 0.05": singular,
        "least singular value": least_singular_value,
        "blind drift, mm": blind_drift,
    }
    return measures[column](f"sticks-of-2mm/{name}", name, controller.strip("`"))


def searched(controller: str, column: str) -> Any:
    """Return a cell of the table of the searches: "stick, lifted %", "pile, protective stops" and so on."""
    what, measure = column.split(", ", 1)
    measures: dict[str, Callable[[str, str, str], Any]] = {
        "lifted %": success,
        "protective stops": stopped,
        "time, s": lambda *method: mean_time(*method)[0],
    }
    return measures[measure](f"searches/find-{what}", "oracle", controller.strip("`"))


def oracle_lifts(rung: str, column: str) -> Any:
    """Return a cell of the table of the oracle's rungs, by the folder that stands in it."""
    folder, suite = RUNGS[rung.split("`")[1]]
    (controller,) = {name for _, detector, name in cells(folder) if detector == "oracle"}
    if column == "lifted %":
        return success(folder, "oracle", controller, suite)
    lines = cell(folder, "oracle", controller, suite).values()
    assert column == "seen late"
    return sum(line["first_detection_s"] != 0 for line in lines)


def stacks(detector: str, controller: str, column: str) -> Any:
    """Return a cell of the table of stacks that were played with today's controllers."""
    name, how = NAMES[detector], controller.strip("`")
    run = f"stacks/{NAMES[detector]}"
    measures: dict[str, Callable[[], Any]] = {
        "cleared": lambda: (sum(line["success"] for line in cell(run, name, how).values()), episodes_of(run)),
        "time, s": lambda: mean_time(run, name, how),
        "failed picks": lambda: failed_picks(run, name, how),
        "stops": lambda: sum(len(line["stops"]) for line in cell(run, name, how).values()),
    }
    return measures[column]()


def real_cell(error: str, column: str) -> Any:
    """Return a cell of the table of a real cell's errors: the rate of DHRNet with MP-PC in a suite."""
    return success(REAL_CELL + error.split("`")[1], "dhrnet", "mppc", column.removesuffix(" %"))


def p_against_none(error: str, suite: str) -> float:
    """Return p of McNemar's exact test between the episodes with an error and those without any."""
    with_error, without = (
        {k: line["success"] for k, line in cell(REAL_CELL + name, "dhrnet", "mppc", suite).items()}
        for name in (error, "none")
    )
    ours = sum(with_error[k] and not without[k] for k in without)
    theirs = sum(without[k] and not with_error[k] for k in without)
    return float(binomtest(ours, ours + theirs, 0.5).pvalue) if ours + theirs else 1.0


def real_cell_ends(error: str, outcome: str) -> tuple[int, int]:
    """Return how many episodes with an error ended so, and how many there are, both suites together."""
    lines = [
        line for suite in ("unseen", "thin")
        for line in cell(REAL_CELL + error, "dhrnet", "mppc", suite).values()
    ]  # fmt: skip
    return sum(line["outcome"] == outcome for line in lines), len(lines)


def arithmetic() -> tuple[int, int]:
    """Return how many episodes before and after a change of arithmetic have one outcome, and one state."""
    before, after = (cell(f"arithmetic/{name}", "dhrnet", "mppc_robust") for name in ("before", "after"))
    assert before.keys() == after.keys()
    same, equal = (sum(before[k][key] == after[k][key] for k in before) for key in ("outcome", "state_hash"))
    return same, equal


# clearing tables


def _restricted(lines: Cell) -> dict[int, float]:
    return {
        k: min(line["sim_time_s"], TIME_LIMIT) if line["success"] else TIME_LIMIT for k, line in lines.items()
    }


def _more(run: str, method: Method, other: Method) -> list[float]:
    ours, theirs = _restricted(cell(run, *method)), _restricted(cell(run, *other))
    assert ours.keys() == theirs.keys()
    return [ours[k] - theirs[k] for k in ours]


def seconds_more(run: str, method: Method, other: Method) -> float:
    """Return how much longer one method takes than another, mean over common tables [s]."""
    return mean(_more(run, method, other))


def p_of_times(run: str, method: Method, other: Method) -> float:
    return float(wilcoxon(_more(run, method, other)).pvalue)


def failed_picks(run: str, detector: str, controller: str) -> int:
    return sum(sum(line["failures"].values()) for line in cell(run, detector, controller).values())


def attempts(run: str, detector: str, controller: str, suite: str | None = None) -> list[dict[str, Any]]:
    """Return all episodes of one grasp, or all picks of all tables."""
    lines = cell(run, detector, controller, suite).values()
    return [attempt for line in lines for attempt in line.get("picks", [line])]


def grasps_where_next_to_nothing_was_seen(
    run: str, detector: str, controller: str, suite: str | None = None
) -> tuple[int, int]:
    """Return the grasps at a cell with one count in the lowest of 10 bins beside the prior, and all grasps.

    The prior is one count in each of 18 x 10 bins, whose mean is 0.5.
    """
    once = (18 * 10 * 0.5 + 0.05) / (18 * 10 + 1)
    claimed = [
        attempt["grasp"]["quality"]
        for attempt in attempts(run, detector, controller, suite)
        if attempt["grasp"]
    ]
    return sum(abs(quality - once) < 1e-6 for quality in claimed), len(claimed)


def paper_trials(detector: str, controller: str, column: str) -> Any:
    """Return a cell of the table of the paper's trials with one grasp."""
    name, how, run = NAMES[detector], controller.strip("`"), "single-unseen-thin"
    if column.endswith("%"):
        return success(run, name, how, column.removesuffix(" %"))
    if column == "stops":
        return sum(line["reflex"] is not None for line in attempts(run, name, how, "single"))
    assert column == "grasps of an empty cell"
    return grasps_where_next_to_nothing_was_seen(run, name, how, "single")


def most_stops(run: str, detector: str, controller: str) -> tuple[int, int]:
    """Return the stops of the episode with the most of them, and those of all episodes."""
    stops = [len(line["stops"]) for line in cell(run, detector, controller).values()]
    return max(stops), sum(stops)


def picks_that_ended(run: str, detector: str, controller: str, outcome: str, objects: Sequence[str]) -> int:
    """Return the number of picks of these objects with an outcome."""
    return sum(
        pick["outcome"] == outcome and pick["object"] in objects
        for pick in attempts(run, detector, controller)
    )


@cache
def orderings() -> dict[tuple[str, str], dict[str, str]]:
    """Return the rows of the table of hypotheses in the report on the paper's suites, by suite and claim."""
    text = (
        (RESULTS / "paper" / "report.md")
        .read_text(encoding="utf-8")
        .replace("&lt;", "<")
        .replace("&gt;", ">")
    )
    lines = iter(text.split("**The paper's orderings as hypotheses**")[1].strip().splitlines())
    heads, _, *rows = [
        [word.strip() for word in line.strip("|").split("|")] for line in iter(lambda: next(lines), "")
    ]
    found = [dict(zip(heads, row, strict=True)) for row in rows]
    return {(row["suite"], row["claim"]): row for row in found}


def ordering(suite: str, claim: str, baseline: str = "published") -> float:
    """Return p of a claim, corrected after Holm over all of them that were tested with a baseline."""
    return float(orderings()[suite, claim][f"Holm p, {baseline}"])


def verdicts(verdict: str, baseline: str, suite: str | None = None) -> int:
    """Return the number of claims with a verdict, of one suite or of all."""
    return sum(
        row[f"verdict, {baseline}"] == verdict
        for (name, _), row in orderings().items()
        if suite in (None, name)
    )


def verdicts_in(verdict: str, column: str) -> int:
    """Return a cell of the table of verdicts."""
    return verdicts(verdict, column.partition(":")[0])
