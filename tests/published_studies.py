"""Numbers of published studies, computed from their tables and JSON; shares as in tests/published_runs.py."""

from __future__ import annotations

import csv
import json
import re
from functools import cache
from statistics import median
from typing import Any

import numpy as np
from published_runs import NAMES, RESULTS, Share, entry, share

from mpgrasp.bench.analysis.ladder import Climb, LadderCard, climb, climbs, comparisons
from mpgrasp.bench.results.reader import read_run
from mpgrasp.bench.results.writer import RunDirectory
from mpgrasp.bench.stored_lines import by_cell


@cache
def study(folder: str) -> Any:
    path = RESULTS / folder
    return json.loads((path / f"{path.name}.json").read_text(encoding="utf-8"))


@cache
def table_of(folder: str) -> list[dict[str, str]]:
    with (RESULTS / folder / f"{folder}.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def held_out(scenes: str, column: str) -> Share:
    """Return a rate of the best grasps of one view, from the table of all views."""
    heading, n = re.fullmatch(r"(all|thin|stacked), n = (\d+)", scenes), re.search(r"\d+$", scenes)
    assert heading
    assert n
    name, metric = column.split()
    key = {"lifts": "lifted", "hits": "hit"}[metric]
    rows = [
        row
        for row in table_of("held-out")
        if row["detector"] == NAMES[name]
        and row["graspable"] == "True"
        and row.get(heading[1], "True") == "True"
    ]
    assert len(rows) == int(n[0])
    return share(sum(row[key] == "True" for row in rows), len(rows))


def p_held_out(metric: str, group: str, other: str) -> float:
    """Return the corrected p of DHRNet against another network."""
    return float(
        entry(study("held-out")["mcnemar"], metric=metric, group=group, a="dhrnet", b=other)["p_holm"]
    )


@cache
def single_views(folder: str) -> Any:
    """Return a study of held-out views, which may lie in a folder of another name."""
    return json.loads((RESULTS / folder / "held-out.json").read_text(encoding="utf-8"))


def views_of(folder: str, detector: str, what: str, group: str = "all") -> float:
    """Return a rate of these views [%], or their number "n"."""
    row = entry(single_views(folder)["accuracy"], detector=detector, group=group)
    return float(row["n"] if what == "n" else 100 * row[what]["rate"])


def lifts_alone(folder: str, other: str) -> tuple[float, ...]:
    """Return the views that another network alone lifts, those of DHRNet, p, and p corrected after Holm."""
    tests = single_views(folder)["mcnemar"]
    row = entry(tests, metric="lifted", group="all", a="dhrnet", b=other)
    return tuple(float(row[key]) for key in ("only_b", "only_a", "p", "p_holm"))


def bin_of(detector: str, low: float) -> tuple[float, float, float, float, float]:
    """Return bounds of a bin of claimed quality, and the share that lifts."""
    found = entry(study("held-out")["calibration"][detector]["bins"], low=low)
    return (found["low"], found["high"], *share(found["count"], found["n"]))


def threshold(detector: str) -> Share:
    found = study("held-out")["thresholds"][detector]
    return found["threshold"], found["low"], found["high"]


def _views(**wanted: float | str) -> list[dict[str, str]]:
    return [
        row
        for row in table_of("thickness")
        if all(
            (row[key] if isinstance(value, str) else float(row[key])) == value
            for key, value in wanted.items()
        )
    ]


def detected(stick: str, column: str) -> Share:
    """Return the share of frames with a peak and the right grasp, by thickness and detector at a height."""
    name, height, _ = column.split()
    (row,) = _views(detector=NAMES[name], thickness_mm=float(stick.split()[0]), tcp_height_m=float(height))
    return share(int(row["detected_count"]), int(row["detected_n"]))


def false_peaks() -> tuple[float, ...]:
    """Return the peaks on bare cloth of the worst network, its views, and bounds of the share [%]."""
    worst = max(
        (
            (sum(int(row["false_peak_count"]) for row in rows), sum(int(row["false_peak_n"]) for row in rows))
            for rows in (_views(detector=name, thickness_mm=0.0) for name in NAMES.values())
        ),
        key=lambda counts: counts[0],
    )
    return (*worst, *share(*worst)[1:])


def fewest_right(thickness: float, height: float) -> tuple[int, int]:
    """Return the smallest count of right best pixels over the networks, from a height down, and the views."""
    heights = [h for h in (0.175, 0.25, 0.35, 0.5) if h <= height]
    rows = [row for h in heights for row in _views(thickness_mm=thickness, tcp_height_m=h)]
    return min((int(row["right_count"]), int(row["right_n"])) for row in rows)


@cache
def splits(folder: str) -> Any:
    """Return the study of generated splits, which may lie in a folder of another name."""
    return json.loads((RESULTS / folder / "generated-splits.json").read_text(encoding="utf-8"))


_OF_SPLITS = {"depth": "d", "colour": "rgb", "both": "rgbd", "image-wise": "iw", "object-wise": "ow"}


def of_split(network: str, column: str, folder: str = "generated-splits") -> Share:
    """Return the share of right best grasps by input and split, such as "depth, image-wise %"."""
    channels, split = (_OF_SPLITS[word] for word in column.removesuffix(" %").split(", "))
    name = {**NAMES, "GR-ConvNet": "grconvnet", "Lenz et al.": "lenz"}[network]
    best = entry(splits(folder)["rows"], network=name, channels=channels, split=split)["best"]
    return share(best["count"], best["n"])


def of_long_split(network: str, column: str) -> Share:
    """Return what `of_split` does, after three times the training."""
    return of_split(network, column, "generated-splits-long")


def p_of_split(channels: str, split: str, b: str, folder: str = "generated-splits") -> float:
    """Return the corrected p of DHRNet against another network, or of its inputs ("all", split, "d rgb")."""
    a, b = b.split() if channels == "all" else ("dhrnet", b)
    return float(entry(splits(folder)["mcnemar"], channels=channels, split=split, a=a, b=b)["p_holm"])


def greatest_p_of_splits(*networks: str) -> float:
    """Return the greatest corrected p of DHRNet against these networks over all inputs and splits."""
    tests = [row for row in splits("generated-splits")["mcnemar"] if row["b"] in networks]
    assert len(tests) == 6 * len(networks)
    return max(float(row["p_holm"]) for row in tests)


def ablation(kind: str, label: str, metric: str, seed: int = 0) -> Share:
    """Return a rate after the last epoch of a training."""
    last = entry(study(f"ablation-{kind}")["runs"], label=label, seed=seed)["curve"][-1]
    assert last["epoch"] == 10
    return share(last[metric]["count"], last[metric]["n"])


def by_seed(network: str, column: str) -> Share:
    """Return a cell of the table of architectures, such as "rectangle, seed 0"."""
    metric, seed = column.split(", seed ")
    return ablation("architecture", network.strip("`"), metric, int(seed.removesuffix(" %")))


def ablation_images(kind: str) -> int:
    (n,) = {run["curve"][-1]["rectangle"]["n"] for run in study(f"ablation-{kind}")["runs"]}
    return int(n)


def ablation_range(kind: str, prefix: str, metric: str) -> tuple[float, float]:
    labels = [run["label"] for run in study(f"ablation-{kind}")["runs"] if run["label"].startswith(prefix)]
    rates = [ablation(kind, label, metric)[0] for label in labels]
    return min(rates), max(rates)


def p_ablation(kind: str, a: str, b: str, metric: str, seed: int = 0) -> float:
    tests = study(f"ablation-{kind}")["mcnemar"]
    return float(entry(tests, metric=metric, a=a, b=b, seed=seed)["p_holm"])


def parameters(kind: str) -> tuple[float, float]:
    """Return the smallest and the greatest number of parameters of a study's networks, in millions."""
    counts = [run["parameters"] / 1e6 for run in study(f"ablation-{kind}")["runs"]]
    return min(counts), max(counts)


def run_time(network: str, runtime: str) -> float:
    """Return the median time of `predict()` [ms]."""
    return float(entry(study("run-time")["rows"], network=network, runtime=runtime)["predict_ms"]["median"])


def speed_up(network: str, runtime: str) -> float:
    return float(entry(study("run-time")["rows"], network=network, runtime=runtime)["speed_up"]["network"])


def parameters_of(network: str) -> float:
    rows = [row["parameters"] for row in study("run-time")["rows"] if row["network"] == network]
    return float(rows[0]) / 1e6


FACTOR_MEASURES = {
    "success, points": "success",
    "stops, points": "stop",
    "drift, mm": "blind_drift_m",
    "singular value, 1e-3": "min_singular_value",
}


def factor_effect(factor: str, column: str, thickness: float = 0.0) -> tuple[float, float, float]:
    """Return an effect of the study of factors with its interval, of all sticks or of one thickness."""
    rows = study("stage2/controller-factors")["effects"]
    wanted = {"name": factor.split("`")[1], "measure": FACTOR_MEASURES[column], "thickness_mm": thickness}
    found = entry(rows, **wanted)
    return found["effect"], found["low"], found["high"]


def p_of_factor(name: str, measure: str) -> float:
    """Return the corrected p of a factor's effect over all sticks."""
    rows = study("stage2/controller-factors")["effects"]
    return float(entry(rows, name=name, measure=measure, thickness_mm=0.0)["p_holm"])


def factor_worlds() -> int:
    return len({(row["thickness_mm"], row["world"]) for row in _factor_episodes()})


def factor_rate(thickness: float, **levels: int) -> tuple[int, int]:
    """Return the successes and the episodes of the runs with some factors at a level, -1 or 1."""
    rows = [
        row
        for row in _factor_episodes()
        if float(row["thickness_mm"]) == thickness
        and all(int(float(row[name])) == level for name, level in levels.items())
    ]
    return sum(int(row["success"]) for row in rows), len(rows)


@cache
def _factor_episodes() -> list[dict[str, str]]:
    with (RESULTS / "stage2/controller-factors" / "episodes.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


# what goes wrong, and what the tests notice
KINDS = {
    "meshes": "mesh",
    "weight files": "weights",
    "command lines": "command",
    "plug-ins, refused when loaded": "plug-in, found out by loader",
    "plug-ins, in a run": "plug-in, found out by guard",
    "plug-ins, by the kit": "plug-in, found out by kit",
    "processes killed by SIGKILL": "SIGKILL",
    "disks too small": "full disk",
    "pairs of equal runs": "equal runs",
}
"""Kinds of trials of the study of reliability, by their names in docs/results.md."""


def trials(kind: str, column: str) -> float:
    """Return a cell of the table of what goes wrong."""
    rows = [row for row in table_of("reliability") if row["kind"] == KINDS[kind]]
    return {
        "trials": float(len(rows)),
        "as it must be": float(sum(not row["fault"] for row in rows)),
        "slowest, s": max(float(row["seconds"]) for row in rows),
    }[column]


def minutes_of_trials() -> float:
    """Return the sum of the times of all trials [min]; bad input is played two at a time."""
    rows = table_of("reliability")
    halves = {"equal runs": 1.0, "SIGKILL": 1.0, "full disk": 1.0}
    return sum(float(row["seconds"]) * halves.get(row["kind"], 0.5) for row in rows) / 60


def mutants(module: str, column: str) -> Any:
    """Return a cell of the table of mutants."""
    name = module.strip("`")
    rows = [row for row in table_of("mutation") if name in ("all", row["module"])]
    killed = sum(row["killed"] == "True" for row in rows)
    return share(killed, len(rows)) if column == "killed %" else len(rows)


def survivors(reason: str = "") -> int:
    """Return the number of mutants that survived, for a reason that contains these words."""
    return sum(row["killed"] == "False" and reason in row["reason"] for row in table_of("mutation"))


def bits(setting: str, column: str) -> Any:
    """Return a cell of the table of settings that may change bits."""
    row = entry(study("same-bits")["rows"], setting=setting.split("`")[1])
    if column == "n":
        return row["n"]
    key = {"equal %": "equal", "other outcome %": "other_outcome", "other success %": "other_success"}[column]
    return share(row[key]["count"], row["n"])


def ceiling(name: str) -> tuple[int, list[float]]:
    """Return the number of worlds that were searched, and the least and greatest share that lifts [%]."""
    worlds = study(name)["worlds"]
    shares = [100 * world["lifted"] / world["tried"] for world in worlds]
    return len(shares), [min(shares), max(shares)]


def of_many(command: str, episodes: int = 1_000_000) -> tuple[float, float]:
    """Return the time [s] and the greatest memory [MB] of a command on so many episodes."""
    row = entry(study("many-episodes")["rows"], command=command, episodes=episodes)
    return row["seconds"], row["memory_mb"]


def cost(name: str, column: str) -> float:
    """Return a column of what something costs, beside the commit before."""
    return float(entry(study("before")["rows"], cost=name)[column])


def workers(engine: str, number: int) -> dict[str, float]:
    """Return the row of an engine with a number of workers."""
    return dict(entry(study("scaling")["rows"], engine=engine, workers=number))


def step_of(environment: str) -> float:
    """Return the CPU time of a usual step [ms]."""
    return float(entry(study("environments")["rows"], environment=environment)["median_ms"])


@cache
def _ladder(name: str) -> tuple[LadderCard, list[Climb]]:
    """Return a ladder and who climbed it; "again-NAME" and "both-NAME" are seed 1, and both seeds as one."""
    if name.startswith("both-"):
        (rungs, first), (_, second) = (_ladder(name.replace("both-", other)) for other in ("", "again-"))
        pairs = ((one, two) for one in first for two in second if one.method == two.method)
        return rungs, [_both(rungs, one, two) for one, two in pairs]
    folder = RESULTS / "ladders" / name
    card = read_run(folder).configuration.ladder
    assert card is not None
    return card, climbs(card, by_cell(RunDirectory(folder).episodes()))


def _both(card: LadderCard, first: Climb, second: Climb) -> Climb:
    """Return two climbs of a method in other worlds as one."""
    other = {rung: {-1 - k: won for k, won in of.items()} for rung, of in second.results.items()}
    rungs = {*first.results, *other}
    results = {rung: {**first.results.get(rung, {}), **other.get(rung, {})} for rung in rungs}
    return climb(card.scale, first.method, results)


def level(detector: str, column: str) -> list[float]:
    """Return the level of a column such as "cloth, mm, 90 %" and its interval; the last rung beyond it.

    The method is that of the detector, or of the controller, of that name.
    """
    name, _, rate = (word.strip() for word in column.split(","))
    card, found = _ladder(name)
    (found_climb,) = (c for c in found if detector in c.method)
    threshold = found_climb.thresholds[0 if rate == "90 %" else 1]
    ease, rungs = float(card.scale.ease([threshold.level])[0]), card.scale.rungs
    if not rungs[0] <= ease <= rungs[-1]:
        return [card.scale.by_ease[0 if ease < rungs[0] else -1]]
    return list(threshold)


def controller_level(controller: str, column: str) -> list[float]:
    """Return what `level` does, of a controller that DHRNet has played a ladder with."""
    return level(controller.strip("`"), f"controllers-{column}")


@cache
def _comparisons(name: str) -> dict[tuple[str, str, float], Any]:
    card, found = _ladder(name)
    by = "detector" if len({c.method.detector for c in found}) > 1 else "controller"
    rows = comparisons(card.scale, found)
    return {(getattr(c.first, by), getattr(c.second, by), c.rate): c for c in rows}


def p_of_levels(ladder: str, first: str, second: str, rate: float = 0.5) -> float:
    """Return the corrected p of two detectors on a ladder."""
    found = _comparisons(ladder)
    return float((found.get((first, second, rate)) or found[second, first, rate]).p_holm)


def p_between(first: str, second: str, rate: float = 0.5) -> float:
    """Return p of two detectors from runs of one ladder of their own, each as "RUN detector"."""
    (card, one), (_, other) = (
        (card, next(c for c in found if c.method.detector == who))
        for run, who in (first.split(), second.split())
        for card, found in (_ladder(run),)
    )
    (row,) = (row for row in comparisons(card.scale, [one, other]) if row.rate == rate)
    return float(row.found.p)


def difference(ladder: str, first: str, second: str, rate: float = 0.5) -> tuple[float, float, float]:
    """Return the level of one method over that of another, or less it on a plain scale, with its interval."""
    found = _comparisons(ladder).get((first, second, rate))
    if found is not None:
        return found.found.ratio, found.found.low, found.found.high
    found = _comparisons(ladder)[second, first, rate].found
    if _ladder(ladder)[0].scale.logarithmic:
        return 1 / found.ratio, 1 / found.high, 1 / found.low
    return -found.ratio, -found.high, -found.low


def rungs_lost(first: str, second: str, method: str, rate: float = 0.5) -> float:
    """Return by how many rungs a method's level on one ladder is easier than on one with the same rungs."""
    (card, found), (other, others) = _ladder(first), _ladder(second)
    assert np.array_equal(card.scale.rungs, other.scale.rungs)
    place = 0 if rate == 0.9 else 1
    levels = [next(c for c in them if method in c.method).thresholds[place].level for them in (found, others)]
    here, there = card.scale.ease(levels)
    return float((here - there) / np.diff(card.scale.rungs).mean())


def significant(ladder: str, *detectors: str) -> int:
    """Return how many differences of two detectors, at 90 and at 50 %, are significant."""
    return sum(
        row.p_holm < 0.05
        for (first, second, _), row in _comparisons(ladder).items()
        if not detectors or {first, second} <= set(detectors)
    )


def ended(ladder: str, outcome: str) -> int:
    """Return how many episodes of a ladder ended so; an error if any failed in another way."""
    lines = (RESULTS / "ladders" / ladder / "episodes.jsonl").read_text(encoding="utf-8").splitlines()
    ends = [row["outcome"] for row in map(json.loads, lines)]
    assert {*ends} == {"success", outcome}
    return ends.count(outcome)


def again_inside(*ladders: str) -> tuple[int, int]:
    """Return how many levels in other worlds lie in the interval of the first ones, and how many there are.

    Levels that lie beyond the last rung in either are left out.
    """
    inside = count = 0
    for name in ladders:
        units = {"thickness": "mm", "cloth": "mm", "calibration": "mm", "search": "m", "noise": "px",
                 "transfer": "mm", "size": "mm"}  # fmt: skip
        for detector in ("heuristic", "dhrnet", "oracle"):
            for rate in (90, 50):
                column = f"{name}, {units[name]}, {rate} %"
                first, again = level(detector, column), level(detector, f"again-{column}")
                if len(first) == len(again) == 3:
                    count += 1
                    inside += first[1] <= again[0] <= first[2]
    return inside, count


def opening(ladder: str, detector: str) -> float:
    """Return the median opening of a detector's grasps on a ladder [mm]."""
    lines = (RESULTS / "ladders" / ladder / "episodes.jsonl").read_text(encoding="utf-8").splitlines()
    rows = [row for row in map(json.loads, lines) if row["detector"] == detector and row["grasp"]]
    return float(1000 * median(row["grasp"]["width"] for row in rows))


def foretold(ladder: str, column: str) -> Any:
    """Return a cell of the table of single views against ladders: "hit, tau", "hit, the same way" or so."""
    metric, what = (word.strip() for word in column.split(","))
    row = entry(study("across")["agreement"], ladder=ladder.strip("`"), metric=metric)
    if what == "tau":
        return row["tau"], row["low"], row["high"]
    return (row["alike"], row["told_apart"]) if what == "the same way" else row["p"]


def level_of(ladder: str, detector: str) -> float:
    """Return the level at 50 % of a detector, or of other weights of a network, on a ladder."""
    return float(entry(study("across")["points"], ladder=ladder, detector=detector)["level"])


def rate_of_views(detector: str) -> float:
    """Return the share of single views in which a detector is right by the rectangle metric [%]."""
    return 100 * float(entry(study("across")["points"], ladder="thickness", detector=detector)["rectangle"])


def coverage(rate: float) -> tuple[float, float, float]:
    """Return the share of intervals that hold the truth, with its own interval [%]."""
    held = entry(study("ladder-coverage")["rows"], rate=rate)["coverage"]
    return share(held["count"], held["n"])


def ladder_error(rate: float) -> float:
    """Return the error of a level of simulated methods [rungs]."""
    return float(entry(study("ladder-coverage")["rows"], rate=rate)["error_rungs"])
