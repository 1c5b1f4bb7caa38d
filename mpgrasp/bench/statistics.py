"""What a set of episodes adds up to: rates with Wilson intervals, medians, failures by cause."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from statistics import median
from typing import Any

from mpgrasp.exceptions import ConfigError

CONFIDENCE = 0.95


def wilson_interval(successes: int, n: int, confidence: float = CONFIDENCE) -> tuple[float, float]:
    """Wilson's score interval (low, high) of a success rate; (0, 1) where nothing was tried.

    Raises:
        ConfigError: more successes than trials, or negative counts.
    """
    from scipy.stats import binomtest

    if not 0 <= successes <= n:
        raise ConfigError("impossible counts", got=(successes, n), allowed="0 <= successes <= n")
    if n == 0:
        return 0.0, 1.0
    interval = binomtest(successes, n).proportion_ci(confidence_level=confidence, method="wilson")
    return float(interval.low), float(interval.high)


def summarise(episodes: Iterable[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """One JSON-ready row per cell (suite, detector, controller), in order of first appearance.

    Keys: suite, detector, controller, n, successes, rate, wilson_low, wilson_high, median_time_s,
    reflex_stops, failures {outcome: count}, objects {name: {n, successes}}.
    """
    cells: dict[tuple[str, str, str], list[Mapping[str, Any]]] = {}
    for line in episodes:
        cells.setdefault((line["suite"], line["detector"], line["controller"]), []).append(line)
    return [_cell(*key, lines) for key, lines in cells.items()]


def _cell(suite: str, detector: str, controller: str, lines: list[Mapping[str, Any]]) -> dict[str, Any]:
    n, successes = len(lines), sum(bool(line["success"]) for line in lines)
    low, high = wilson_interval(successes, n)
    objects: dict[str, dict[str, int]] = {}
    for line in lines:
        counts = objects.setdefault(str(line["object"]), {"n": 0, "successes": 0})
        counts["n"] += 1
        counts["successes"] += bool(line["success"])
    return {
        "suite": suite,
        "detector": detector,
        "controller": controller,
        "n": n,
        "successes": successes,
        "rate": successes / n,
        "wilson_low": low,
        "wilson_high": high,
        "median_time_s": median(line["sim_time_s"] for line in lines),
        "reflex_stops": sum(line["reflex"] is not None for line in lines),
        "failures": dict(sorted(Counter(line["outcome"] for line in lines if not line["success"]).items())),
        "objects": dict(sorted(objects.items())),
    }
