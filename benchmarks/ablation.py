"""Ablation of DHRNet: accuracy after ten epochs of its simpler relatives, and of its head's variants.

    python benchmarks/ablation.py architecture    # the paper's Fig. 8
    python benchmarks/ablation.py fusion          # the paper's Fig. 10, for depth, colour and both

`architecture` trains fcn, fcn_residual, unet and dhrnet; `fusion` trains dhrnet with a head that reads all
branches (Fig. 9b), all but the finest ("lower", Fig. 9a), or the finest alone ("highest"). All get the same
images, settings and seeds, and are judged on the same held-out images, those with a graspable object. A
finished training is kept in `runs/` beside the results, so that an interrupted study goes on.
"""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import study
from short_training import (
    METRICS,
    Settings,
    Variant,
    first_images,
    graspable,
    make_trainer,
    seconds_per_run,
    train,
)  # fmt: skip

from mpgrasp.command_line import COUNT, THREADS, number, whole
from mpgrasp.exceptions import ConfigError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from mpgrasp.training.dataset import GraspDataset

TITLES = {"rectangle": "rectangle metric", "hit": "hit"}
MODALITIES = ("d", "rgb", "rgbd")
HEADS = ("all", "lower", "highest")


STUDIES: dict[str, tuple[Variant, ...]] = {
    "architecture": tuple(Variant(label=n, name=n) for n in ("fcn", "fcn_residual", "unet", "dhrnet")),
    "fusion": tuple(
        Variant(
            label=f"{modality} {head}",
            name="dhrnet",
            modality=modality,
            settings={"head": head, "fine_head": False},
        )
        for modality in MODALITIES
        for head in HEADS
    ),
}


