"""Laws of TF-Grasp: windows, shifts, and where pixels end up."""

from __future__ import annotations

from typing import Any

import pytest
import torch

from mpgrasp.detectors.networks.tfgrasp import (
    MASKED,
    TFGrasp,
    TFGraspConfig,
    _Block,
    _Expand,
    _offsets,
    _shift_mask,
    _Stage,
)
from mpgrasp.exceptions import ConfigError

SMALL: dict[str, Any] = {"size": 64, "embed": 8, "window": 2}


def small(**settings: Any) -> TFGrasp:
    torch.manual_seed(0)
    return TFGrasp(TFGraspConfig(**{**SMALL, **settings}))


def blocks(**settings: Any) -> list[_Block]:
    return [m for m in small(**settings).encoder.modules() if isinstance(m, _Block)]


def influence(config: TFGraspConfig, depth: int, at: tuple[int, int]) -> list[list[int]]:
    """Tokens of the finest stage that the token `at` depends on after that many blocks."""
    torch.manual_seed(0)
    stage = _Stage(config, 0, [0.0] * depth).eval()
    side = config.size // 4
    x = torch.randn(1, side, side, config.embed, requires_grad=True)
    stage(x)[0, at[0], at[1]].square().sum().backward()
    assert x.grad is not None
    found: list[list[int]] = x.grad[0].abs().sum(-1).nonzero().tolist()
    return found


def test_a_block_sees_its_window_alone() -> None:
    seen = influence(TFGraspConfig(**{**SMALL, "window": 4, "size": 128}), 1, (5, 9))
    assert seen == [[r, c] for r in range(4, 8) for c in range(8, 12)]


def test_the_next_block_sees_across_windows_but_not_across_the_image() -> None:
    config = TFGraspConfig(**{**SMALL, "window": 4, "size": 128})
    # shifted windows are rows and columns 2-5, 6-9, ...; they draw in the plain ones that they touch
    assert influence(config, 2, (5, 9)) == [[r, c] for r in range(0, 8) for c in range(4, 12)]
    # at the border the roll joins the first rows with the last: the mask keeps them apart
    assert influence(config, 2, (0, 0)) == [[r, c] for r in range(0, 4) for c in range(0, 4)]


def test_one_window_over_everything_is_not_shifted() -> None:
    assert [b.shift for b in blocks()] == [0, 1, 0, 1, 0, 1, 0, 0]


def test_attention_in_a_window_is_softmax_of_scaled_products_plus_position_bias() -> None:
    attention = blocks()[2].attention  # the second stage's first: two heads
    x = torch.randn(3, 4, 16)
    q, k, v = attention.qkv(x).split(16, dim=-1)
    expected = torch.zeros(3, 4, 16)
    position = [(0, 0), (0, 1), (1, 0), (1, 1)]
    for window in range(3):
        for head in range(2):
            part = slice(8 * head, 8 * head + 8)
            for i, (r, c) in enumerate(position):
                scores = []
                for j, (row, col) in enumerate(position):
                    bias = attention.bias[head].reshape(3, 3)[r - row + 1, c - col + 1]
                    scores.append(q[window, i, part] @ k[window, j, part] / 8**0.5 + bias)
                expected[window, i, part] = torch.stack(scores).softmax(0) @ v[window, :, part]
    assert torch.allclose(attention(x, None), attention.out(expected), atol=1e-6)


def test_each_relative_position_has_its_own_bias() -> None:
    offsets = _offsets(7)
    assert offsets.shape == (49, 49)
    assert torch.unique(offsets).tolist() == list(range(13**2))
    assert (offsets.diagonal() == 13**2 // 2).all()


def test_the_mask_parts_tokens_that_the_roll_brought_together() -> None:
    mask = _shift_mask(4, 2, 1)[:, 0]
    assert (mask[0] == 0).all()  # rows and columns 1, 2: neighbours
    assert (mask[1] == torch.tensor([[0, MASKED], [MASKED, 0]]).repeat(2, 2)).all()  # columns 3 and 0
    assert (mask[3] == torch.full((4, 4), MASKED).fill_diagonal_(0)).all()


def test_expanded_parts_stay_where_their_token_was() -> None:
    torch.manual_seed(0)
    expand = _Expand(8, 2, 4, together=True)
    x = torch.randn(1, 3, 3, 8, requires_grad=True)
    expand(x)[0, 3, 4].square().sum().backward()
    assert x.grad is not None
    assert x.grad[0].abs().sum(-1).nonzero().tolist() == [[1, 2]]


def test_pixels_of_the_maps_lie_where_the_heads_see_them() -> None:
    network = small().eval()
    parts: list[torch.Tensor] = []
    network.pixels.expand.register_forward_hook(lambda _, args, __: parts.append(args[0]))
    with torch.inference_mode():
        sin = network(torch.randn(1, 1, 64, 64))[2]
        features = network.pixels(parts[0]).permute(0, 3, 1, 2)  # in place, as the decoder's stages are
        assert torch.allclose(network.sin_output(features), sin, atol=1e-6)  # type: ignore[operator]


def test_stochastic_depth_is_for_training_alone_and_keeps_the_mean() -> None:
    block = blocks(drop_path=0.5)[7]  # the encoder's last
    ones = torch.ones(4000, 1, 1, 1)
    torch.manual_seed(0)
    kept = block.train()._kept(ones)
    assert torch.unique(kept).tolist() == [0.0, 2.0]
    assert kept.mean() == pytest.approx(1.0, abs=0.05)
    assert torch.equal(block.eval()._kept(ones), ones)


def test_masks_and_indices_are_no_weights() -> None:
    assert not [key for key in small().state_dict() if "mask" in key or "offsets" in key]


@pytest.mark.parametrize(
    "bad", [{"size": 100}, {"heads": (3, 6, 12, 24)}, {"depths": (2, 2)}, {"drop_path": 1.0}, {"window": 0}]
)
def test_settings_that_make_no_network_are_refused(bad: dict[str, Any]) -> None:
    with pytest.raises(ConfigError):
        TFGraspConfig(**{**SMALL, **bad})
