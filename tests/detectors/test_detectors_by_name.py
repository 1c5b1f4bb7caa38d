"""Laws of detectors by name: what cannot be made is one clear error."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
import torch
from safetensors.torch import save_file
from toy_networks import IMAGE, random_weights, weight_files

from mpgrasp.detectors import make_detector
from mpgrasp.detectors.config import NetworkDetectorConfig
from mpgrasp.detectors.networks.weights import save_weights
from mpgrasp.exceptions import ConfigError, WeightsError

pytestmark = pytest.mark.usefixtures("network_cache")


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path | None]:
    return weight_files(tmp_path_factory.mktemp("weights"))


def _truncated(good: bytes) -> bytes:
    return good[: len(good) // 2]


def _damaged(good: bytes) -> bytes:
    return b"\xff" * 16 + good[16:-64] + b"\xff" * 64


@pytest.mark.parametrize("name", ["ggcnn2", "ggcnn"], ids=[".safetensors", ".pt"])
@pytest.mark.parametrize(
    "spoil",
    [lambda _: b"", lambda _: b"no weights at all" * 40, _truncated, _damaged],
    ids=["empty", "text", "truncated", "damaged"],
)
def test_broken_weight_files_are_one_clear_error(
    spoil: Callable[[bytes], bytes], name: str, files: dict[str, Path | None], tmp_path: Path
) -> None:
    source = files[name]
    assert source is not None
    broken = tmp_path / f"broken{source.suffix}"
    broken.write_bytes(spoil(source.read_bytes()))
    with pytest.raises(WeightsError):
        make_detector(name, broken)


@pytest.mark.parametrize("channels", [2, 3, 4])
def test_a_wrong_number_of_channels_is_one_clear_error(channels: int, tmp_path: Path) -> None:
    file = tmp_path / "w.safetensors"
    save_weights(file, random_weights("ggcnn2", {}, IMAGE, channels))
    with pytest.raises(WeightsError, match="channels"):
        make_detector("ggcnn2", file)


def test_another_network_s_weights_are_one_clear_error(files: dict[str, Path | None], tmp_path: Path) -> None:
    for name, other in (("dhrnet", "ggcnn2"), ("ggcnn2", "ggcnn"), ("tfgrasp", "dhrnet"), ("unet", "fcn")):
        with pytest.raises(WeightsError):
            make_detector(name, files[other])
    foreign = tmp_path / "foreign.safetensors"
    save_file({"layer.weight": torch.zeros(3, 3)}, foreign)
    with pytest.raises(WeightsError, match="not a weights file of mpgrasp"):
        make_detector("dhrnet", foreign)


def test_a_network_without_shipped_weights_says_how_to_get_some() -> None:
    with pytest.raises(WeightsError, match=r"fcn_residual.*--weights.*training train fcn_residual"):
        make_detector("fcn_residual")


def test_unknown_names_and_settings_are_one_clear_error(
    files: dict[str, Path | None], tmp_path: Path
) -> None:
    with pytest.raises(ConfigError, match=r"unknown detector.*dhrnet, tfgrasp, ggcnn, ggcnn2, .*oracle"):
        make_detector("yolo")
    with pytest.raises(ConfigError, match="no weights"):
        make_detector("oracle", files["dhrnet"])
    with pytest.raises(WeightsError):
        make_detector("dhrnet", tmp_path / "gone.safetensors")
    for name in ("dhrnet", "oracle"):
        with pytest.raises(ConfigError, match=r"unknown runtime; got 'tpu'; allowed: auto, torch, openvino"):
            make_detector(name, files[name], "tpu")
    with pytest.raises(ConfigError, match="detector settings"):
        NetworkDetectorConfig(crop=0)


def test_importing_the_registry_loads_no_torch_and_no_openvino() -> None:
    code = "import sys, mpgrasp.detectors; sys.exit(bool({'torch', 'openvino'} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0
