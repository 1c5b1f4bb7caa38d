"""Weights round-trip with all that is needed to use them, and nothing else is accepted."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch
from safetensors.torch import save_file

from mpgrasp.detectors.network_input import NetworkInput
from mpgrasp.detectors.weights import (
    NetworkWeights,
    build_network,
    load_weights,
    read_card,
    save_weights,
)
from mpgrasp.exceptions import ConfigError, OutputError, WeightsError

SETTINGS = {"width": 4, "stem_width": 4, "head_width": 4, "blocks": 1, "channels": 2}
INPUT = NetworkInput(centre="median", scale=20.0, range_channel=True)


def small(name: str = "dhrnet") -> NetworkWeights:
    torch.manual_seed(0)
    settings = SETTINGS if name == "dhrnet" else {"channels": 2}
    return NetworkWeights(
        name=name,
        network=build_network(name, settings),
        settings=settings,
        input=INPUT,
        card={"seed": 0, "licence": "Apache-2.0"},
    )


@pytest.mark.parametrize("name", ["dhrnet", "ggcnn"])
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


@pytest.mark.parametrize(("variant", "size"), [(1, 300), (2, 224)])
def test_published_state_dicts_load_unchanged(variant: int, size: int, tmp_path: Path) -> None:
    network = build_network("ggcnn", {"variant": variant})
    torch.save(network.state_dict(), tmp_path / "published.pt")
    weights = load_weights("ggcnn", tmp_path / "published.pt")
    assert weights.settings == {"variant": variant}
    assert weights.input == NetworkInput(size=size, centre="mean", clip=1.0, scale=1.0, range_channel=False)
    assert weights.width_px == 150.0
    for key, value in network.state_dict().items():
        assert torch.equal(weights.network.state_dict()[key], value)


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
    save_weights(tmp_path / "w.safetensors", small("ggcnn"))
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
        name="dhrnet", network=small().network, settings=SETTINGS, input=NetworkInput(range_channel=False)
    )
    save_weights(tmp_path / "w.safetensors", weights)
    with pytest.raises(WeightsError, match="channels"):
        load_weights("dhrnet", tmp_path / "w.safetensors")


def test_weights_that_are_not_finite_are_refused(tmp_path: Path) -> None:
    weights = small()
    state = dict(weights.network.state_dict())
    state["pos_output.bias"] = torch.tensor([float("nan")])
    save_weights(tmp_path / "w.safetensors", weights, state)
    with pytest.raises(WeightsError, match="not finite"):
        load_weights("dhrnet", tmp_path / "w.safetensors")


def test_a_pickle_that_would_run_code_does_not(tmp_path: Path) -> None:
    class Evil:
        def __reduce__(self) -> tuple:
            return (Path.touch, (tmp_path / "ran",))

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
    with pytest.raises(ConfigError, match="unusable settings"):
        build_network("dhrnet", {"depth": 3})
