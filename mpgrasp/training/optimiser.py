"""AdamW as the paper trains with it, its learning rate over a run, and the running average of the weights."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import torch
from torch import Tensor, nn

from mpgrasp.training.trainer_config import TrainConfig

WARM_UP = 0.03
"""Share of the budget over which the learning rate rises."""
FLOOR = 0.01
"""Learning rate at the end, as a share of the highest."""


def make_optimiser(network: nn.Module, config: TrainConfig) -> torch.optim.Optimizer:
    """Return an AdamW that decays weights alone: no biases, normalisations or relative positions."""
    return torch.optim.AdamW(_parameter_groups(network, config.weight_decay), lr=config.lr, fused=True)


def _parameter_groups(network: nn.Module, weight_decay: float) -> list[dict[str, Any]]:
    named = list(network.named_parameters())
    free = {name for name, p in named if p.ndim < 2 or name.endswith("bias")}
    return [
        {"params": [p for name, p in named if name not in free], "weight_decay": weight_decay},
        {"params": [p for name, p in named if name in free], "weight_decay": 0.0},
    ]


def rate_at(progress: float, schedule: str) -> float:
    """Return the learning rate, as a share of the highest, when `progress` of the budget is spent."""
    if progress < WARM_UP:
        return max(progress / WARM_UP, 0.01)
    if schedule == "constant":
        return 1.0
    phase = (progress - WARM_UP) / (1 - WARM_UP)
    return FLOOR + (1 - FLOOR) * 0.5 * (1 + math.cos(math.pi * phase))


@torch.no_grad()
def update_average(average: Mapping[str, Tensor], network: nn.Module, decay: float, step: int) -> None:
    """Move an average of the weights, in place, towards the network's after its step number `step`."""
    # young averages forget faster, so that the initial weights are soon gone
    decay = min(decay, step / (step + 10)) if decay else 0.0
    state = network.state_dict()
    moving = [key for key, value in state.items() if value.is_floating_point()]
    torch._foreach_lerp_([average[k] for k in moving], [state[k] for k in moving], 1 - decay)
    for key in state.keys() - moving:
        average[key].copy_(state[key])
