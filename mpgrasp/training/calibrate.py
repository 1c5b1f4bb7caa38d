"""`python -m mpgrasp.training calibrate NAME --data DIR`: make a network's claims probabilities of a lift.

The best grasp of every view is executed in simulation, in the scene that the view shows. What comes out
goes into a weights file: the calibration, which a detector applies, and how well it fits, into the card.
Take scenes that the network was neither trained nor chosen on: a set with a seed of its own.
"""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from mpgrasp.detectors.networks.registry import NETWORKS
from mpgrasp.exceptions import ConfigError


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `python -m mpgrasp.training calibrate`."""
    add = parser.add_argument
    add("name", help="network: " + ", ".join(NETWORKS))
    add("--weights", type=Path, metavar="FILE", help="to be calibrated (default: the shipped ones)")
    add("--data", type=Path, nargs="+", required=True, metavar="DIR", help="directories of shards")
    add("--out", type=Path, metavar="FILE", help="weights file (default: out/NAME.safetensors)")


def main(args: argparse.Namespace) -> int:
    """Run the command and return its exit code.

    Raises:
        MpgraspError: unusable data or files.
    """
    from rich.console import Console
    from rich.progress import track

    from mpgrasp.detectors.config import NetworkDetectorConfig
    from mpgrasp.detectors.network_detector import NetworkDetector
    from mpgrasp.detectors.networks.weights import load_weights, save_weights
    from mpgrasp.training.claims import claims, fit, measured
    from mpgrasp.training.dataset import GraspDataset

    weights = load_weights(args.name, args.weights)
    dataset = GraspDataset(args.data, holdout=0, colour=weights.input.reads_colour)
    _refuse_known(weights.card, dataset.description())
    detector = NetworkDetector(weights, NetworkDetectorConfig(calibrated=False))
    console = Console(stderr=True)
    images = track(range(len(dataset)), "lifts", console=console, disable=not console.is_terminal)
    found = list(claims(detector, dataset, images))
    calibration = fit(found)
    figures = measured(found, calibration)
    card = {
        "command": shlex.join(
            ["python", "-m", "mpgrasp.training", "calibrate", args.name, "--data", *map(str, args.data)]
        ),
        "data": dataset.description(),
        **figures,
    }
    out: Path = args.out or Path("out", f"{args.name}.safetensors")
    save_weights(out, replace(weights, calibration=calibration, card={**weights.card, "calibration": card}))
    print(
        f"{args.name}: {figures['n']} grasps, {100 * figures['lifted']:.1f} % lift; expected calibration"
        f" error {figures['ece_claimed']:.3f} as claimed, {figures['ece_calibrated']:.3f} with slope"
        f" {calibration.slope:.3f} and shift {calibration.shift:.3f}\nWeights: {out}"
    )
    return 0


def _refuse_known(card: Mapping[str, Any], sets: Sequence[Mapping[str, Any]]) -> None:
    """Raise ConfigError where the network was trained or chosen, in any stage, on scenes of such a set."""
    start = card.get("start")  # what the training went on from
    if isinstance(start, Mapping) and isinstance(start.get("card"), Mapping):
        _refuse_known(start["card"], sets)
    # cards of others may say what they like: "Cornell or Jacquard"
    lists = [told for key in ("data", "validation_data") if isinstance(told := card.get(key), list)]
    for known in (known for told in lists for known in told if isinstance(known, Mapping)):
        for own in sets:
            if all(key in own and own[key] == known.get(key) for key in ("seed", "format")):
                raise ConfigError(
                    "scenes that the network was trained or chosen on, which flatter it",
                    got=f"{own['name']}, seed {own['seed']}",
                    allowed="a set with a seed of its own",
                )
