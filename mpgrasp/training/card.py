"""The training card: what a weights file says about how it was made."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import torch

from mpgrasp.training.validation import SELECT_BY

if TYPE_CHECKING:
    from mpgrasp.training.trainer import Trainer

LICENCE = "Apache-2.0"


def training_card(run: Trainer) -> dict[str, Any]:
    """Command, data with their verification, seed, steps, time, settings, metrics, licence."""
    config = run.config
    return {
        "command": run.command,
        "data": run.dataset.description(),
        "validation_data": run.validation.description(),
        "training_images": len(run.dataset.training),
        "training_scenes": run.dataset.scene_count,
        "images_seen": run.step * config.batch,
        "steps": run.step,
        "minutes": round(run.elapsed / 60, 1),
        "device": run.device.type,
        "threads": torch.get_num_threads(),
        "torch": torch.__version__,
        "seed": config.seed,
        "parameters": run.parameters,
        "optimiser": f"AdamW, lr {config.lr:g} {config.schedule}, weight decay {config.weight_decay:g}",
        "config": {k: v for k, v in asdict(config).items() if k not in ("name", "settings", "input")},
        "selected_by": SELECT_BY,
        "validation": {k: round(v, 4) for k, v in run.best.items()},
        "licence": LICENCE,
    }
