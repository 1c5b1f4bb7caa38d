"""Calibration of the quality that a detector claims, and the threshold of MP-PC's exist_peak().

Both work on trials, one per detector and view (`single_view.Trial`).

A view's peak is right when its grasp lifts, and false where it does not, be the table empty or the grasp
wrong. Of the thresholds 0, 0.01 ... 1 the one with the greatest difference between the share of right peaks
that pass and the share of false ones (Youden's J) is chosen, the lowest of several; its interval comes from
drawing scenes anew (bootstrap). The careful threshold is the lowest at which false peaks are, by their 95 %
upper bound, at most a tenth of all that pass.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import study

from mpgrasp.controllers.config import ReachConfig
from mpgrasp.geometry import FloatArray
from mpgrasp.training.claims import BINS, expected_error

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from single_view import Trial

THRESHOLDS = np.linspace(0, 1, 101)
FALSE_SHARE = 0.1
"""Largest share of false peaks among those that pass the careful threshold."""
RESAMPLED = 1000
"""Bootstrap samples."""


def calibration(trials: Iterable[Trial]) -> dict[str, Any]:
    """Compare one detector's quality with its success, over the views in which it found a grasp.

    Keys: n; ece, the expected calibration error (mean distance between claimed quality and measured success
    over the bins, weighted by their views); brier, the mean squared error of the quality, and brier_constant,
    that of always claiming the mean success; mean_quality, success; bins with low, high, claimed and a rate.
    """
    found = [trial for trial in trials if trial.outcome != "no_grasp"]
    quality = np.array([trial.quality for trial in found])
    lifted = np.array([trial.lifted for trial in found], float)
    if not len(found):
        return {"n": 0, "bins": []}
    which = np.minimum((quality * BINS).astype(int), BINS - 1)
    bins = []
    for b in np.unique(which):
        inside = which == b
        rate = study.rate(int(lifted[inside].sum()), int(inside.sum()))
        claimed = float(quality[inside].mean())
        bins.append({"low": b / BINS, "high": (b + 1) / BINS, "claimed": claimed, **rate})
    return {
        "n": len(found),
        "ece": expected_error(quality, lifted > 0),
        "brier": float(np.mean((quality - lifted) ** 2)),
        "brier_constant": float(lifted.mean() * (1 - lifted.mean())),
        "mean_quality": float(quality.mean()),
        "success": float(lifted.mean()),
        "bins": bins,
    }


def choose_threshold(trials: Sequence[Trial], rng: np.random.Generator) -> dict[str, Any]:
    """exist_peak()'s threshold for the trials of one detector or several, by the rule of this file's head.

    Keys: threshold, low and high (95 % by bootstrap over scenes); youden; at it found (right peaks that pass,
    of views with a labelled grasp), false_peaks (those that pass, of views without a right one) and
    wrong_of_passing; at_default, the same at MP-PC's default; careful, the same at the careful threshold,
    None where there is none; curve, the same at all thresholds.
    """
    scenes, of_scene = np.unique([trial.scene for trial in trials], return_inverse=True)
    passes = np.array([trial.peak_height for trial in trials])[:, None] > THRESHOLDS  # (n, thresholds)
    right = np.array([trial.lifted for trial in trials])

    def per_scene(values: np.ndarray) -> np.ndarray:
        total = np.zeros((len(scenes), *values.shape[1:]))
        np.add.at(total, of_scene, values)
        return total

    counts = per_scene(passes & right[:, None]), per_scene(passes & ~right[:, None])
    sizes = per_scene(right), per_scene(~right)
    youden = _youden(*(c.sum(axis=0) for c in counts), *(s.sum(axis=0) for s in sizes))
    best = int(np.argmax(youden))
    drawn = rng.multinomial(len(scenes), np.full(len(scenes), 1 / len(scenes)), RESAMPLED)
    resampled = _youden(*(drawn @ c for c in counts), *((drawn @ s)[:, None] for s in sizes))
    low, high = np.percentile(THRESHOLDS[resampled.argmax(axis=1)], (2.5, 97.5))

    graspable = sum(trial.graspable for trial in trials)
    curve: list[dict[str, Any]] = []
    for k, threshold in enumerate(THRESHOLDS):
        hits, false = int((passes[:, k] & right).sum()), int((passes[:, k] & ~right).sum())
        curve.append(
            {
                "threshold": float(threshold),
                "youden": float(youden[k]),
                "found": study.rate(hits, max(graspable, hits)),
                "false_peaks": study.rate(false, int((~right).sum())),
                "wrong_of_passing": study.rate(false, hits + false),
            }
        )
    careful = next((p for p in curve if p["wrong_of_passing"]["wilson_high"] <= FALSE_SHARE), None)
    default = min(curve, key=lambda p: abs(p["threshold"] - ReachConfig().peak_threshold))
    return {
        **curve[best],
        "low": float(low),
        "high": float(high),
        "at_default": default,
        "careful": careful,
        "curve": curve,
    }


def _youden(hits: np.ndarray, false: np.ndarray, right: Any, wrong: Any) -> FloatArray:
    """Share of right peaks that pass minus share of false ones; a share of nothing is zero."""
    return np.asarray(hits / np.maximum(right, 1) - false / np.maximum(wrong, 1))


def draw_reliability(axes: Axes, calibrations: Mapping[str, Mapping[str, Any]]) -> None:
    """Measured success against claimed quality; arguments by detector, as from `calibration`."""
    axes.plot([0, 1], [0, 100], color="#888888", linestyle="--", label="as claimed")
    for k, (name, found) in enumerate(calibrations.items()):
        if not found["n"]:
            continue
        heights, ends = study.error_bars(found["bins"])
        x = [b["claimed"] for b in found["bins"]]
        label = f"{name}: ECE {found['ece']:.3f}, Brier {found['brier']:.3f}"
        axes.errorbar(x, heights, yerr=ends, capsize=3, label=label, **study.style(k))
    axes.set(xlabel="claimed quality", ylabel="measured success [%]", xlim=(0, 1), ylim=(0, 101))
    axes.set_title("calibration; bars: 95 % Wilson")
    axes.legend(loc="lower right", fontsize=10)


def draw_peaks(axes: Axes, thresholds: Mapping[str, Mapping[str, Any]]) -> None:
    """Right and false peaks against the threshold; arguments by detector, as from `choose_threshold`."""
    for k, (name, chosen) in enumerate(thresholds.items()):
        x = [p["threshold"] for p in chosen["curve"]]
        for what, stroke in (("found", "-"), ("false_peaks", ":")):
            y = [100 * p[what]["rate"] for p in chosen["curve"]]
            axes.plot(x, y, stroke, color=study.COLOURS[k], label=name if stroke == "-" else None)
        axes.axvline(chosen["threshold"], color=study.COLOURS[k], linewidth=1)
    axes.plot([], [], ":", color="black", label="false peaks, of views without a right one")
    axes.set(xlabel="threshold of exist_peak()", ylabel="share [%]", xlim=(0, 1), ylim=(0, 101))
    axes.set_title("right peaks found; upright: chosen threshold")
    axes.legend(fontsize=10)
