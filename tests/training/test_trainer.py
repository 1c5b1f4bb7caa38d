"""Laws of the trainer: losses fall, runs resume to the bit, budgets end."""

from __future__ import annotations

import csv
import hashlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
import torch
from toy_training import INPUT, SMALL, config, trainer

from mpgrasp.detectors.network_detector import NetworkDetector
from mpgrasp.detectors.networks.description import read_card
from mpgrasp.detectors.networks.input import NetworkInput
from mpgrasp.detectors.networks.weights import load_weights
from mpgrasp.exceptions import ConfigError, WeightsError
from mpgrasp.training.metrics import match_labels
from mpgrasp.training.progress import ProgressLog
from mpgrasp.training.trainer import Trainer


@pytest.fixture(autouse=True)
def _one_thread() -> None:
    torch.set_num_threads(1)


def test_training_learns_the_toy_set_and_its_weights_work(shards: Path, tmp_path: Path) -> None:
    run = trainer(
        shards, tmp_path / "w.safetensors", epochs=8.0, validate_every=1.0, average=0.95, augmentation=None
    )
    before = run.evaluate()["rectangle"]
    first = run.train_step(run.batches.draw(0))[0]
    best = run.run(ProgressLog(quiet=True))
    last = run.train_step(run.batches.draw(0))[0]
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
        hits.append(match_labels(*detector.grasp_arrays(truth.depth), truth).hit)
    assert np.mean(hits) == pytest.approx(best["hit"], abs=0.2)  # float32 here, bfloat16 there


def test_a_training_goes_on_from_a_file_and_its_card_says_from_which(shards: Path, tmp_path: Path) -> None:
    first = trainer(shards, tmp_path / "first.safetensors", average=0.0)
    first.run(ProgressLog(quiet=True))
    first.save()
    start = tmp_path / "first.safetensors"
    dataset = first.dataset
    second = Trainer(config(seed=5), dataset, tmp_path / "second.safetensors", start=start)
    begun = second.network.state_dict()
    assert all(torch.equal(begun[key], value) for key, value in first.average.items())
    assert all(torch.equal(second.average[key], value) for key, value in first.average.items())
    second.run(ProgressLog(quiet=True), stop_after=1)
    second.save()
    told = read_card(tmp_path / "second.safetensors")["card"]["start"]
    assert told["file"] == "first.safetensors"
    assert told["sha256"] == hashlib.sha256(start.read_bytes()).hexdigest()
    assert told["card"]["steps"] == first.step


def test_a_resumed_run_knows_what_it_began_with(shards: Path, tmp_path: Path) -> None:
    starts = []
    for seed in (0, 1):
        first = trainer(shards, tmp_path / f"first-{seed}.safetensors", seed=seed)
        first.save()
        starts.append(first.out)
    out, dataset = tmp_path / "second.safetensors", first.dataset
    begun = Trainer(config(), dataset, out, start=starts[0])
    begun.save_checkpoint()
    resumed = Trainer(config(), dataset, out)
    assert resumed.resume()
    assert resumed.start == begun.start is not None
    assert Trainer(config(), dataset, out, start=starts[0]).resume()
    with pytest.raises(WeightsError, match="began with other weights"):
        Trainer(config(), dataset, out, start=starts[1]).resume()


def test_weights_that_do_not_fit_are_not_gone_on_from(shards: Path, tmp_path: Path) -> None:
    first = trainer(shards, tmp_path / "first.safetensors")
    first.save()
    other = config(settings={**SMALL, "width": 16})
    with pytest.raises(WeightsError, match="other settings"):
        Trainer(other, first.dataset, tmp_path / "w.safetensors", start=tmp_path / "first.safetensors")


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
    state = resumed.network.state_dict()
    for key, value in whole.network.state_dict().items():
        assert torch.equal(value, state[key]), key
        assert torch.equal(whole.average[key], resumed.average[key]), key
    assert without_times(resumed.history) == without_times(whole.history)
    assert (tmp_path / "broken.csv").is_file()


@pytest.mark.parametrize(
    ("name", "settings"),
    [
        ("grconvnet", {"features": 4, "dropout": 0.5}),
        (
            "tfgrasp",
            {
                "size": INPUT.size,
                "embed": 8,
                "depths": [1, 1],
                "heads": [1, 2],
                "window": 4,
                "drop_path": 0.5,
            },
        ),
    ],
)
def test_what_a_network_drops_at_random_is_the_same_after_a_resume(
    name: str, settings: dict[str, object], shards: Path, tmp_path: Path
) -> None:
    ends = []
    for stops in ([None], [2, None]):
        for stop in stops:
            run = trainer(shards, tmp_path / f"{len(stops)}.safetensors", name=name, settings=settings)
            run.resume()
            torch.rand(len(stops))  # what others draw does not matter
            run.run(ProgressLog(quiet=True), stop_after=stop)
        ends.append(run.network.state_dict())
    assert all(torch.equal(value, ends[1][key]) for key, value in ends[0].items())


