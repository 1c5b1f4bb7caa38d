"""Curves of a training while it lasts, in TensorBoard or Weights & Biases, where these are installed."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol

from mpgrasp.exceptions import ConfigError

TRACKERS = ("tensorboard", "wandb")
"""What a training may be watched in."""
PROJECT = "mpgrasp"


class Tracker(Protocol):
    """Takes numbers of a training by the step that they belong to."""

    def log(self, step: int, values: Mapping[str, float]) -> None:
        """Add values by name."""
        ...

    def close(self) -> None:
        """Write what is left."""
        ...


class TensorBoard:
    """Writes event files into a folder: `tensorboard --logdir FOLDER`."""

    def __init__(self, folder: Path) -> None:
        from torch.utils.tensorboard import SummaryWriter

        self._writer: Any = SummaryWriter(str(folder))

    def log(self, step: int, values: Mapping[str, float]) -> None:
        for name, value in values.items():
            self._writer.add_scalar(name, value, step)

    def close(self) -> None:
        self._writer.close()


class WeightsAndBiases:
    """A run of https://wandb.ai; its own environment variables say where it goes."""

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        import wandb

        self._run: Any = wandb.init(project=PROJECT, name=name, config=dict(settings))

    def log(self, step: int, values: Mapping[str, float]) -> None:
        self._run.log(dict(values), step=step)

    def close(self) -> None:
        self._run.finish()


def make_tracker(kind: str, weights: Path, settings: Mapping[str, Any]) -> Tracker:
    """Return what a training is to be watched in.

    Args:
        kind: one of `TRACKERS`.
        weights: file of the training's weights; event files go into a folder beside it.
        settings: of the training.

    Raises:
        ConfigError: another kind, or one that is not installed or does not start.
    """
    if kind not in TRACKERS:
        raise ConfigError("unknown tracker", got=kind, allowed=TRACKERS)
    try:
        if kind == "wandb":
            return WeightsAndBiases(weights.stem, settings)
        return TensorBoard(weights.parent / f"{weights.stem}-tensorboard")
    except ImportError as error:
        raise ConfigError(f"{kind} is not installed ({error})", allowed=f"pip install {kind}") from error
    except Exception as error:  # no network, no login: of many kinds
        raise ConfigError(f"{kind} does not start ({type(error).__name__}: {error})") from error
