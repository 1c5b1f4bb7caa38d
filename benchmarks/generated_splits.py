"""What do networks learn from the same few generated images? The paper's Table II and Fig. 6 on our data.

    python -m mpgrasp.training generate --scenes 100 --views 6 --seed 7 --out data/splits
    python benchmarks/generated_splits.py --data data/splits --limit 600 --epochs 8

Trains every network on half of the images and tests it on the other half, and the other way round:
image-wise, where a scene has views in both halves, and object-wise, where it has not; from depth, colour and
both. It is `python -m mpgrasp.evaluate synthetic --train` for each of these, with one budget for all. Every
network is tested against DHRNet on the same images, and DHRNet's inputs among themselves, by McNemar's exact
test after Holm's correction over all of the study. What is trained is kept in --work, so that an interrupted
study goes on.
"""

from __future__ import annotations

import contextlib
import csv
import sys
from collections.abc import Mapping, Sequence
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import study

from mpgrasp.command_line import COUNT, SEED, THREADS, number, whole
from mpgrasp.evaluate.__main__ import main as evaluate
from mpgrasp.evaluate.options import CHANNELS
from mpgrasp.exceptions import ConfigError, OutputError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SPLITS = {"iw": "image-wise", "ow": "object-wise"}
NETWORKS = "dhrnet,tfgrasp,ggcnn,ggcnn2,grconvnet,lenz"
"""Those that claim an opening, without which a rectangle says nothing."""
REFERENCE = "dhrnet"

Answers = dict[str, dict[str, tuple[bool, bool, int]]]
"""Of each network, of each image: best grasp right, one of the best five right, and the fold."""


def answers_of(file: Path) -> Answers:
    """Return what `mpgrasp.evaluate` has written of every image.

    Raises:
        OutputError: it cannot be read.
    """
    found: Answers = {}
    try:
        with file.open(encoding="utf-8", newline="") as opened:
            for row in csv.DictReader(opened):
                if row["labelled"] == "True":
                    verdict = row["top1"] == "True", row["top5"] == "True", int(row["fold"])
                    found.setdefault(row["detector"], {})[row["image"]] = verdict
    except (OSError, KeyError, ValueError) as error:
        raise OutputError(f"no verdicts on images: {error!r}", got=str(file)) from error
    return found


def row_of(network: str, channels: str, split: str, images: Mapping[str, tuple[bool, bool, int]]) -> Any:
    """A row of the table: rates over all images with their intervals, mean and deviation over the folds."""
    from mpgrasp.datasets.folds import spread

    right = list(images.values())
    folds = sorted({fold for _, _, fold in right})
    shares = [float(np.mean([best for best, _, fold in right if fold == k])) for k in folds]
    mean, deviation = spread(shares)
    return {
        "network": network,
        "channels": channels,
        "split": split,
        "best": study.rate(sum(best for best, _, _ in right), len(right)),
        "one_of_five": study.rate(sum(five for _, five, _ in right), len(right)),
        "fold_mean": mean,
        "fold_deviation": deviation,
    }


def tests_of(cells: Mapping[tuple[str, str], Answers]) -> list[dict[str, Any]]:
    """Tests of networks against the reference, and of the reference's inputs among themselves.

    Args:
        cells: answers by split and channels.
    """
    tests = []
    for (split, channels), answers in cells.items():
        for name in answers:
            if name != REFERENCE and REFERENCE in answers:
                told = {"split": split, "channels": channels}
                tests += [told | row for row in _paired(REFERENCE, answers[REFERENCE], name, answers[name])]
    for split in SPLITS:
        seen = {
            ch: cells[split, ch][REFERENCE] for s, ch in cells if s == split and REFERENCE in cells[s, ch]
        }
        for a, b in combinations(seen, 2):
            tests += [{"split": split, "channels": "all"} | row for row in _paired(a, seen[a], b, seen[b])]
    return study.corrected(tests)


def _paired(
    a: str, of_a: Mapping[str, tuple[bool, bool, int]], b: str, of_b: Mapping[str, tuple[bool, bool, int]]
) -> list[dict[str, Any]]:
    common = sorted(of_a.keys() & of_b.keys())
    return study.paired({a: [of_a[i][0] for i in common], b: [of_b[i][0] for i in common]})


def draw(rows: Sequence[Mapping[str, Any]]) -> Figure:
    """Shares of right best grasps with their intervals: a panel for each split, a group for each input."""
    splits = list(dict.fromkeys(row["split"] for row in rows))
    networks = list(dict.fromkeys(row["network"] for row in rows))
    channels = list(dict.fromkeys(row["channels"] for row in rows))
    figure, panels = study.figure(len(splits))
    width = 0.8 / len(networks)
    for axes, split in zip(panels, splits, strict=True):
        for k, name in enumerate(networks):
            mine = {
                row["channels"]: row["best"]
                for row in rows
                if (row["network"], row["split"]) == (name, split)
            }
            heights, bars = study.error_bars([mine[ch] for ch in channels if ch in mine])
            at = [j + (k - (len(networks) - 1) / 2) * width for j, ch in enumerate(channels) if ch in mine]
            axes.bar(at, heights, width, yerr=bars, color=study.style(k)["color"], capsize=2, label=name)
        n = next(row["best"]["n"] for row in rows if row["split"] == split)
        axes.set(ylabel="right best grasps [%]", ylim=(0, 100), title=f"{SPLITS[split]}, n = {n}")
        axes.set_xticks(
            range(len(channels)), [{"d": "depth", "rgb": "colour", "rgbd": "both"}[c] for c in channels]
        )
    panels[0].legend(ncols=2, fontsize=9)
    return figure


