"""Laws of the cascade: it reads grasp rectangles turned upright, and its two ways of reading agree."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from toy_bars import SIZE, share_right_after_training

from mpgrasp.detectors.networks.lenz import LONG, SHORT, Lenz, LenzConfig, kinds, rectangle_offsets
from mpgrasp.exceptions import ConfigError
from mpgrasp.grasp import GraspRectangle


def network(channels: int = 1) -> Lenz:
    torch.manual_seed(0)
    built = Lenz(LenzConfig(channels=channels, size=SIZE, small=6, large=8)).eval()
    whiten = built.whiten
    assert whiten.running_mean is not None
    assert whiten.running_var is not None
    whiten.running_mean.normal_()
    whiten.running_var.uniform_(0.5, 2.0)
    return built


def test_candidates_are_read_within_their_grasp_rectangle() -> None:
    offsets = rectangle_offsets()
    for angle, opening, points in zip(*kinds(), offsets, strict=True):
        corners = GraspRectangle(u=0, v=0, angle=angle, width_px=opening, jaw_px=opening / 2).corners()
        along, across = corners[1] - corners[0], corners[3] - corners[0]
        # rows and columns of the points, in units of the rectangle's sides from its first corner
        shares = np.linalg.solve(np.stack([along, across], axis=1), (points[:, ::-1] - corners[0]).T)
        assert np.allclose(shares[0].reshape(SHORT, LONG), (np.arange(LONG) + 0.5) / LONG, atol=1 / opening)
        rows = ((np.arange(SHORT) + 0.5) / SHORT)[:, None]
        assert np.allclose(shares[1].reshape(SHORT, LONG), rows, atol=2 / opening)


@pytest.mark.parametrize("channels", [1, 3, 4])
def test_weights_made_for_windows_as_they_are_judge_like_the_upright_whitened_content(channels: int) -> None:
    net = network(channels)
    squares = net.windows.squares(net.windows.padded(net._seen(torch.randn(2, channels, SIZE, SIZE))))
    for kind in (0, 17, 33, 59):
        windows = net.windows.at_places(squares, slice(kind, kind + 1)).transpose(3, 4)
        weight, bias = net._for_windows(net.small.first, kind)
        folded = net.small.after_first(bias + torch.einsum("npkqs,hps->nkqh", windows, weight))
        which = torch.full((2, windows.shape[3]), kind)
        upright = net._judged(net.small, net._content(windows[:, :, 0], which))
        assert torch.allclose(folded[:, 0], upright, atol=1e-4)


def test_a_scene_that_is_turned_holds_the_same_content() -> None:
    """By quarter turns, which lose nothing: all that a rectangle shows turns with it."""
    torch.manual_seed(0)
    net = Lenz(LenzConfig(size=SIZE + 1, stride=5))  # of an odd side, whose middle is a pixel
    image = torch.randn(1, 1, SIZE + 1, SIZE + 1) / 50
    middle = torch.tensor([[(SIZE // 2) * (SIZE + 1) + SIZE // 2]])
    angle, opening = kinds()

    def content(turned: torch.Tensor, kind: int) -> torch.Tensor:
        padded = net.windows.padded(net._seen(turned))
        which = torch.tensor([[kind]])
        found = net._content(net.windows.at(padded, net.windows.padded_pixels(middle), which), which)
        return found.reshape(-1, SHORT, LONG)

    for kind in (3, 12):
        quarter = int(
            np.flatnonzero(np.isclose(angle, angle[kind] + np.pi / 2) & (opening == opening[kind]))[0]
        )
        before = content(image, kind)
        after = content(torch.rot90(image, 1, dims=(2, 3)), quarter)
        # rounding may move a point to its neighbour
        assert float((after - before).abs().median()) < 1e-5


def test_only_the_best_candidates_get_a_quality() -> None:
    net = network()
    with torch.inference_mode():
        pos, cos, sin, width = net(torch.randn(1, 1, SIZE, SIZE))
    claimed = width > 0
    assert 0 < len(torch.unique(cos[claimed])) <= 12
    assert set(np.round(torch.unique(width[claimed]).numpy() * SIZE / 2).astype(int)) <= {18, 25, 35, 49, 69}
    assert torch.allclose((cos**2 + sin**2)[claimed], torch.ones(()))
    assert pos.max() <= 1
    assert pos.min() >= 0


def test_it_learns_where_and_in_which_direction_a_bar_is_grasped() -> None:
    torch.manual_seed(0)
    net = Lenz(LenzConfig(size=SIZE))
    right = share_right_after_training("lenz", net, steps=60, rate=2e-3, half=(8, 18), share=2, width_px=25)
    assert right >= 0.8


@pytest.mark.parametrize(
    "wrong", [{"channels": 2}, {"small": 0}, {"large": 5000}, {"stride": 7}, {"stride": 64}]
)
def test_sizes_that_make_no_cascade_are_refused(wrong: dict[str, int]) -> None:
    with pytest.raises(ConfigError, match="cascade"):
        LenzConfig(**{"size": SIZE, **wrong})
