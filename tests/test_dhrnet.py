"""Laws of the DHRNet architecture."""

from __future__ import annotations

from typing import Any

import pytest
import torch
from torch import nn

from mpgrasp.detectors.dhrnet import AUTHORS, DHRNet, DHRNetConfig
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
    assert [len(stage[0].branches) for stage in network.stages] == [2, 3, 4]  # type: ignore[index,union-attr]
    widths = [branch[0].body[0].weight.shape[0] for branch in network.stages[-1][0].branches]  # type: ignore[index,union-attr]
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
    network = DHRNet(DHRNetConfig(**SMALL)).eval()
    torch.manual_seed(0)
    x = torch.randn(1, 1, 128, 128, requires_grad=True)
    network(x)[0][0, 0, 64, 64].backward()
    assert x.grad is not None
    rows = x.grad[0, 0].abs().sum(1).nonzero()
    assert rows.max() - rows.min() > 100


def test_heads_see_fine_and_coarse_branches() -> None:
    network = DHRNet(DHRNetConfig(**SMALL)).eval()
    seen: list[int] = []
    network.head.register_forward_hook(lambda _, args, __: seen.extend(b.shape[-1] for b in args[0]))
    with torch.inference_mode():
        network(torch.randn(1, 1, 64, 64))
    assert seen == [16, 8, 4, 2]


@pytest.mark.parametrize("bad", [{"width": 0}, {"modules": (1, 1)}, {"blocks": 0}, {"channels": 0}])
def test_settings_that_make_no_network_are_refused(bad: dict) -> None:
    with pytest.raises(ConfigError):
        DHRNetConfig(**bad)
