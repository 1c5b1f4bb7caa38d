"""The training card: how a weights file was made, as the file itself tells it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import torch

from mpgrasp.training.trainer_config import TrainConfig
from mpgrasp.training.validation import selected_by

LICENCE = "Apache-2.0"


@dataclass(frozen=True, kw_only=True)
class TrainingRecord:
    """Facts of a training, whoever did it."""

    command: str
    """That can be typed to do it again."""
    config: TrainConfig
    data: Sequence[Mapping[str, Any]]
    """Descriptions of the data sets."""
    validation_data: Sequence[Mapping[str, Any]]
    """Descriptions of the data sets that chose the weights."""
    training_images: int
    training_scenes: int
    steps: int
    """Steps of the optimiser."""
    elapsed: float
    """Wall-clock time [s]."""
    start: Mapping[str, Any] | None = None
    """Weights that it went on from: file, SHA-256 and their card; None: random ones."""
    device: str
    """cpu or cuda."""
    parameters: int
    """Number of the network's parameters."""
    best: Mapping[str, float]
    """Validation figures of the weights that were kept."""

    def card(self) -> dict[str, Any]:
        """Return command, data with their verification, seed, steps, time, settings, metrics, licence."""
        config = self.config
        return {
            "command": self.command,
            **({"start": self.start} if self.start else {}),
            "data": self.data,
            "validation_data": self.validation_data,
            "training_images": self.training_images,
            "training_scenes": self.training_scenes,
            "images_seen": self.steps * config.batch,
            "steps": self.steps,
            "minutes": round(self.elapsed / 60, 1),
            "device": self.device,
            "threads": torch.get_num_threads(),
            "torch": torch.__version__,
            "seed": config.seed,
            "parameters": self.parameters,
            "optimiser": f"AdamW, lr {config.lr:g} {config.schedule}, weight decay {config.weight_decay:g}",
            "config": {k: v for k, v in asdict(config).items() if k not in ("name", "settings", "input")},
            "selected_by": selected_by(self.config.name),
            "validation": {k: round(v, 4) for k, v in self.best.items()},
            "licence": LICENCE,
        }
