"""`python -m mpgrasp.detectors card`: what is known about a detector's weights."""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from mpgrasp.exceptions import ConfigError
from mpgrasp.paths import WEIGHTS
from mpgrasp.plugins import load_detector


def run(options: argparse.Namespace) -> int:
    """Print the training card of a detector's weights; return the exit code."""
    _print(card(options.detector, options.weights))
    return 0


def card(name: str, weights: Path | None) -> dict[str, Any]:
    """Return what is known about a detector's weights: the network, its training, and its success.

    Raises:
        ConfigError: a detector without weights of its own.
        WeightsError: a file that is missing, unreadable or another network's.
    """
    loaded: Any = getattr(load_detector(name, weights, "torch"), "weights", None)
    if not hasattr(loaded, "card"):
        raise ConfigError("a detector without a training card", got=name, allowed="a network, such as dhrnet")
    return {
        "network": loaded.name,
        "file": str(weights or WEIGHTS / f"{name}.safetensors"),
        "parameters": sum(p.numel() for p in loaded.network.parameters()),
        "settings": dict(loaded.settings),
        "input": vars(loaded.input),
        "width_px": loaded.width_px,
        "calibration": None if loaded.calibration is None else vars(loaded.calibration),
        "training": dict(loaded.card),
    }


def _print(about: Mapping[str, Any], indent: str = "") -> None:
    for key, value in about.items():
        if isinstance(value, Mapping) and value:
            print(f"{indent}{key}:")
            _print(value, indent + "  ")
        else:
            print(f"{indent}{key}: {value if isinstance(value, str) else json.dumps(value, default=str)}")
