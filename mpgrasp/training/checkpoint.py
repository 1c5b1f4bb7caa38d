"""The state of a training run on disk, so that it can be resumed."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import torch

from mpgrasp.exceptions import OutputError, WeightsError
from mpgrasp.training.trainer_config import TrainConfig

FORMAT = "mpgrasp-checkpoint-2"
BUDGET = ("epochs", "minutes", "validation_images", "lift_images", "validate_every")
"""Settings that a resumed run may change: how long, and what is looked at on the way."""


def write_checkpoint(path: Path, config: TrainConfig, state: Mapping[str, Any]) -> None:
    """Write tensors and plain values; an older checkpoint stays until the new one is complete.

    Raises:
        OutputError: the file cannot be written.
    """
    temporary = path.with_name(path.name + ".part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        torch.save({"format": FORMAT, "config": _fixed(config), **state}, temporary)
        temporary.replace(path)
    except (OSError, RuntimeError) as error:
        raise OutputError(f"checkpoint cannot be written: {error}", got=str(path)) from error


def read_checkpoint(path: Path, config: TrainConfig, device: torch.device) -> dict[str, Any]:
    """Return what was written.

    Raises:
        WeightsError: the file is unreadable or of a run with other settings.
    """
    try:
        state: dict[str, Any] = torch.load(path, map_location=device, weights_only=True)
        found, wanted = json.loads(state["config"]), json.loads(_fixed(config))
        if state["format"] != FORMAT:
            raise KeyError("made by another version")
    except Exception as error:  # torch names no common base for what a broken file may raise
        raise WeightsError(f"checkpoint cannot be used: {error}", got=str(path)) from error
    for name in wanted:
        if found.get(name) != wanted[name]:
            raise WeightsError(
                f"checkpoint of a run with another {name}", got=found.get(name), allowed=str(wanted[name])
            )
    return state


def _fixed(config: TrainConfig) -> str:
    return json.dumps({k: v for k, v in asdict(config).items() if k not in BUDGET})