def draw(name: str, runs: Sequence[Mapping[str, Any]]) -> Figure:
    """Left, accuracy by the rectangle metric against epochs; right, both metrics in the end."""
    figure, (left, right) = study.figure(2, width=7.0 if name == "fusion" else 6.0)
    labels = list(dict.fromkeys(run["label"] for run in runs))
    epochs = len(runs[0]["curve"])
    for k, label in enumerate(labels):
        of_label = [run for run in runs if run["label"] == label]
        curves = np.array([[100 * p["rectangle"]["rate"] for p in run["curve"]] for run in of_label])
        # nine lines of the fusion study: a colour per head, a stroke per input
        colour, stroke = study.COLOURS[k % 3 if name == "fusion" else k], ("-", "--", ":", "-.")
        style = stroke[k // 3] if name == "fusion" else "-"
        left.plot(range(1, epochs + 1), curves.mean(axis=0), style, color=colour, linewidth=2, label=label)
        if len(curves) > 1:
            left.fill_between(
                range(1, epochs + 1), curves.min(axis=0), curves.max(axis=0), color=colour, alpha=0.15
            )
        for j, metric in enumerate(METRICS):
            heights, bars = study.error_bars([run["curve"][-1][metric] for run in of_label])
            x = k + 0.24 * (j - 0.5) + 0.05 * (np.arange(len(heights)) - (len(heights) - 1) / 2)
            right.errorbar(
                x, heights, yerr=bars, fmt=study.MARKERS[j], color=study.COLOURS[j], capsize=3,
                label=TITLES[metric] if k == 0 else None,
            )  # fmt: skip
    left.set(xlabel="epoch", ylabel="rectangle metric [%]", ylim=(0, 100), title="held-out images")
    left.legend(ncols=3 if name == "fusion" else 1, fontsize=10)
    n = len(runs[0][METRICS[0]])
    right.set(
        ylabel="right top grasps [%]",
        ylim=(0, 100),
        title=f"after {epochs} epochs; n = {n}, bars: 95 % Wilson",
    )
    right.set_xticks(range(len(labels)), labels, rotation=30 if name == "fusion" else 0, ha="center")
    right.legend()
    return figure


def table(runs: Sequence[Mapping[str, Any]]) -> str:
    """One line per run: network, seed, parameters, both metrics with intervals, minutes."""
    lines = [f"{'network':>16} seed  parameters   {'rectangle %':<22}{'hit %':<22}minutes"]
    for run in runs:
        texts = "".join(study.percent(run["curve"][-1][metric]) for metric in METRICS)
        lines.append(
            f"{run['label']:>16} {run['seed']:>4} {run['parameters'] / 1e6:>9.2f} M   {texts}"
            f"{run['minutes']:.1f}"
        )
    return "\n".join(lines)


@dataclass(frozen=True, kw_only=True)
class Study:
    """The runs of a study: every variant with every seed."""

    variants: Sequence[Variant]
    settings: Settings
    seeds: Sequence[int]
    data: GraspDataset
    held_out: GraspDataset
    kept_in: Path
    """Finished runs are kept here and not done again."""

    def run(self) -> list[dict[str, Any]]:
        """Results of `train` with label and seed, seed by seed.

        Raises:
            ConfigError: nothing to judge on, or a run of other settings is kept there.
        """
        images = graspable(self.held_out, self.settings.held_out)
        if not len(images):
            raise ConfigError("no held-out image with a labelled grasp", got=len(self.held_out))
        runs = [(variant, seed) for seed in self.seeds for variant in self.variants]
        with tempfile.TemporaryDirectory() as scratch:
            out = Path(scratch) / "weights.safetensors"
            todo = [(v, s) for v, s in runs if not self._kept(v, s).is_file()]
            self._tell_cost([v for v, _ in todo], len(images), out)
            results = []
            for variant, seed in runs:
                make = partial(self._train, variant, seed, images, out)
                told = {
                    **asdict(self.settings),
                    "data": self.data.description(),
                    "held_out_data": self.held_out.description(),
                    "judged": len(images),
                    "network": asdict(variant),
                    "seed": seed,
                }
                result = study.kept(self._kept(variant, seed), told, make)
                results.append({"label": variant.label, "seed": seed, **result})
                print(table(results[-1:]).splitlines()[1], flush=True)
        return results

    def _train(self, variant: Variant, seed: int, images: np.ndarray, out: Path) -> dict[str, Any]:
        trainer = make_trainer(variant, self.settings, seed, self.data, self.held_out, out)
        return train(trainer, self.settings.epochs, images)

    def _tell_cost(self, todo: Sequence[Variant], images: int, out: Path) -> None:
        """Print about how long the runs are going to take."""
        cost = {}
        for variant in {v.label: v for v in todo}.values():
            trainer = make_trainer(variant, self.settings, 0, self.data, self.held_out, out)
            cost[variant.label] = seconds_per_run(trainer, self.settings.epochs, images)
            print(f"estimate: {variant.label} {cost[variant.label] / 60:.1f} min a run", flush=True)
        total = sum(cost[v.label] for v in todo) / 60
        print(f"estimate: {len(todo)} runs, {total:.0f} min in all", flush=True)

    def _kept(self, variant: Variant, seed: int) -> Path:
        return self.kept_in / f"{variant.label.replace(' ', '-')}-{seed}.json"


def _study(command: Sequence[str]) -> None:
    defaults = Settings()
    parser = study.Parser(description=__doc__)
    add = parser.add_argument
    add("study", choices=STUDIES, help="which networks are compared")
    add("--data", metavar="DIR", type=Path, default=Path("data/train"), help="default: %(default)s")
    add("--held-out", metavar="DIR", type=Path, default=Path("data/val"), help="default: %(default)s")
    add(
        "--images",
        metavar="N",
        type=whole(1, 10**9),
        default=defaults.images,
        help="to train on (default: %(default)s)",
    )
    add(
        "--judged",
        metavar="N",
        type=whole(1, 10**9),
        default=defaults.held_out,
        help="held out (default: %(default)s)",
    )
    add("--epochs", metavar="N", type=COUNT, default=defaults.epochs, help="default: %(default)s")
    add(
        "--batch",
        metavar="N",
        type=whole(1, 65536),
        default=defaults.batch,
        help="images a step (%(default)s)",
    )
    add(
        "--lr",
        metavar="X",
        type=number(0, 100, above=True),
        default=defaults.lr,
        help="highest learning rate (%(default)s)",
    )
    add("--seeds", metavar="N", type=whole(1, 100), default=1, help="trainings of each network (default: 1)")
    add(
        "--threads",
        metavar="N",
        type=THREADS,
        default=os.cpu_count(),
        help="default: all cores (%(default)s)",
    )
    add("--out", metavar="DIR", type=Path, help="default: benchmarks/results/ablation-<study>")
    options = parser.parse_args(command)
    settings = Settings(
        epochs=options.epochs,
        images=options.images,
        held_out=options.judged,
        batch=options.batch,
        lr=options.lr,
    )
    study.positive("number of seeds or threads", options.seeds, options.threads)
    out: Path = options.out or study.RESULTS / f"ablation-{options.study}"
    study.prepare(out)
    import torch

    torch.set_num_threads(options.threads)
    variants = STUDIES[options.study]
    colour = any(v.modality != "d" for v in variants)
    with tempfile.TemporaryDirectory() as links:
        data = first_images(options.data, settings.images, Path(links) / "train", colour=colour)
        held_out = first_images(options.held_out, settings.held_out, Path(links) / "held_out", colour=colour)
        runs = Study(
            variants=variants, settings=settings, seeds=range(options.seeds), data=data, held_out=held_out,
            kept_in=out / "runs",
        ).run()  # fmt: skip
    pairs = [
        {"seed": seed, "metric": metric, **row}
        for seed in range(options.seeds)
        for metric in METRICS
        for row in study.paired({r["label"]: r[metric] for r in runs if r["seed"] == seed})
    ]
    rows = [
        {"network": r["label"], "seed": r["seed"], "parameters": r["parameters"], **point}
        for r in runs
        for point in r["curve"]
    ]
    results = {"runs": [{k: v for k, v in r.items() if k not in METRICS} for r in runs]}
    results["mcnemar"] = study.corrected(pairs)
    about = study.about(
        "ablation",
        command,
        study=settings,
        networks=variants,
        data=[str(options.data), str(options.held_out)],
    )
    about |= {"threads": options.threads, "seeds": list(range(options.seeds))}
    study.publish(out, f"ablation-{options.study}", about, results, rows, draw(options.study, runs))
    print(f"{table(runs)}\nResults: {out}")


def main(command: Sequence[str] | None = None) -> int:
    """Run the command line (`sys.argv` if not given) and return the exit code; 2 for unusable input."""
    return study.run_command(_study, command)


if __name__ == "__main__":
    sys.exit(main())
