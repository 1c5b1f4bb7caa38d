"""Laws of checkpoints: a run goes on from its own alone."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch
from toy_training import trainer

from mpgrasp.exceptions import WeightsError


@pytest.fixture(autouse=True)
def _one_thread() -> None:
    torch.set_num_threads(1)


def test_a_checkpoint_of_other_settings_is_refused_but_a_longer_budget_is_not(
    shards: Path, tmp_path: Path
) -> None:
    trainer(shards, tmp_path / "w.safetensors").save_checkpoint()
    with pytest.raises(WeightsError, match="another lr"):
        trainer(shards, tmp_path / "w.safetensors", lr=1e-4).resume()
    assert trainer(shards, tmp_path / "w.safetensors", epochs=3.0).resume()


def test_a_broken_checkpoint_is_a_weights_error(shards: Path, tmp_path: Path) -> None:
    run = trainer(shards, tmp_path / "w.safetensors")
    assert not run.resume()
    run.checkpoint.write_bytes(b"junk")
    with pytest.raises(WeightsError):
        run.resume()
