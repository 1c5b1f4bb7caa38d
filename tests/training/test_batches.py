"""Laws of the batches: every image its turn."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from toy_training import trainer


@pytest.fixture(autouse=True)
def _one_thread() -> None:
    torch.set_num_threads(1)


def test_every_epoch_deals_every_image_once(shards: Path, tmp_path: Path) -> None:
    run = trainer(shards, tmp_path / "w.safetensors", batch=7)
    images = run.dataset.training
    dealt = np.concatenate([run.batches.chosen(step) for step in range(3 * len(images))])
    first, second = dealt[: len(images)], dealt[len(images) : 2 * len(images)]
    assert np.array_equal(np.sort(first), images)
    assert np.array_equal(np.sort(second), images)
    assert not np.array_equal(first, second)


def test_thin_objects_are_dealt_as_often_as_their_weight_says(shards: Path, tmp_path: Path) -> None:
    run = trainer(shards, tmp_path / "w.safetensors", thin_weight=2.5)
    thin = run.dataset.column("thin")
    assert thin is not None
    members = run.dataset.training[thin[run.dataset.training] > 0.5]
    others = len(run.dataset.training) - len(members)
    assert 2 * len(members) + others <= len(run.batches) <= 3 * len(members) + others
    assert len(run.batches) - others == pytest.approx(2.5 * len(members), rel=0.2)
