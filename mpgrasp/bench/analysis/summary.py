"""What a set of episodes adds up to: one row per cell, and a paired test for every two cells."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from itertools import combinations
from statistics import median
from typing import Any

from mpgrasp.bench.analysis.pairing import pair
from mpgrasp.bench.record import ERROR, Cells, by_cell
from mpgrasp.episode.result import MOTION
from mpgrasp.statistics import holm, mean_interval, median_interval, restricted, wilson_interval


def summarise(episodes: Iterable[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """One JSON-ready row per cell (suite, detector, controller), in order of first appearance.

    Keys: suite, detector, controller; n (error rows do not count), errors, successes, rate, wilson_low,
    wilson_high; median_time_s, median_time_low, median_time_high; mean_time_s, mean_time_low,
    mean_time_high and time_limit_s (of the restricted mean where an episode of the suite hit its limit,
    else None); reflex_stops, reflexes {limit: count}, failures {outcome: count}, objects
    {name: {n, successes}}, motion {key: median} and worst_singular_value; clearing: None or, over all
    episodes in which a table was to be cleared, attempts, failed_attempts {outcome: count}, and numbers of
    objects in_basket, knocked_off and left.
    """
    cells = by_cell(episodes)
    limits = time_limits(cells)
    return [_cell(*key, lines, limits[key[0]]) for key, lines in cells.items()]


def time_limits(cells: Cells) -> dict[str, float | None]:
    """Time at which an episode of each suite was broken off [s]; None where none hit its limit.

    Tables that were not cleared, for whatever reason, count as hits of the limit that their lines give.
    """
    limits: dict[str, float | None] = {suite: None for suite, _, _ in cells}
    for (suite, _, _), lines in cells.items():
        for line in lines:
            hit = line.get("time_limit_s") if not line["success"] else None
            if hit is None and line["outcome"] == "timeout":
                hit = line["sim_time_s"]
            before = limits[suite]
            if hit is not None:
                limits[suite] = hit if before is None else min(before, hit)
    return limits


def restricted_time(line: Mapping[str, Any], limit: float | None = None) -> float:
    """Simulated time of an episode cut off at its limit, or else at `limit` [s].

    Who has not got to the end took at least as long as is allowed.
    """
    time, allowed = float(line["sim_time_s"]), line.get("time_limit_s", limit)
    if allowed is None:
        return time
    return min(time, float(allowed)) if line["success"] else float(allowed)


def _cell(
    suite: str, detector: str, controller: str, lines: list[Mapping[str, Any]], limit: float | None
) -> dict[str, Any]:
    played = [line for line in lines if line["outcome"] != ERROR]
    n, successes = len(played), sum(bool(line["success"]) for line in played)
    low, high = wilson_interval(successes, n)
    times = [restricted_time(line) for line in played]
    middle, middle_low, middle_high = median_interval(times)
    mean, mean_low, mean_high = mean_interval(restricted(times, limit))
    objects: dict[str, dict[str, int]] = {}
    for line in played:
        counts = objects.setdefault(str(line["object"]), {"n": 0, "successes": 0})
        counts["n"] += 1
        counts["successes"] += bool(line["success"])
    values = {key: [line[key] for line in played if line.get(key) is not None] for key in MOTION}
    reflexes = [stop["limit"] for line in played for stop in stops_of(line)]
    return {
        "suite": suite,
        "detector": detector,
        "controller": controller,
        "n": n,
        "errors": len(lines) - n,
        "successes": successes,
        "rate": successes / n if n else None,
        "wilson_low": low,
        "wilson_high": high,
        "median_time_s": middle if times else None,
        "median_time_low": middle_low,
        "median_time_high": middle_high,
        "mean_time_s": mean,
        "mean_time_low": mean_low,
        "mean_time_high": mean_high,
        "time_limit_s": limit,
        "reflex_stops": len(reflexes),
        "reflexes": dict(sorted(Counter(reflexes).items())),
        "failures": dict(sorted(Counter(line["outcome"] for line in played if not line["success"]).items())),
        "objects": dict(sorted(objects.items())),
        "motion": {key: median(numbers) for key, numbers in values.items() if numbers},
        "worst_singular_value": min(values["min_singular_value"], default=None),
        "clearing": _clearing([line for line in played if "picks" in line]),
    }


def stops_of(line: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """All protective stops of an episode."""
    if "stops" in line:
        return list(line["stops"])
    return [] if line["reflex"] is None else [line["reflex"]]


def _clearing(lines: list[Mapping[str, Any]]) -> dict[str, Any] | None:
    """What became of attempts and objects where tables were to be cleared; None where none were."""
    if not lines:
        return None
    failures = Counter(
        pick["outcome"] for line in lines for pick in line["picks"] if pick["outcome"] != "success"
    )
    return {
        "attempts": sum(len(line["picks"]) for line in lines),
        "failed_attempts": dict(sorted(failures.items())),
        **{key: sum(len(line[key]) for line in lines) for key in ("in_basket", "knocked_off", "left")},
    }


def paired_tests(episodes: Iterable[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """One JSON-ready row per two cells of a suite over the worlds that both met.

    Keys: suite, a and b as [detector, controller], n, both, a_alone, b_alone, p (McNemar, exact,
    two-sided) and p_holm, corrected over all rows of the suite.
    """
    rows: list[dict[str, Any]] = []
    for (key_a, lines_a), (key_b, lines_b) in combinations(by_cell(episodes).items(), 2):
        if key_a[0] != key_b[0]:
            continue
        found = pair(lines_a, lines_b)
        rows.append(
            {"suite": key_a[0], "a": list(key_a[1:]), "b": list(key_b[1:]), "n": found.n}
            | {name: getattr(found, name) for name in ("both", "a_alone", "b_alone", "p")}
        )
    for suite in {row["suite"] for row in rows}:
        family = [row for row in rows if row["suite"] == suite]
        for row, p in zip(family, holm([row["p"] for row in family]), strict=True):
            row["p_holm"] = p
    return rows
