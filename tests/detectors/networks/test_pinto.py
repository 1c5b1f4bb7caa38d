"""Laws of the patch network: 18 directions, a hand that opens fully, and what it learns from labels."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import torch
from toy_bars import SIZE, share_right_after_training

from mpgrasp.detectors.networks.cost import flops
from mpgrasp.detectors.networks.pinto import ANGLES, AUTHORS, Pinto, PintoConfig, bin_angles
from mpgrasp.detectors.networks.registry import build_network
from mpgrasp.detectors.networks.weights import width_unit
from mpgrasp.exceptions import ConfigError
from mpgrasp.robot.hand import GRIPPER_MAX_WIDTH

SMALL: dict[str, Any] = {"size": SIZE, "patch": 32, "side": 32, "widths": (4,) * 5, "hidden": (8, 8)}


def test_directions_are_ten_degrees_apart_and_half_a_turn_in_all() -> None:
    angles = np.rad2deg(bin_angles(torch.arange(ANGLES)).numpy())
    assert np.allclose(angles, np.arange(-85, 90, 10))


def test_every_patch_claims_one_of_them() -> None:
    torch.manual_seed(0)
    with torch.inference_mode():
        _, cos, sin, _ = Pinto(PintoConfig(**SMALL)).eval()(torch.randn(2, 1, SIZE, SIZE))
    degrees = np.rad2deg(np.arctan2(sin.numpy(), cos.numpy()) / 2)
    apart = np.abs(degrees[..., None] - np.arange(-85, 90, 10)).min(axis=-1)
    assert apart.max() < 1e-3


def test_the_hand_opens_fully_from_wherever_it_looks() -> None:
    with torch.inference_mode():
        *_, width = Pinto(PintoConfig(**SMALL)).eval()(torch.randn(1, 1, SIZE, SIZE))
    assert width.unique().tolist() == [1.0]
    lowest, focal_px = 0.22, 290.0  # of the wrist camera over the table, at the network's resolution
    assert width_unit(224) / focal_px * lowest > GRIPPER_MAX_WIDTH


def test_a_patch_is_judged_by_relief_and_not_by_distance() -> None:
    torch.manual_seed(0)
    net = Pinto(PintoConfig(**SMALL)).eval()
    image = torch.randn(1, 1, SIZE, SIZE)
    with torch.inference_mode():
        assert torch.allclose(net(image)[0], net(image + 3)[0], atol=1e-5)


def test_it_learns_where_and_in_which_direction_a_bar_is_grasped() -> None:
    torch.manual_seed(0)
    net = Pinto(PintoConfig(**{**SMALL, "widths": (8, 8, 8, 8, 8), "hidden": (32, 32)}))
    right = share_right_after_training("pinto", net, steps=60, rate=3e-3, half=(5, 18), share=1, width_px=25)
    assert right >= 0.8


def test_the_authors_network_is_alexnet() -> None:
    """About 60 million parameters less the layers of its thousand classes, and 0.6 to 1.4 GFLOP a patch."""
    with torch.device("meta"):
        net = build_network("pinto", AUTHORS)
    assert 40e6 < sum(p.numel() for p in net.parameters()) < 60e6
    assert 0.6e9 < flops(net, 1, 224) / 28**2 < 3e9


@pytest.mark.parametrize(
    "wrong",
    [
        {"widths": (4,) * 4},
        {"hidden": (8,)},
        {"widths": (0,) * 5},
        {"patch": 8},
        {"patch": 33},
        {"side": 1000},
        {"stride": 7},
    ],
)
def test_sizes_that_make_no_patch_network_are_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(ConfigError, match="patch"):
        PintoConfig(**{**SMALL, **wrong})
