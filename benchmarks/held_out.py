"""Does the best grasp of a single view lift? And does the quality that a network claims for it hold?

    python benchmarks/held_out.py --data data/test

Scenes that no network was trained on: `python -m mpgrasp.training generate` with a seed of their own. Every
detector sees the same noisy views. Its best grasp of each is judged against the labels (hit, rectangle
metric) and executed by the free-flying gripper in the true scene. Accuracy is that of views with a
labelled grasp.
Calibration holds the best grasp's quality against its success, over all views in which a grasp was found, and
the same trials choose the threshold of MP-PC's exist_peak(), for each detector and for all of them together;
the rule stands in reliability.py.
"""

from __future__ import annotations

import multiprocessing
import os
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np
import study
from reliability import calibration, choose_threshold, draw_peaks, draw_reliability

from mpgrasp.controllers.config import MppcConfig
from mpgrasp.depth import DepthFrame
from mpgrasp.detectors.detector import GraspDetector, reads_truth
from mpgrasp.exceptions import ConfigError
from mpgrasp.grasp import Grasp, best_pixel, peak_height
from mpgrasp.motion.lift_trial import LiftRig
from mpgrasp.scene.scene import Scene
from mpgrasp.training.data.views import CAMERA_HEIGHT, make_scene, stored_intrinsics, stored_pose
from mpgrasp.training.dataset import GraspDataset
from mpgrasp.training.metrics import match_labels

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Line = dict[str, Any]
METRICS = ("lifted", "hit", "rectangle")
GROUPS: dict[str, Callable[[Line], bool]] = {
    "all": lambda line: True,
    "thin": lambda line: line["thin"],
    "thick": lambda line: not line["thin"],
    "stacked": lambda line: line["stacked"],
    "low": lambda line: _third(line) == 0,
    "mid": lambda line: _third(line) == 1,
    "high": lambda line: _third(line) == 2,
}
"""Of views: thin scenes rise no higher than 13 mm, in stacked ones an object lies on another, the camera is
in the lowest, middle or highest third of its heights."""
STEEP = 0.5
"""A contact carries when its normal is at least so much upright (its z component)."""


@dataclass(frozen=True, kw_only=True)
class Proposal:
    """A detector's best grasp of an image, before it is executed."""

    detector: str
    image: int
    scene: tuple[int, int]
    """Seed of the data set, number of the scene."""
    grasp: Grasp | None
    """None where the quality is zero everywhere."""
    line: Line
    """What is known without executing it."""


def propose(
    detectors: Mapping[str, GraspDetector], dataset: GraspDataset, images: Iterable[int]
) -> list[Proposal]:
    """The best grasp of every detector in every image, judged against the labels."""
    thin, height = (_column(dataset, name) for name in ("thin", "camera_height"))
    told = any(map(reads_truth, detectors.values()))
    proposals, before, truth = [], None, None
    for i in images:
        scene, sample = dataset.scene(i), dataset.sample(i)
        if told and scene != before:
            before, truth = scene, make_scene(*scene)[0].height_map()
        frame = DepthFrame(
            depth=sample.depth,
            rgb=sample.rgb,
            intrinsics=stored_intrinsics(),
            T_world_camera=stored_pose(dataset.meta[i], dataset.columns),
        )
        for name, detector in detectors.items():
            detector.reset(truth if reads_truth(detector) else None)
            found = detector.predict(frame)
            labels = sample.resized(len(found.quality))
            verdict = match_labels(found.quality, found.angle, found.width, labels)
            grasp = found.grasp_at(*best_pixel(found.quality))
            line = {
                "detector": name,
                "image": i,
                "scene": scene[1],
                "camera_height": float(height[i]),
                "thin": bool(thin[i] > 0.5),
                "graspable": bool(sample.quality.any()),
                "quality": grasp.quality,
                "peak_height": peak_height(found.quality),
                "hit": verdict.hit,
                "rectangle": verdict.rectangle,
            }
            there = grasp.quality > 0 and bool(np.isfinite(grasp.position).all())
            proposals.append(
                Proposal(detector=name, image=i, scene=scene, grasp=grasp if there else None, line=line)
            )
    return proposals


def _column(dataset: GraspDataset, name: str) -> np.ndarray:
    values = dataset.column(name)
    if values is None:
        raise ConfigError("data without a column that the study needs", got=dataset.columns, allowed=name)
    return values


