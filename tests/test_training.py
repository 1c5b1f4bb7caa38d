"""Laws of the training: labels move with their images, losses fall, runs resume, bad input is one line."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import torch
from toy_shards import toy_image, write_shards

from mpgrasp.detectors.network_detector import NetworkDetector, postprocess
from mpgrasp.detectors.network_input import NetworkInput
from mpgrasp.detectors.weights import WIDTH_PX, read_card
from mpgrasp.exceptions import ConfigError, WeightsError
from mpgrasp.geometry import line_angle_difference
from mpgrasp.training.__main__ import main
from mpgrasp.training.augmentation import Augmentation, Sample, augment, warp
from mpgrasp.training.dataset import GraspDataset
from mpgrasp.training.labels import decode_angle, decode_depth
from mpgrasp.training.losses import grasp_loss
from mpgrasp.training.metrics import judge
from mpgrasp.training.progress import ProgressLog
from mpgrasp.training.trainer import Trainer
from mpgrasp.training.trainer_config import LossConfig, TrainConfig

SMALL = {"width": 8, "stem_width": 8, "head_width": 8, "blocks": 1, "fine_head": False}


@pytest.fixture(scope="module")
def shards(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_shards(tmp_path_factory.mktemp("shards"), shards=2, images=40)


@pytest.fixture(autouse=True)
def _one_thread() -> None:
    torch.set_num_threads(1)


def config(**changes: object) -> TrainConfig:
    settings = {"name": "dhrnet", "settings": SMALL, "batch": 8, "lr": 5e-3, "epochs": 1.0, "holdout": 0.25}
    return TrainConfig(**{**settings, **changes})  # type: ignore[arg-type]


def trainer(shards: Path, out: Path, **changes: object) -> Trainer:
    settings = config(**changes)
    return Trainer(settings, GraspDataset([shards], holdout=settings.holdout), out)


def toy_sample(seed: int = 0) -> Sample:
    toy = toy_image(np.random.default_rng(seed))
    return Sample(
        depth=np.nan_to_num(decode_depth(toy["depth"]), nan=0.4),
        quality=(toy["quality"] / 255).astype(np.float32),
        angle=decode_angle(toy["angle"]),
        width=toy["width"].astype(np.float32),
        valid=np.ones(toy["depth"].shape, bool),
    )


def bar_s_closing_direction(sample: Sample) -> float:
    """From the labelled pixels' second moments: across the bar's long axis."""
    rows, cols = np.nonzero(sample.quality * sample.valid > 0)
    _, axes = np.linalg.eigh(np.cov(cols, -rows))
    return float(np.arctan2(axes[1, 0], axes[0, 0]))  # the shorter axis, counter-clockwise on screen


@pytest.mark.parametrize("seed", range(12))
def test_augmented_angles_still_point_across_the_bar(seed: int) -> None:
    moved = augment(toy_sample(seed), Augmentation(warp_probability=1.0), np.random.default_rng(seed))
    labelled = (moved.quality > 0) & moved.valid
    across = bar_s_closing_direction(moved)
    assert line_angle_difference(moved.angle[labelled], across).max() < np.deg2rad(6)


@pytest.mark.parametrize("zoom", [0.8, 1.3])
def test_zoom_scales_widths_and_keeps_heights(zoom: float) -> None:
    sample = toy_sample(3)
    moved = warp(sample, 0.2, zoom)
    labelled = (moved.quality > 0) & moved.valid
    assert labelled.sum() == pytest.approx((sample.quality > 0).sum() * zoom**2, rel=0.15)
    assert np.allclose(moved.width[labelled], sample.width.max() * zoom)
    assert np.median(moved.depth) == pytest.approx(np.median(sample.depth) / zoom, abs=2e-3)
    before = np.median(sample.depth[sample.quality > 0]) - np.median(sample.depth)
    after = np.median(moved.depth[labelled]) - np.median(moved.depth[moved.valid])
    assert after == pytest.approx(before, abs=2e-3)


def test_quarter_turns_of_a_label_bring_it_back() -> None:
    sample = toy_sample(1)
    back = sample
    for _ in range(4):
        back = warp(back, np.pi / 2, 1.0)
    assert np.array_equal(back.quality, sample.quality)
    labelled = sample.quality > 0
    assert line_angle_difference(back.angle[labelled], sample.angle[labelled]).max() < 1e-5


def test_shards_are_read_with_holes_filled_and_scenes_kept_apart(shards: Path) -> None:
    dataset = GraspDataset([shards], holdout=0.25)
    assert len(dataset) == 80
    assert np.array_equal(np.sort(np.concatenate([dataset.training, dataset.held])), np.arange(80))
    scenes = dataset.column("scene")
    assert scenes is not None
    assert not set(scenes[dataset.training]) & set(scenes[dataset.held])
    batch = dataset.batch([0, 5], NetworkInput(size=64, scale=20.0, range_channel=True))
    assert batch.image.shape == (2, 2, 64, 64)
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


@pytest.mark.parametrize(
    ("turn", "widen", "hit", "rectangle"),
    [(0.0, 1.0, True, True), (0.4, 1.0, True, True), (0.6, 1.0, False, False), (0.0, 0.7, False, True)],
)
def test_verdict_follows_angle_and_opening(turn: float, widen: float, hit: bool, rectangle: bool) -> None:
    truth = toy_sample(4)
    verdict = judge(truth.quality, truth.angle + np.float32(turn), truth.width * np.float32(widen), truth)
    assert (verdict.hit, verdict.rectangle) == (hit, rectangle)


def test_a_grasp_beside_the_object_is_no_hit() -> None:
    truth = toy_sample(4)
    quality = np.zeros_like(truth.quality)
    quality[1, 1] = 1.0
    assert not judge(quality, truth.angle, truth.width, truth).hit


def test_training_learns_the_toy_set_and_its_weights_work(shards: Path, tmp_path: Path) -> None:
    run = trainer(
        shards, tmp_path / "w.safetensors", epochs=12.0, validate_every=0.5, average=0.95, augmentation=None
    )
    before = run.evaluate()["rectangle"]
    first = run.train_step(run._draw(0))["loss"]
    best = run.run(ProgressLog(quiet=True))
    last = run.train_step(run._draw(0))["loss"]
    assert last < 0.4 * first
    assert best["rectangle"] > before + 0.3
    card = read_card(tmp_path / "w.safetensors")["card"]
    assert card["seed"] == 0
    assert card["validation"]["hit"] == pytest.approx(best["hit"], abs=1e-3)
    assert card["licence"]
    detector = NetworkDetector.load("dhrnet", tmp_path / "w.safetensors")
    hits = []
    for i in run.dataset.held:
        truth = run.dataset.sample(int(i))
        hits.append(judge(*detector.grasp_arrays(truth.depth), truth).hit)
    assert np.mean(hits) == pytest.approx(best["hit"], abs=0.2)  # float32 here, bfloat16 there


def test_a_resumed_run_is_the_same_as_an_unbroken_one(shards: Path, tmp_path: Path) -> None:
    whole = trainer(shards, tmp_path / "whole.safetensors")
    whole.run(ProgressLog(quiet=True))
    broken = trainer(shards, tmp_path / "broken.safetensors")
    broken.run(ProgressLog(quiet=True), stop_after=3)
    resumed = trainer(shards, tmp_path / "broken.safetensors")
    assert resumed.resume()
    assert resumed.step == 3
    resumed.run(ProgressLog(quiet=True))
    assert resumed.step == whole.step
    for key, value in whole.average.items():
        assert torch.equal(value, resumed.average[key]), key


def test_a_budget_of_minutes_anneals_and_ends(shards: Path, tmp_path: Path) -> None:
    run = trainer(shards, tmp_path / "w.safetensors", minutes=0.03, validate_every=1.0)
    run.run(ProgressLog(quiet=True))
    assert run.progress == 1.0
    assert run.elapsed < 10
    assert run.optimiser.param_groups[0]["lr"] < 0.5 * run.config.lr
    assert (tmp_path / "w.safetensors").is_file()


def test_a_broken_checkpoint_is_a_weights_error(shards: Path, tmp_path: Path) -> None:
    run = trainer(shards, tmp_path / "w.safetensors")
    assert not run.resume()
    run.checkpoint.write_bytes(b"junk")
    with pytest.raises(WeightsError):
        run.resume()


def test_the_global_random_state_is_left_alone(shards: Path, tmp_path: Path) -> None:
    torch.manual_seed(5)
    before = torch.random.get_rng_state()
    trainer(shards, tmp_path / "w.safetensors")
    assert torch.equal(before, torch.random.get_rng_state())


def test_doubled_angles_survive_the_wrap() -> None:
    theta = np.where(np.indices((40, 40))[1] < 20, np.pi / 2 - 0.01, -np.pi / 2 + 0.01)
    heads = np.stack([np.ones((40, 40)), np.cos(2 * theta), np.sin(2 * theta), np.ones((40, 40))])
    _, angle, width = postprocess(heads.astype(np.float32), WIDTH_PX)
    assert line_angle_difference(angle, np.pi / 2).max() < 0.02
    assert np.allclose(width, WIDTH_PX, rtol=1e-5)


@pytest.mark.parametrize(
    "bad",
    [
        ["train", "resnet", "--data", "DATA"],
        ["train", "dhrnet", "--data", "nowhere"],
        ["train", "dhrnet", "--data", "DATA", "--epochs", "0"],
        ["train", "dhrnet", "--data", "DATA", "--settings", "{width}"],
        ["train", "dhrnet", "--data", "DATA", "--settings", '{"depth": 1}'],
        ["train", "dhrnet", "--data", "DATA", "--threads", "0"],
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(
    bad: list[str], shards: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    argv = [str(shards) if word == "DATA" else word for word in bad]
    assert main([*argv, "--out", str(tmp_path / "w.safetensors")]) == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1


def test_shards_of_another_format_are_one_clear_error(tmp_path: Path) -> None:
    (tmp_path / "meta.json").write_text(json.dumps({"meta_columns": ["a"]}))
    (tmp_path / "shard_00000.npz").write_bytes(b"not a zip")
    with pytest.raises(ConfigError, match="unreadable shard"):
        GraspDataset([tmp_path])
    np.savez(tmp_path / "shard_00000.npz", depth=np.zeros((1, 8, 8)))
    with pytest.raises(ConfigError, match="unreadable shard"):
        GraspDataset([tmp_path])


def test_the_command_trains_and_reports(shards: Path, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "mpgrasp.training", "train", "dhrnet", "--data", str(shards), "--epochs"]
    command += ["1", "--batch", "16", "--settings", json.dumps(SMALL), "--threads", "1", "--out"]
    done = subprocess.run(
        [*command, str(tmp_path / "w.safetensors")], capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["steps"] >= 1
    assert "validation" in done.stderr
    assert (tmp_path / "w.safetensors").is_file()