def table(rows: Sequence[Mapping[str, Any]]) -> str:
    """A line for each network, input and split."""
    lines = [f"{'network':<11}{'input':<7}{'split':<7}{'best right %':<22}{'one of five %':<22}folds %"]
    for row in rows:
        folds = f"{100 * row['fold_mean']:.1f} ± {100 * row['fold_deviation']:.1f}"
        rates = study.percent(row["best"]) + study.percent(row["one_of_five"])
        lines.append(f"{row['network']:<11}{row['channels']:<7}{row['split']:<7}{rates}{folds}")
    return "\n".join(lines)


def _study(command: Sequence[str]) -> None:
    parser = study.Parser(description=__doc__)
    add = parser.add_argument
    add("--data", metavar="DIR", type=Path, default=Path("data/splits"), help="shards (default: %(default)s)")
    add("--work", metavar="DIR", type=Path, default=Path("data/splits-work"), help="default: %(default)s")
    add("--detector", metavar="D[,D]", default=NETWORKS, help="networks (default: %(default)s)")
    add("--channels", metavar="C[,C]", default=",".join(CHANNELS), help="default: %(default)s")
    add("--folds", metavar="K", type=whole(2, 100), default=2, help="default: 2")
    add("--limit", metavar="N", type=COUNT, default=600, help="images (default: 600)")
    add("--epochs", metavar="N", type=number(0, 1e5, above=True), default=8.0, help="default: 8")
    add("--batch", metavar="N", type=whole(1, 65536), default=8, help="images a step (default: 8)")
    add("--lr", metavar="X", type=number(0, 100, above=True), default=1e-3, help="default: 0.001")
    add("--seed", metavar="S", type=SEED, default=0, help="of the trainings (default: 0)")
    add("--threads", metavar="N", type=THREADS, help="of a training (default: all cores)")
    add("--out", metavar="DIR", type=Path, default=study.RESULTS / "generated-splits")
    options = parser.parse_args(command)
    channels = options.channels.split(",")
    if not set(channels) <= set(CHANNELS) or len(set(channels)) < len(channels):
        raise ConfigError("unusable inputs", got=options.channels, allowed=f"some of {', '.join(CHANNELS)}")
    if not options.data.is_dir():
        raise ConfigError("no such folder", got=str(options.data), allowed="that of `training generate`")
    study.prepare(options.out)
    budget = {
        key: getattr(options, key) for key in ("detector", "folds", "limit", "epochs", "batch", "lr", "seed")
    }
    run = study.about("generated_splits", command, data=options.data.name, **budget)
    cells: dict[tuple[str, str], Answers] = {}
    for part in [(split, ch) for ch in channels for split in SPLITS]:
        kept = options.work / f"{'-'.join(part)}.json"
        told = {**budget, "split": part[0], "channels": part[1]}
        cells[part] = study.kept(kept, told, lambda part=part: _trained(options, budget, *part))  # type: ignore[misc]
    rows = [
        row_of(name, ch, split, images)
        for (split, ch), answers in cells.items()
        for name, images in answers.items()
    ]
    results = {"rows": rows, "mcnemar": tests_of(cells)}
    study.publish(options.out, "generated-splits", run, results, rows, draw(rows))
    print(f"{table(rows)}\nResults: {options.out}")


def _trained(options: Any, budget: Mapping[str, Any], split: str, channels: str) -> dict[str, Any]:
    """Train and test every network on one split from one input, and return its answers."""
    out = options.work / f"{split}-{channels}"
    words = ["synthetic", str(options.data), "--train", "--split", split, "--channels", channels]
    words += [
        word
        for key, value in budget.items()
        for word in (f"--{key}", f"{value:g}" if key == "lr" else str(value))
    ]
    words += [] if options.threads is None else ["--threads", str(options.threads)]
    with contextlib.redirect_stdout(sys.stderr):
        code = evaluate([*words, "--out", str(out)])
    if code:
        raise OutputError("mpgrasp.evaluate has not ended well", got=f"exit code {code}", allowed="0")
    return answers_of(out / "images.csv")


def main(command: Sequence[str] | None = None) -> int:
    """Run the command line (`sys.argv` if not given) and return the exit code; 2 for unusable input."""
    return study.run_command(_study, command)


if __name__ == "__main__":
    sys.exit(main())