def execute(proposals: Sequence[Proposal], workers: int) -> list[Line]:
    """Every proposal's line with its `outcome`, whether it `lifted`, and whether its scene is `stacked`."""
    scenes: dict[tuple[int, int], list[int]] = {}
    for k, proposal in enumerate(proposals):
        scenes.setdefault(proposal.scene, []).append(k)
    jobs = [(scene, [proposals[k].grasp for k in members]) for scene, members in scenes.items()]
    lines: list[Line] = [{}] * len(proposals)
    with multiprocessing.get_context("spawn").Pool(workers) if workers > 1 else _Here() as pool:
        results = study.track(pool.imap(lift_all, jobs), "lifts", len(jobs))
        for members, (stacked, outcomes) in zip(scenes.values(), results, strict=True):
            for k, outcome in zip(members, outcomes, strict=True):
                lifted = outcome == "success"
                lines[k] = proposals[k].line | {"stacked": stacked, "outcome": outcome, "lifted": lifted}
    return lines


class _Here:
    """A pool without processes."""

    imap = staticmethod(map)

    def __enter__(self) -> _Here:
        return self

    def __exit__(self, *_: object) -> None:
        pass


def lift_all(job: tuple[tuple[int, int], list[Grasp | None]]) -> tuple[bool, list[str]]:
    """Whether things lie on each other in a scene, and the outcomes of grasps in it ("no_grasp" of None)."""
    (seed, index), grasps = job
    scene, _ = make_scene(seed, index)
    rig = LiftRig(scene)
    return is_stacked(scene), ["no_grasp" if g is None else rig.attempt(g).outcome for g in grasps]


def is_stacked(scene: Scene) -> bool:
    """Whether some object carries another in the settled scene."""
    model, data = scene.model, scene.data()
    mujoco.mj_forward(model, data)
    owner = {model.body(name).id for name in scene.objects}
    for contact in data.contact:
        bodies = {int(model.geom_bodyid[g]) for g in contact.geom}
        if len(bodies) == 2 and bodies <= owner and abs(contact.frame[2]) > STEEP:
            return True
    return False


def accuracy(lines: Sequence[Line]) -> list[dict[str, Any]]:
    """A row per detector and group: the rates of `METRICS` over its views with a labelled grasp."""
    rows = []
    for name, own in by_detector(lines).items():
        for group, belongs in GROUPS.items():
            views = [line for line in own if line["graspable"] and belongs(line)]
            rates = {metric: study.rate(sum(v[metric] for v in views), len(views)) for metric in METRICS}
            rows.append({"detector": name, "group": group, "n": len(views), **rates})
    return rows


def _third(line: Line) -> int:
    low, high = CAMERA_HEIGHT
    return int(np.clip(3 * (line["camera_height"] - low) / (high - low), 0, 2))


def by_detector(lines: Iterable[Line]) -> dict[str, list[Line]]:
    """Lines by detector, in order of appearance."""
    own: dict[str, list[Line]] = {}
    for line in lines:
        own.setdefault(line["detector"], []).append(line)
    return own


def compare(lines: Sequence[Line]) -> list[dict[str, Any]]:
    """Exact McNemar tests between detectors for each metric and group, over views with a labelled grasp."""
    rows = []
    for metric in METRICS:
        for group, belongs in GROUPS.items():
            views = [line for line in lines if line["graspable"] and belongs(line)]
            answers = {name: [v[metric] for v in own] for name, own in by_detector(views).items()}
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


def analyse(lines: Sequence[Line], seed: int) -> dict[str, Any]:
    """All results: accuracy, McNemar tests, calibration and threshold by detector, and one for all."""
    own = by_detector(lines)
    return {
        "accuracy": accuracy(lines),
        "mcnemar": compare(lines),
        "calibration": {name: calibration(group) for name, group in own.items()},
        "thresholds": {
            name: choose_threshold(group, np.random.default_rng(seed)) for name, group in own.items()
        },
        "common_threshold": choose_threshold(lines, np.random.default_rng(seed)),
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
    add("--scenes", metavar="N", type=int, help="at most (default: all)")
    add("--workers", metavar="N", type=int, default=os.cpu_count(), help="processes (default: all cores)")
    add("--seed", metavar="S", type=int, default=0, help="of the bootstrap (default: 0)")
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
    lines = execute(
        propose(detectors, dataset, study.track(images, "predictions", len(images))), options.workers
    )
    results = {"scenes": len(chosen), "views": len(images), **analyse(lines, options.seed)}
    about = study.about(
        "held_out", command, data=dataset.description(), peak_threshold=MppcConfig().peak_threshold,
        seed=options.seed, **who,
    )  # fmt: skip
    study.publish(options.out, "held-out", about, results, lines, draw(results))
    print(f"{len(chosen)} scenes, {len(images)} views.\n{table(results)}\nResults: {options.out}")


def main(command: Sequence[str] | None = None) -> int:
    """Run the command line (`sys.argv` if not given) and return the exit code; 2 for unusable input."""
    return study.run_command(_study, command)


if __name__ == "__main__":
    sys.exit(main())
