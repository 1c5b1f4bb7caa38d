"""Laws of the loss."""

from __future__ import annotations

import torch
from toy_training import toy_sample

from mpgrasp.training.losses import grasp_loss
from mpgrasp.training.trainer_config import LossConfig


def test_perfect_heads_cost_nothing_and_invalid_pixels_never_count() -> None:
    sample = toy_sample(2)
    quality, angle, width = (torch.from_numpy(a)[None] for a in (sample.quality, sample.angle, sample.width))
    labelled = (quality > 0).float()
    heads = (
        quality[:, None],
        (torch.cos(2 * angle) * labelled)[:, None],
        (torch.sin(2 * angle) * labelled)[:, None],
        (width * labelled)[:, None],
    )
    valid = torch.ones_like(quality, dtype=torch.bool)
    assert float(grasp_loss(heads, quality, angle, width, valid, LossConfig())["loss"]) < 1e-10
    wrong = tuple(h + torch.where(torch.arange(64) < 10, 5.0, 0.0) for h in heads)
    valid[..., :10] = False
    assert float(grasp_loss(wrong, quality, angle, width, valid, LossConfig())["loss"]) < 1e-10  # type: ignore[arg-type]
    valid[:] = True
    assert float(grasp_loss(wrong, quality, angle, width, valid, LossConfig())["loss"]) > 0.1  # type: ignore[arg-type]
