"""Weights round-trip with all that is needed to use them, and nothing else is accepted."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch
from safetensors import safe_open
from safetensors.torch import load_file, save_file

from mpgrasp.detectors.networks.description import read_card
from mpgrasp.detectors.networks.input import NetworkInput
from mpgrasp.detectors.networks.registry import build_network
from mpgrasp.detectors.networks.weights import (
    NetworkWeights,
    load_weights,
    save_weights,
    width_unit,
)
from mpgrasp.exceptions import ConfigError, OutputError, WeightsError

SETTINGS = {"width": 4, "stem_width": 4, "head_width": 4, "blocks": 1, "channels": 3}
INPUT = NetworkInput(modality="rgb", centre="median", scale=20.0)


def small(name: str = "dhrnet") -> NetworkWeights:
    torch.manual_seed(0)
    settings = SETTINGS if name == "dhrnet" else {"channels": 3}
    return NetworkWeights(
        name=name,
        network=build_network(name, settings),
        settings=settings,
        input=INPUT,
        card={"seed": 0, "licence": "Apache-2.0"},
    )


@pytest.mark.parametrize("name", ["dhrnet", "ggcnn2"])
def test_weights_come_back_as_they_were_saved(name: str, tmp_path: Path) -> None:
    weights = small(name)
    save_weights(tmp_path / "deep" / "w.safetensors", weights)
    back = load_weights(name, tmp_path / "deep" / "w.safetensors")
    assert back.input == weights.input
    assert back.settings == weights.settings
    assert back.width_px == weights.width_px
    assert back.card == weights.card
    assert not back.network.training
    for key, value in weights.network.state_dict().items():
        assert torch.equal(back.network.state_dict()[key], value)
    assert read_card(tmp_path / "deep" / "w.safetensors")["network"] == name


@pytest.mark.parametrize(("name", "size"), [("ggcnn", 300), ("ggcnn2", 224)])
@pytest.mark.parametrize("suffix", ["pt", "pth"])
def test_published_state_dicts_load_unchanged(name: str, size: int, suffix: str, tmp_path: Path) -> None:
    network = build_network(name, {})
    torch.save(network.state_dict(), tmp_path / f"published.{suffix}")
    weights = load_weights(name, tmp_path / f"published.{suffix}")
    assert weights.name == name
    assert weights.settings["channels"] == 1
    assert weights.input == NetworkInput(size=size, centre="mean", clip=1.0, scale=1.0)
    assert weights.width_px == 150.0
    for key, value in network.state_dict().items():
        assert torch.equal(weights.network.state_dict()[key], value)


@pytest.mark.parametrize(("channels", "modality"), [(1, "d"), (3, "rgb"), (4, "rgbd")])
@pytest.mark.parametrize("settings", [{}, {"features": 8}])
def test_a_published_state_dict_tells_its_modality_and_its_width(
    channels: int, modality: str, settings: dict[str, int], tmp_path: Path
) -> None:
    network = build_network("grconvnet", {"channels": channels, **settings})
    torch.save(network.state_dict(), tmp_path / "published.pt")
    weights = load_weights("grconvnet", tmp_path / "published.pt")
    assert weights.input.modality == modality
    assert weights.settings == {"channels": channels, "features": settings.get("features", 32)}
    x = torch.randn(1, channels, 32, 32)
    with torch.inference_mode():
        assert torch.equal(torch.cat(weights.network(x)), torch.cat(network.eval()(x)))


def test_a_published_state_dict_for_images_of_two_channels_is_refused(tmp_path: Path) -> None:
    torch.save(build_network("grconvnet", {"channels": 2}).state_dict(), tmp_path / "published.pt")
    with pytest.raises(WeightsError, match="2 channels"):
        load_weights("grconvnet", tmp_path / "published.pt")


@pytest.mark.parametrize(("name", "right"), [("ggcnn", "ggcnn2"), ("ggcnn2", "ggcnn")])
def test_published_state_dicts_under_the_wrong_name_are_told_the_right_one(
    name: str, right: str, tmp_path: Path
) -> None:
    torch.save(build_network(right, {}).state_dict(), tmp_path / "published.pt")
    with pytest.raises(WeightsError, match=f"weights of {right}, not of {name};.*allowed: as {right}$"):
        load_weights(name, tmp_path / "published.pt")


@pytest.mark.parametrize("name", ["dhrnet", "fcn", "unet"])
def test_other_networks_read_no_pickles(name: str, tmp_path: Path) -> None:
    torch.save(build_network("ggcnn", {}).state_dict(), tmp_path / "published.pt")
    with pytest.raises(WeightsError, match=f"{name} reads safetensors only"):
        load_weights(name, tmp_path / "published.pt")


@pytest.mark.parametrize("name", ["dhrnet", "ggcnn2"])
def test_shipped_weights_say_what_they_are(name: str) -> None:
    weights = load_weights(name)
    assert weights.name == name
    assert weights.card["licence"] == "Apache-2.0"
    assert weights.width_px == width_unit(weights.input.size)


@pytest.mark.parametrize(("size", "unit"), [(224, 112.0), (300, 150.0)])
def test_a_width_of_one_is_half_the_image(size: int, unit: float) -> None:
    assert width_unit(size) == unit


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(WeightsError, match=r"no such weights file.*gone"):
        load_weights("dhrnet", tmp_path / "gone.safetensors")


@pytest.mark.parametrize("name", ["w.safetensors", "w.pt", "w.pth"])
@pytest.mark.parametrize("content", [b"", b"\x00" * 40, b"not weights at all, just text"])
def test_rubbish_is_a_weights_error(name: str, content: bytes, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(WeightsError):
        load_weights("ggcnn", tmp_path / name)


def test_a_truncated_file_is_a_weights_error(tmp_path: Path) -> None:
    save_weights(tmp_path / "w.safetensors", small())
    whole = (tmp_path / "w.safetensors").read_bytes()
    (tmp_path / "w.safetensors").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(WeightsError):
        load_weights("dhrnet", tmp_path / "w.safetensors")


def test_foreign_safetensors_are_refused(tmp_path: Path) -> None:
    save_file({"layer.weight": torch.zeros(3)}, tmp_path / "w.safetensors")
    with pytest.raises(WeightsError, match="not a weights file"):
        load_weights("dhrnet", tmp_path / "w.safetensors")


def test_another_network_s_weights_are_refused(tmp_path: Path) -> None:
    save_weights(tmp_path / "w.safetensors", small("ggcnn2"))
    with pytest.raises(WeightsError, match="another network"):
        load_weights("dhrnet", tmp_path / "w.safetensors")


def test_a_state_dict_of_another_shape_names_the_first_entry_that_differs(tmp_path: Path) -> None:
    state = build_network("ggcnn", {}).state_dict()
    state["pos_output.bias"] = torch.zeros(7)
    torch.save(state, tmp_path / "w.pt")
    with pytest.raises(WeightsError, match=r"pos_output\.bias"):
        load_weights("ggcnn", tmp_path / "w.pt")


def test_channels_that_the_input_does_not_give_are_refused(tmp_path: Path) -> None:
    weights = NetworkWeights(
        name="dhrnet", network=small().network, settings=SETTINGS, input=NetworkInput(modality="rgbd")
    )
    save_weights(tmp_path / "w.safetensors", weights)
    with pytest.raises(WeightsError, match="channels"):
        load_weights("dhrnet", tmp_path / "w.safetensors")


def test_images_of_a_size_that_the_network_is_not_laid_out_for_are_refused(tmp_path: Path) -> None:
    settings = {"size": 64, "embed": 8, "window": 2}
    weights = NetworkWeights(
        name="tfgrasp", network=build_network("tfgrasp", settings), settings=settings, input=NetworkInput()
    )
    save_weights(tmp_path / "w.safetensors", weights)
    with pytest.raises(WeightsError, match="another size; got 64; allowed: 224"):
        load_weights("tfgrasp", tmp_path / "w.safetensors")


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("width_px", "0"),
        ("width_px", "NaN"),
        ("width_px", '"wide"'),
        ("width_px", "null"),
        ("settings", "[1]"),
        ("settings", '{"channels": "three"}'),
        ("input", '{"size": 3}'),
        ("input", '{"smell": 1}'),
        ("card", "{"),
    ],
)
def test_a_description_that_makes_no_sense_is_a_weights_error(key: str, value: str, tmp_path: Path) -> None:
    save_weights(tmp_path / "w.safetensors", small())
    with safe_open(tmp_path / "w.safetensors", framework="pt") as file:
        metadata = {**file.metadata(), key: value}
    save_file(load_file(tmp_path / "w.safetensors"), tmp_path / "odd.safetensors", metadata=metadata)
    with pytest.raises(WeightsError):
        load_weights("dhrnet", tmp_path / "odd.safetensors")


def test_weights_that_are_not_finite_are_refused(tmp_path: Path) -> None:
    weights = small()
    state = dict(weights.network.state_dict())
    state["pos_output.bias"] = torch.tensor([float("nan")])
    save_weights(tmp_path / "w.safetensors", weights, state)
    with pytest.raises(WeightsError, match="not finite"):
        load_weights("dhrnet", tmp_path / "w.safetensors")


def test_a_pickle_that_would_run_code_does_not(tmp_path: Path) -> None:
    class Evil:
        def __reduce__(self) -> tuple[object, tuple[Path]]:
            return Path.touch, (tmp_path / "ran",)

    torch.save({"conv1.weight": Evil()}, tmp_path / "w.pt")
    with pytest.raises(WeightsError):
        load_weights("ggcnn", tmp_path / "w.pt")
    assert not (tmp_path / "ran").exists()


def test_a_place_that_cannot_be_written_is_an_output_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(OutputError):
        save_weights(tmp_path / "file" / "w.safetensors", small())


def test_unknown_networks_and_settings_are_config_errors() -> None:
    with pytest.raises(ConfigError, match="unknown network"):
        build_network("resnet", {})
    with pytest.raises(ConfigError, match="unknown network"):
        load_weights("resnet")
    with pytest.raises(ConfigError, match="unusable settings"):
        build_network("dhrnet", {"depth": 3})
