"""Rates, times and p values of a report in words, with their intervals."""

from __future__ import annotations

from collections.abc import Mapping

from mpgrasp.bench.analysis.summary import CellSummary
from mpgrasp.statistics import SIGNIFICANCE, wilson_interval


def rate_text(successes: int, n: int, errors: int = 0) -> str:
    """Successes of n with the rate and its 95 % Wilson interval."""
    if n == 0:
        text = "0/0"
    else:
        low, high = wilson_interval(successes, n)
        text = f"{successes}/{n} = {100 * successes / n:.1f} % [{100 * low:.1f}-{100 * high:.1f}]"
    return text + (f", {errors} errors" if errors else "")


def success_text(summary: CellSummary) -> str:
    """Successes of a cell as in `rate_text`."""
    return rate_text(summary.successes, summary.n, summary.errors)


def time_text(summary: CellSummary) -> str:
    """Mean time of a cell with its bootstrap interval [s]."""
    if summary.mean_time_s is None:
        return "-"
    low, high = summary.mean_time_low, summary.mean_time_high
    return f"{summary.mean_time_s:.1f} s" + ("" if low is None else f" [{low:.1f}-{high:.1f}]")


def stops_text(summary: CellSummary) -> str:
    """Number of protective stops, and in brackets that of those in a singular posture, where it is known."""
    known = summary.singularities is not None
    return f"{summary.reflex_stops}" + (f" ({summary.singularities})" if known else "")


def p_text(p: float) -> str:
    """A p value, with a star where it is significant."""
    return f"{p:.3g}" + (" *" if p < SIGNIFICANCE else "")


def counts_text(counts: Mapping[str, int]) -> str:
    """Counts by name; empty if there are none."""
    return ", ".join(f"{count} {name}" for name, count in counts.items())
