"""Laws of shards in memory: scenes stay apart, later shards join, what cannot be read is one error."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from toy_shards import write_shards

from mpgrasp.detectors.networks.input import NetworkInput
from mpgrasp.exceptions import ConfigError
from mpgrasp.training.data.shards import FORMAT
from mpgrasp.training.dataset import GraspDataset


def test_shards_are_read_with_holes_filled_and_scenes_kept_apart(shards: Path) -> None:
    dataset = GraspDataset([shards], holdout=0.25)
    assert len(dataset) == 80
    assert np.array_equal(np.sort(np.concatenate([dataset.training, dataset.held])), np.arange(80))
    scenes = dataset.column("scene")
    assert scenes is not None
    assert not set(scenes[dataset.training]) & set(scenes[dataset.held])
    batch = dataset.batch([0, 5], NetworkInput(size=64, scale=20.0))
    assert batch.image.shape == (2, 1, 64, 64)
    assert np.isfinite(batch.image).all()
    assert dataset.sample(0).depth.min() > 0.3


def test_shards_that_come_later_join_without_moving_the_held_out(tmp_path: Path) -> None:
    write_shards(tmp_path, shards=1, images=20)
    dataset = GraspDataset([tmp_path], holdout=0.25)
    held = dataset.held.copy()
    assert dataset.refresh() == 0
    write_shards(tmp_path, shards=2, images=20)
    assert dataset.refresh() == 1
    assert len(dataset) == 40
    assert np.array_equal(dataset.held[: len(held)], held)


def test_fewer_images_are_the_first_ones_and_the_held_out_stay(shards: Path) -> None:
    every, few = GraspDataset([shards], holdout=0.25), GraspDataset([shards], holdout=0.25, images=10)
    assert np.array_equal(few.training, every.training[:10])
    assert np.array_equal(few.held, every.held)


def test_shards_of_another_format_are_one_clear_error(tmp_path: Path) -> None:
    (tmp_path / "shard_00000.npz").write_bytes(b"not a zip")
    # before 3 the objects of suites were not kept out: a seed meant other scenes
    for told in ({"format": 1}, {"format": 2, "meta_columns": ["a"]}, {"format": FORMAT + 1}, {}):
        (tmp_path / "meta.json").write_text(json.dumps(told))
        with pytest.raises(ConfigError, match=f"another format.*allowed: {FORMAT}"):
            GraspDataset([tmp_path])
    (tmp_path / "meta.json").write_text(json.dumps({"format": FORMAT, "meta_columns": ["a"]}))
    with pytest.raises(ConfigError, match="unreadable shard"):
        GraspDataset([tmp_path])
    np.savez(tmp_path / "shard_00000.npz", depth=np.zeros((1, 8, 8)))
    with pytest.raises(ConfigError, match="unreadable shard"):
        GraspDataset([tmp_path])


def test_colour_that_is_not_there_is_one_clear_error(shards: Path, tmp_path: Path) -> None:
    (tmp_path / "meta.json").write_text((shards / "meta.json").read_text())
    with np.load(shards / "shard_00000.npz") as file:
        np.savez(tmp_path / "shard_00000.npz", **{k: file[k] for k in file if k != "rgb"})
    assert GraspDataset([tmp_path]).sample(0).rgb is None
    with pytest.raises(ConfigError, match="without colour"):
        GraspDataset([tmp_path], colour=True)


def test_the_card_tells_how_often_the_labels_lifted(shards: Path, tmp_path: Path) -> None:
    told = json.loads((shards / "meta.json").read_text())
    told["trial_columns"] = ["scene", "positive", "audit", "lifted"]
    (tmp_path / "meta.json").write_text(json.dumps(told))
    trials = [(0, 1, 0, 1), (0, 1, 0, 0), (0, 0, 0, 0), (0, 1, 1, 1), (0, 1, 1, 1)]
    with np.load(shards / "shard_00000.npz") as file:
        for k in range(2):
            np.savez(tmp_path / f"shard_{k:05d}.npz", **file, trials=np.array(trials, np.float32))
    (about,) = GraspDataset([tmp_path]).description()
    counts = {"analytic_positives": [2, 4], "analytic_negatives": [0, 2], "shipped_positives": [4, 4]}
    assert about["lifts"] == counts
    (plain,) = GraspDataset([shards]).description()
    assert "lifts" not in plain
