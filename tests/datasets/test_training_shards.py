"""Laws of datasets as training shards: labels lie in the middle of rectangles, and networks learn them."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from toy_datasets import write_cornell, write_jacquard
from toy_training import INPUT, SMALL

from mpgrasp.datasets.cornell import Cornell
from mpgrasp.datasets.jacquard import Jacquard
from mpgrasp.datasets.reader import Skipped, usable
from mpgrasp.datasets.training_shards import CORE, dense_labels, write_training_shards
from mpgrasp.detectors.network_detector import NetworkDetector
from mpgrasp.evaluate.predict import square
from mpgrasp.evaluate.scores import rates, score
from mpgrasp.exceptions import ConfigError
from mpgrasp.grasp import GraspRectangle
from mpgrasp.training.data.labels import decode_angle
from mpgrasp.training.dataset import GraspDataset
from mpgrasp.training.progress import ProgressLog
from mpgrasp.training.trainer import Trainer
from mpgrasp.training.trainer_config import TrainConfig


def test_the_middle_third_of_a_rectangle_is_labelled_and_nothing_else() -> None:
    rectangle = GraspRectangle(u=60.0, v=40.0, angle=0.5, width_px=60.0, jaw_px=24.0)
    quality, angle, width = dense_labels([rectangle], 100)
    v, u = np.indices(quality.shape, float)
    along = (u - 60) * np.cos(0.5) - (v - 40) * np.sin(0.5)
    across = (u - 60) * np.sin(0.5) + (v - 40) * np.cos(0.5)
    inside = (np.abs(along) < 0.5 * CORE * 60 - 1) & (np.abs(across) < 12 - 1)
    outside = (np.abs(along) > 0.5 * CORE * 60 + 1.5) | (np.abs(across) > 12 + 1.5)
    assert inside.sum() > 200
    assert (quality[inside] == 255).all()
    assert not quality[outside].any()
    assert (width[inside] == 60).all()
    assert np.abs(decode_angle(angle)[inside] - 0.5).max() < 0.01
    assert np.abs(decode_angle(angle)[outside]).max() == 0


@pytest.mark.parametrize("kind", ["cornell", "jacquard"])
def test_a_network_learns_a_dataset_by_heart(kind: str, tmp_path: Path) -> None:
    torch.set_num_threads(1)
    reader = (
        Cornell(write_cornell(tmp_path / "d", 4))
        if kind == "cornell"
        else Jacquard(write_jacquard(tmp_path / "d", 4))
    )
    squares = [square(image, 300.0, INPUT.size) for image in usable(reader, Skipped())]
    assert write_training_shards((seen.image for seen in squares), tmp_path / "set", "toys") == 4
    assert json.loads((tmp_path / "set" / "meta.json").read_text())["colour"] is True
    config = TrainConfig(
        name="dhrnet", settings=SMALL, input=INPUT, epochs=120.0, batch=4, lr=5e-3, lift_images=0,
        holdout=0.0, augmentation=None, precision="float32", average=0.9, validate_every=1.0,
    )  # fmt: skip
    data = GraspDataset([tmp_path / "set"], holdout=0.0)
    trainer = Trainer(config, data, tmp_path / "w.safetensors", data)
    trainer.run(ProgressLog(quiet=True))
    detector = NetworkDetector.load("dhrnet", tmp_path / "w.safetensors", runtime="torch")
    rows = [row for seen in squares for row in score({"it": detector}, seen)]
    assert rates(rows, "it")["top1"].count == 4


def test_images_with_and_without_colour_do_not_go_together(tmp_path: Path) -> None:
    images = [square(image, 300.0, 64).image for image in usable(Cornell(write_cornell(tmp_path)), Skipped())]
    with pytest.raises(ConfigError, match="some images have colour"):
        write_training_shards([images[0], replace(images[1], rgb=None)], tmp_path / "set", "toys")
    assert not (tmp_path / "set" / "meta.json").exists(), "what is not whole is not described"
