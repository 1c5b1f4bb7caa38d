"""One contract for all networks."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import torch

from mpgrasp.detectors.networks.declaration import HEADS, Target
from mpgrasp.detectors.networks.input import NetworkInput
from mpgrasp.detectors.networks.registry import NETWORKS, build_network, declaration
from mpgrasp.detectors.networks.weights import NetworkWeights, load_weights, save_weights
from mpgrasp.exceptions import ConfigError

SIZE = 64
MODALITY = {1: "d", 3: "rgb", 4: "rgbd"}
DHRNET: dict[str, Any] = {"width": 4, "stem_width": 4, "head_width": 4, "blocks": 1}
FCN: dict[str, Any] = {"width": 3, "blocks": 1}
SMALL: dict[str, tuple[str, dict[str, Any], int]] = {
    "dhrnet": ("dhrnet", DHRNET, SIZE),
    "dhrnet without fine head": ("dhrnet", {**DHRNET, "fine_head": False}, SIZE),
    "dhrnet lower": ("dhrnet", {**DHRNET, "fine_head": False, "head": "lower"}, SIZE),
    "dhrnet highest": ("dhrnet", {**DHRNET, "fine_head": False, "head": "highest"}, SIZE),
    "tfgrasp": ("tfgrasp", {"size": SIZE, "embed": 8, "window": 2}, SIZE),
    "ggcnn": ("ggcnn", {}, 60),
    "ggcnn2": ("ggcnn2", {}, SIZE),
    "grconvnet": ("grconvnet", {"features": 4}, SIZE),
    "lenz": ("lenz", {"size": SIZE, "small": 6, "large": 8}, SIZE),
    "pinto": ("pinto", {"size": SIZE, "patch": 32, "side": 32, "widths": [4] * 5, "hidden": [8, 8]}, SIZE),
    "fcn": ("fcn", FCN, SIZE),
    "fcn_residual": ("fcn_residual", FCN, SIZE),
    "unet": ("unet", FCN, SIZE),
}
"""Network, settings and image size of each case, small but whole."""

Built = tuple[str, dict[str, Any], torch.nn.Module, torch.Tensor]


def build(case: str, channels: int) -> Built:
    name, settings, size = SMALL[case]
    torch.manual_seed(0)
    settings = {**settings, "channels": channels}
    network = build_network(name, settings).eval()
    return name, settings, network, torch.randn(2, channels, size, size)


@pytest.fixture(params=[(case, channels) for case in SMALL for channels in MODALITY], ids=str)
def built(request: pytest.FixtureRequest) -> Built:
    return build(*request.param)


@pytest.fixture(params=SMALL)
def rgbd(request: pytest.FixtureRequest) -> Built:
    """For what does not depend on the number of channels."""
    return build(request.param, 4)


def run(network: torch.nn.Module, x: torch.Tensor) -> torch.Tensor:
    with torch.inference_mode():
        return torch.cat(network(x), dim=1)


def test_every_name_is_under_contract() -> None:
    assert {name for name, _, _ in SMALL.values()} == set(NETWORKS)


def test_four_finite_float_maps_of_the_images_size(built: Built) -> None:
    _, _, network, x = built
    with torch.inference_mode(), torch.autocast("cpu", torch.bfloat16):
        low = network(x)
    with torch.inference_mode():
        maps = network(x)
    for m in (*maps, *low):
        assert m.shape == (len(x), 1, *x.shape[2:])
        assert m.dtype == torch.float32
        assert torch.isfinite(m).all()


def test_every_parameter_learns(built: Built) -> None:
    name, _, network, x = built
    own = declaration(name).loss
    if own is None:
        sum(m.square().mean() for m in network.train()(x)).backward()
    else:
        quality, angle, width = torch.rand(3, *x[:, 0].shape)
        target = Target(quality, angle, width, torch.ones_like(quality, dtype=torch.bool))
        own(network.train(), x, target, torch.Generator().manual_seed(0)).backward()  # type: ignore[no-untyped-call]
    assert [n for n, p in network.named_parameters() if p.grad is None or not p.grad.abs().sum() > 0] == []


def test_every_input_channel_counts(rgbd: Built) -> None:
    _, _, network, x = rgbd
    before = run(network, x)
    for k in range(x.shape[1]):
        changed = x.clone()
        changed[:, k] = 0
        assert not torch.allclose(run(network, changed), before)


def test_the_same_image_gives_the_same_maps_alone_or_in_company(built: Built) -> None:
    _, _, network, x = built
    both = run(network, x)
    assert torch.equal(both, run(network, x))
    scale = both.abs().max()
    for k in range(len(x)):
        assert torch.allclose(run(network, x[k : k + 1])[0] / scale, both[k] / scale, atol=1e-5)


def test_memory_layout_changes_nothing(rgbd: Built) -> None:
    _, _, network, x = rgbd
    before = run(network, x)
    network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    after = run(network, x.contiguous(memory_format=torch.channels_last))
    assert torch.allclose(after / before.abs().max(), before / before.abs().max(), atol=1e-5)


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.filterwarnings("error::torch.jit.TracerWarning")
def test_a_trace_computes_the_same(rgbd: Built) -> None:
    _, _, network, x = rgbd
    with torch.inference_mode():
        traced = torch.jit.trace(network, x[:1], check_trace=False)  # type: ignore[no-untyped-call]
    expected = run(network, x[1:])
    scale = expected.abs().max()
    assert torch.allclose(run(traced, x[1:]) / scale, expected / scale, atol=1e-5)


def test_weights_come_back_to_the_same_maps(built: Built, tmp_path: Path) -> None:
    name, settings, network, x = built
    image = NetworkInput(size=x.shape[-1], modality=MODALITY[x.shape[1]])
    save_weights(
        tmp_path / "w.safetensors",
        NetworkWeights(name=name, network=network, settings=settings, input=image),
    )
    back = load_weights(name, tmp_path / "w.safetensors")
    assert back.settings == settings
    assert torch.equal(run(back.network, x), run(network, x))


def test_heads_have_their_checkpoint_names(rgbd: Built) -> None:
    case, _, network, _ = rgbd
    if declaration(case).loss is not None:
        pytest.skip("it judges windows, and has no heads")
    assert {f"{name}_output.weight" for name in HEADS} <= set(network.state_dict())


@pytest.mark.parametrize("name", NETWORKS)
def test_networks_are_made_for_images_of_their_size(name: str) -> None:
    size = declaration(name).input_size
    with torch.device("meta"):
        maps = build_network(name, {}).eval()(torch.zeros(1, 1, size, size))
    assert [tuple(m.shape) for m in maps] == [(1, 1, size, size)] * 4


@pytest.mark.parametrize("name", NETWORKS)
@pytest.mark.parametrize("bad", [{"channels": 0}, {"nonsense": 1}, {"channels": "many"}])
def test_settings_that_make_no_network_are_refused(name: str, bad: dict[str, Any]) -> None:
    with pytest.raises(ConfigError, match="unusable"):
        build_network(name, bad)
