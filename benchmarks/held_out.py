"""Does the best grasp of a single view lift? And does the quality that a network claims for it hold?

    python benchmarks/held_out.py --data data/test

Scenes that no network was trained on: `python -m mpgrasp.training generate` with a seed of their own. Every
detector sees the same noisy views. Its best grasp of each is judged against the labels (hit, rectangle
metric) and executed by the free-flying gripper in the true scene. Accuracy is that of views with a
labelled grasp.
Calibration holds the best grasp's quality against its success, over all views in which a grasp was found, and
the same trials choose the threshold of MP-PC's exist_peak(), for each detector and for all of them together;
the rule stands in calibration.py.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import study
from calibration import calibration, choose_threshold, draw_peaks, draw_reliability
from single_view import Trial, execute, propose

from mpgrasp.command_line import COUNT, SEED, THREADS
from mpgrasp.controllers.config import ReachConfig
from mpgrasp.training.data.views import CAMERA_HEIGHT
from mpgrasp.training.dataset import GraspDataset

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

METRICS = ("lifted", "hit", "rectangle")
GROUPS: dict[str, Callable[[Trial], bool]] = {
    "all": lambda trial: True,
    "thin": lambda trial: trial.thin,
    "thick": lambda trial: not trial.thin,
    "stacked": lambda trial: trial.stacked,
    "low": lambda trial: _third(trial) == 0,
    "mid": lambda trial: _third(trial) == 1,
    "high": lambda trial: _third(trial) == 2,
}
"""Groups of views: thin scenes rise no higher than 13 mm, in stacked ones an object lies on another, the
camera is in the lowest, middle or highest third of its heights."""


def accuracy(trials: Sequence[Trial]) -> list[dict[str, Any]]:
    """A row per detector and group: the rates of `METRICS` over its views with a labelled grasp."""
    rows = []
    for name, own in by_detector(trials).items():
        for group, belongs in GROUPS.items():
            views = [trial for trial in own if trial.graspable and belongs(trial)]
            rates = {m: study.rate(sum(getattr(trial, m) for trial in views), len(views)) for m in METRICS}
            rows.append({"detector": name, "group": group, "n": len(views), **rates})
    return rows


def _third(trial: Trial) -> int:
    low, high = CAMERA_HEIGHT
    return int(np.clip(3 * (trial.camera_height - low) / (high - low), 0, 2))


def by_detector(trials: Iterable[Trial]) -> dict[str, list[Trial]]:
    """Trials by detector, in order of appearance."""
    own: dict[str, list[Trial]] = {}
    for trial in trials:
        own.setdefault(trial.detector, []).append(trial)
    return own


def compare(trials: Sequence[Trial]) -> list[dict[str, Any]]:
    """Exact McNemar tests between detectors for each metric and group, over views with a labelled grasp."""
    rows = []
    for metric in METRICS:
        for group, belongs in GROUPS.items():
            views = [trial for trial in trials if trial.graspable and belongs(trial)]
            answers = {
                name: [bool(getattr(trial, metric)) for trial in own]
                for name, own in by_detector(views).items()
            }
            rows += [{"metric": metric, "group": group, **row} for row in study.paired(answers)]
    return study.corrected(rows)


def draw(results: Mapping[str, Any]) -> Figure:
    """Success by group, reliability, and peaks against the threshold."""
    figure, (bars, reliability, peaks) = study.figure(3)
    _draw_accuracy(bars, results["accuracy"])
    draw_reliability(reliability, results["calibration"])
    draw_peaks(peaks, results["thresholds"])
    return figure


def _draw_accuracy(axes: Axes, rows: Sequence[Mapping[str, Any]]) -> None:
    for k, name in enumerate(names := list(dict.fromkeys(row["detector"] for row in rows))):
        rates = [row["lifted"] for row in rows if row["detector"] == name]
        heights, ends = study.error_bars(rates)
        x = np.arange(len(rates)) + 0.16 * (k - (len(names) - 1) / 2)
        axes.errorbar(
            x, heights, yerr=ends, fmt=study.MARKERS[k], color=study.COLOURS[k], capsize=3, label=name
        )
    first = [row for row in rows if row["detector"] == names[0]]
    axes.set_xticks(range(len(first)), [f"{row['group']}\n{row['n']}" for row in first], fontsize=10)
    axes.set(
        ylabel="best grasp lifts [%]", ylim=(0, 101), title="simulated success; n views, bars: 95 % Wilson"
    )
    axes.legend(loc="lower left", fontsize=10)


def analyse(trials: Sequence[Trial], seed: int) -> dict[str, Any]:
    """All results: accuracy, McNemar tests, calibration and threshold by detector, and one for all."""
    own = by_detector(trials)
    return {
        "accuracy": accuracy(trials),
        "mcnemar": compare(trials),
        "calibration": {name: calibration(group) for name, group in own.items()},
        "thresholds": {
            name: choose_threshold(group, np.random.default_rng(seed)) for name, group in own.items()
        },
        "common_threshold": choose_threshold(trials, np.random.default_rng(seed)),
    }


def table(results: Mapping[str, Any]) -> str:
    """Success by detector and group; below, calibration and threshold of each detector."""
    lines = [f"{'detector':>12} {'group':<8} {'n':>5}   " + "".join(f"{m + ' %':<22}" for m in METRICS)]
    for row in results["accuracy"]:
        texts = [study.percent(row[metric]) for metric in METRICS]
        lines.append(f"{row['detector']:>12} {row['group']:<8} {row['n']:>5}   " + "".join(texts))
    for name, found in results["calibration"].items():
        error = f"ECE {found['ece']:.3f}, Brier {found['brier']:.3f}" if found["n"] else "no grasps"
        lines.append(f"{name:>12}: {error}; {_threshold(results['thresholds'][name])}")
    lines.append(f"{'together':>12}: {_threshold(results['common_threshold'])}")
    return "\n".join(lines)


def _threshold(chosen: Mapping[str, Any]) -> str:
    careful = "none" if chosen["careful"] is None else f"{chosen['careful']['threshold']:.2f}"
    return (
        f"threshold {chosen['threshold']:.2f} [{chosen['low']:.2f}-{chosen['high']:.2f}], "
        f"finds {100 * chosen['found']['rate']:.1f} %, "
        f"false peaks {100 * chosen['false_peaks']['rate']:.1f} %; careful: {careful}"
    )


def _study(command: Sequence[str]) -> None:
    parser = study.Parser(description=__doc__)
    add = parser.add_argument
    add("--data", metavar="DIR", type=Path, default=Path("data/test"), help="default: %(default)s")
    add("--detector", metavar="D[,D]", default="dhrnet,tfgrasp,ggcnn2", help="default: %(default)s")
    add("--scenes", metavar="N", type=COUNT, help="at most (default: all)")
    add("--workers", metavar="N", type=THREADS, default=os.cpu_count(), help="processes (default: all cores)")
    add("--seed", metavar="S", type=SEED, default=0, help="of the bootstrap (default: 0)")
    add("--out", metavar="DIR", type=Path, default=study.RESULTS / "held-out")
    options = parser.parse_args(command)
    study.positive("number of scenes or workers", options.scenes or 1, options.workers)
    study.not_negative("seed", options.seed)
    study.prepare(options.out)
    detectors, who = study.load_detectors(options.detector)
    colour = any(getattr(d, "reads_colour", False) for d in detectors.values())
    dataset = GraspDataset([options.data], holdout=0, colour=colour)
    order = dict.fromkeys(dataset.scene(i) for i in range(len(dataset)))
    chosen = set(list(order)[: options.scenes])
    images = [i for i in range(len(dataset)) if dataset.scene(i) in chosen]
    trials = execute(
        propose(detectors, dataset, study.track(images, "predictions", len(images))), options.workers
    )
    results = {"scenes": len(chosen), "views": len(images), **analyse(trials, options.seed)}
    rows = [asdict(trial) for trial in trials]
    about = study.about(
        "held_out", command, data=dataset.description(), peak_threshold=ReachConfig().peak_threshold,
        seed=options.seed, **who,
    )  # fmt: skip
    study.publish(options.out, "held-out", about, results, rows, draw(results))
    print(f"{len(chosen)} scenes, {len(images)} views.\n{table(results)}\nResults: {options.out}")


def main(command: Sequence[str] | None = None) -> int:
    """Run the command line (`sys.argv` if not given) and return the exit code; 2 for unusable input."""
    return study.run_command(_study, command)


if __name__ == "__main__":
    sys.exit(main())
