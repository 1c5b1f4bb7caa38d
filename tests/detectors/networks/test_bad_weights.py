"""No weight file that makes no sense is used: one error names the file, what came and what is allowed."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import torch
from bad_weights import BAD_WEIGHTS, NETWORK, BadWeights, sound
from safetensors import safe_open
from safetensors.torch import load, save

from mpgrasp.bench.__main__ import main as bench
from mpgrasp.detectors.__main__ import main as detectors
from mpgrasp.detectors.networks.description import read_card
from mpgrasp.detectors.networks.input import NetworkInput
from mpgrasp.detectors.networks.registry import build_network
from mpgrasp.detectors.networks.state import entries, needed_entries
from mpgrasp.detectors.networks.weights import NetworkWeights, load_weights, save_weights
from mpgrasp.exceptions import WeightsError


@pytest.mark.parametrize("bad", BAD_WEIGHTS.values(), ids=BAD_WEIGHTS)
def test_a_bad_file_is_refused_by_name(bad: BadWeights, tmp_path: Path) -> None:
    path = bad.write(tmp_path)
    with pytest.raises(WeightsError) as refused:
        load_weights(bad.network, path)
    said = str(refused.value)
    assert re.search(bad.said, said, re.DOTALL), said
    assert str(path) in said
    assert "got" in said
    assert "allowed" in said
    assert len(said) < 1500
    assert "\n" not in said


def test_there_are_many_and_the_sound_one_is_taken(tmp_path: Path) -> None:
    assert len(BAD_WEIGHTS) >= 40
    path = tmp_path / "sound.safetensors"
    path.write_bytes(sound())
    assert load_weights(NETWORK, path).width_px == 112.0


@pytest.mark.parametrize("name", ["tensor-int64", "input-exbibytes", "truncated", "card-text"])
@pytest.mark.parametrize("command", ["card", "show", "bench"])
def test_every_command_ends_with_one_line_and_2(
    name: str, command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = BAD_WEIGHTS[name].write(tmp_path)
    given = ["--weights", str(path)]
    if command == "bench":
        out = tmp_path / "runs"
        code = bench(["thin", "--detector", NETWORK, "--episodes", "1", "--out", str(out), *given])
        assert not list(out.rglob("episodes.jsonl"))
    else:
        code = detectors([command, NETWORK, *given])
    said = capsys.readouterr()
    assert code == 2
    assert said.err.count("\n") == 1
    assert str(path) in said.err


@pytest.mark.parametrize("dtype", [torch.float16, torch.bfloat16])
def test_half_precision_is_taken_for_what_it_is(dtype: torch.dtype, tmp_path: Path) -> None:
    state = load(sound())
    halves = {key: v.to(dtype) if v.is_floating_point() else v for key, v in state.items()}
    with_metadata = tmp_path / "sound.safetensors"
    with_metadata.write_bytes(sound())
    with safe_open(with_metadata, framework="pt") as file:
        metadata = file.metadata()
    (tmp_path / "half.safetensors").write_bytes(save(halves, metadata))
    network = load_weights(NETWORK, tmp_path / "half.safetensors").network
    for key, value in network.state_dict().items():
        assert value.dtype == state[key].dtype
        assert torch.equal(value, halves[key].to(value.dtype))


@pytest.mark.parametrize("name", ["dhrnet", "tfgrasp", "ggcnn", "ggcnn2", "fcn", "fcn_residual", "unet"])
def test_what_a_network_needs_is_what_it_has_and_no_random_number_is_drawn(name: str) -> None:
    before = torch.get_rng_state()
    needed = needed_entries(name, {})
    assert torch.equal(torch.get_rng_state(), before)
    assert needed == entries(build_network(name, {}).state_dict())


def test_a_card_that_is_written_can_be_read(tmp_path: Path) -> None:
    """Figures that a short training could not give are NaN: a card says null then."""
    settings = {"channels": 1}
    weights = NetworkWeights(
        name="ggcnn2",
        network=build_network("ggcnn2", settings),
        settings=settings,
        card={"iou": float("nan"), "steps": 3},
    )
    save_weights(tmp_path / "w.safetensors", weights)
    assert read_card(tmp_path / "w.safetensors")["card"] == {"iou": None, "steps": 3}


@pytest.mark.parametrize(("name", "size", "unit"), [("ggcnn", 301, 12), ("ggcnn2", 226, 4)])
def test_images_that_a_network_would_not_keep_the_size_of_are_refused(
    name: str, size: int, unit: int, tmp_path: Path
) -> None:
    settings = {"channels": 1}
    network = build_network(name, settings)
    assert network(torch.zeros(1, 1, size, size))[0].shape[-1] != size
    weights = NetworkWeights(name=name, network=network, settings=settings, input=NetworkInput(size=size))
    save_weights(tmp_path / "w.safetensors", weights)
    with pytest.raises(WeightsError, match=f"does not keep; got {size}; allowed: multiples of {unit}"):
        load_weights(name, tmp_path / "w.safetensors")
