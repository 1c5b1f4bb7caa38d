"""Laws of the DHRNet architecture."""

from __future__ import annotations

from typing import Any

import pytest
import torch
from torch import nn

from mpgrasp.detectors.networks.dhrnet import AUTHORS, DHRNet, DHRNetConfig
from mpgrasp.exceptions import ConfigError

SMALL: dict[str, Any] = {"width": 4, "stem_width": 4, "head_width": 4, "blocks": 1}


def count(network: nn.Module) -> int:
    return sum(p.numel() for p in network.parameters())


@pytest.mark.parametrize("fine_head", [True, False])
@pytest.mark.parametrize("channels", [1, 2, 3, 4])
def test_every_head_has_a_value_for_every_pixel(channels: int, fine_head: bool) -> None:
    network = DHRNet(DHRNetConfig(**SMALL, channels=channels, fine_head=fine_head)).eval()
    with torch.inference_mode():
        heads = network(torch.randn(2, channels, 64, 96))
    assert [tuple(h.shape) for h in heads] == [(2, 1, 64, 96)] * 4
    assert all(h.dtype == torch.float32 and torch.isfinite(h).all() for h in heads)


def test_the_authors_settings_have_the_authors_size() -> None:
    with torch.device("meta"):
        network = DHRNet(DHRNetConfig(**AUTHORS))
    assert 65.5e6 < count(network) < 66.3e6


def test_the_four_stages_have_one_to_four_branches_of_doubled_width() -> None:
    network = DHRNet(DHRNetConfig(**SMALL))
    assert [len(stage[0].branches) for stage in network.stages] == [2, 3, 4]  # type: ignore[index]
    widths = [branch[0].body[0].weight.shape[0] for branch in network.stages[-1][0].branches]  # type: ignore[index]
    assert widths == [4, 8, 16, 32]


def test_batch_norm_has_the_paper_s_momentum() -> None:
    norms = [m for m in DHRNet(DHRNetConfig(**SMALL)).modules() if isinstance(m, nn.BatchNorm2d)]
    assert norms
    assert {n.momentum for n in norms} == {0.1}


def test_every_parameter_learns() -> None:
    network = DHRNet(DHRNetConfig(**SMALL))
    sum(h.square().mean() for h in network(torch.randn(2, 1, 64, 64))).backward()
    assert all(p.grad is not None and p.grad.abs().sum() > 0 for p in network.parameters())


def test_a_pixel_is_seen_across_the_whole_image() -> None:
    torch.manual_seed(0)
    network = DHRNet(DHRNetConfig(**SMALL)).eval()
    x = torch.randn(1, 1, 128, 128, requires_grad=True)
    network(x)[0][0, 0, 64, 64].backward()
    assert x.grad is not None
    rows = x.grad[0, 0].abs().sum(1).nonzero()
    assert rows.max() - rows.min() > 100


@pytest.mark.parametrize(("head", "sides"), [("all", [16, 8, 4, 2]), ("lower", [8, 4, 2]), ("highest", [16])])
def test_heads_see_the_branches_that_they_are_meant_to(head: str, sides: list[int]) -> None:
    network = DHRNet(DHRNetConfig(**SMALL, head=head, fine_head=False)).eval()
    seen: list[int] = []
    network.head.register_forward_hook(lambda _, args, __: seen.extend(b.shape[-1] for b in args[0]))
    with torch.inference_mode():
        network(torch.randn(1, 1, 64, 64))
    assert seen == sides


def test_the_ablated_heads_leave_the_rest_of_the_network_as_it_is() -> None:
    def entries(head: str) -> dict[str, torch.Size]:
        state = DHRNet(DHRNetConfig(**SMALL, head=head, fine_head=False)).state_dict()
        return {k: v.shape for k, v in state.items() if not k.startswith(("head.", "stages.2.0.fuse."))}

    assert entries("all") == entries("lower") == entries("highest")


def test_without_the_finest_branch_maps_are_no_finer_than_an_eighth() -> None:
    network = DHRNet(DHRNetConfig(**SMALL, head="lower", fine_head=False)).eval()
    with torch.inference_mode():
        pos = network(torch.randn(1, 1, 64, 64))[0][0, 0]
    # bilinear from 8x8 pixels: no bends but at their centres, so second differences between those are zero
    bends = pos.diff(n=2, dim=1).abs().amax(dim=0)
    assert bends[[c for c in range(62) if (c + 1 - 3) % 8 > 1]].max() < 1e-4 * bends.max()


@pytest.mark.parametrize(
    "bad", [{"width": 0}, {"modules": (1, 1)}, {"blocks": 0}, {"channels": 0}, {"head": "upper"}]
)
def test_settings_that_make_no_network_are_refused(bad: dict[str, Any]) -> None:
    with pytest.raises(ConfigError):
        DHRNetConfig(**bad)


@pytest.mark.parametrize("head", ["lower", "highest"])
def test_a_head_that_leaves_branches_out_has_no_fine_head_beside_it(head: str) -> None:
    with pytest.raises(ConfigError, match=r"fine head.*fine_head=False"):
        DHRNetConfig(head=head)