@pytest.mark.parametrize("name", ["lenz", "pinto"])
def test_networks_that_judge_windows_train_and_resume_like_all_others(
    name: str, shards: Path, tmp_path: Path
) -> None:
    small: dict[str, object] = {"size": INPUT.size, "stride": 16}
    small |= {"small": 4, "large": 4} if name == "lenz" else {"patch": 32, "side": 32, "widths": [4] * 5}
    changes = {"name": name, "settings": small, "validate_every": 1.0}
    whole = trainer(shards, tmp_path / "whole.safetensors", **changes)
    whole.run(ProgressLog(quiet=True))
    broken = trainer(shards, tmp_path / "broken.safetensors", **changes)
    broken.run(ProgressLog(quiet=True), stop_after=2)
    resumed = trainer(shards, tmp_path / "broken.safetensors", **changes)
    assert resumed.resume()
    resumed.run(ProgressLog(quiet=True))
    for key, value in whole.network.state_dict().items():
        assert torch.equal(value, resumed.network.state_dict()[key]), key
    first, last = whole.history[0], whole.history[-1]
    assert first["loss"] == first["pos"] > 0
    assert first["cos"] == first["sin"] == first["width"] == 0
    assert last["validation_loss"] > 0
    detector = NetworkDetector.load(name, tmp_path / "whole.safetensors", runtime="torch")
    assert detector.grasp_arrays(whole.dataset.sample(0).depth)[0].shape == (INPUT.size, INPUT.size)


def without_times(rows: list[dict[str, float]]) -> list[dict[str, float]]:
    return [{k: v for k, v in row.items() if k != "minutes"} for row in rows]


def test_a_run_that_is_told_to_stop_does_so_between_two_steps(shards: Path, tmp_path: Path) -> None:
    run = trainer(shards, tmp_path / "w.safetensors")

    class Impatient(ProgressLog):
        def update(self, progress: float, step: int, images: int, losses: Mapping[str, float]) -> None:
            run.stop()

    run.run(Impatient(quiet=True))
    assert run.step == 1
    again = trainer(shards, tmp_path / "w.safetensors")
    assert again.resume()
    assert again.step == 1


DIVERGED = r"the training diverged: {} at step \d+ is no longer finite; got '--lr .*; allowed: a lower --lr"


def test_a_loss_that_is_not_finite_ends_the_run_with_one_error(shards: Path, tmp_path: Path) -> None:
    run = trainer(shards, tmp_path / "w.safetensors")
    with torch.no_grad():
        next(run.network.parameters()).fill_(float("nan"))
    with pytest.raises(ConfigError, match=DIVERGED.format("the loss")):
        run.run(ProgressLog(quiet=True))


@pytest.mark.parametrize("lr", [1e6, 1e30])
def test_a_rate_that_is_far_too_high_is_said_to_be_and_leaves_no_weights(
    lr: float, shards: Path, tmp_path: Path
) -> None:
    run = trainer(shards, tmp_path / "w.safetensors", lr=lr, epochs=8.0, average=0.0)
    with pytest.raises(ConfigError, match=DIVERGED.format(".*")):
        run.run(ProgressLog(quiet=True))
    if (tmp_path / "w.safetensors").exists():
        load_weights("dhrnet", tmp_path / "w.safetensors")  # which takes none that are not finite


def test_outputs_that_are_not_finite_are_no_validation(shards: Path, tmp_path: Path) -> None:
    run = trainer(shards, tmp_path / "w.safetensors")
    for key, value in run.average.items():
        if key.endswith(".weight"):
            value.fill_(3e38)  # finite, but no product of two of them is
    with pytest.raises(ConfigError, match=DIVERGED.format("an output of the network")):
        run.evaluate()


def test_a_training_that_diverges_keeps_what_was_saved_before(shards: Path, tmp_path: Path) -> None:
    run = trainer(shards, tmp_path / "w.safetensors")
    run.run(ProgressLog(quiet=True), stop_after=2)
    run.save()
    good = run.checkpoint.read_bytes(), run.out.read_bytes()
    with torch.no_grad():
        next(run.network.parameters()).fill_(float("inf"))
    with pytest.raises(ConfigError, match=DIVERGED.format("a weight") + ".*kept from before: .*w.checkpoint"):
        run.save_checkpoint()
    assert (run.checkpoint.read_bytes(), run.out.read_bytes()) == good
    again = trainer(shards, tmp_path / "w.safetensors")
    assert again.resume()
    assert again.step == 2


def test_a_network_learns_from_colour_and_its_file_says_so(shards: Path, tmp_path: Path) -> None:
    image = NetworkInput(size=64, modality="rgbd", centre="median", scale=20.0)
    run = trainer(shards, tmp_path / "w.safetensors", input=image)
    run.run(ProgressLog(quiet=True))
    weights = load_weights("dhrnet", tmp_path / "w.safetensors")
    assert weights.input == image
    assert weights.settings["channels"] == 4
    rows = list(csv.DictReader((tmp_path / "w.csv").open()))
    assert [float(row["progress"]) for row in rows] == pytest.approx([0.5, 1.0], abs=0.1)
    assert float(rows[-1]["validation_loss"]) > 0
    assert float(rows[-1]["hit"]) == pytest.approx(run.history[-1]["hit"], abs=1e-4)
    assert (tmp_path / "w.png").read_bytes().startswith(b"\x89PNG")


def test_a_budget_of_minutes_anneals_and_ends(shards: Path, tmp_path: Path) -> None:
    run = trainer(shards, tmp_path / "w.safetensors", minutes=0.03, validate_every=1.0)
    run.run(ProgressLog(quiet=True))
    assert run.progress == 1.0
    assert run.elapsed < 10
    assert run.optimiser.param_groups[0]["lr"] < 0.5 * run.config.lr
    assert (tmp_path / "w.safetensors").is_file()


def test_the_global_random_state_is_left_alone(shards: Path, tmp_path: Path) -> None:
    torch.manual_seed(5)
    before = torch.random.get_rng_state()
    trainer(shards, tmp_path / "w.safetensors")
    assert torch.equal(before, torch.random.get_rng_state())
