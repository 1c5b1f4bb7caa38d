"""A phased transposed convolution is PyTorch's own, whose outputs and slopes are the oracle."""

from __future__ import annotations

import pytest
import torch

from mpgrasp.detectors.networks.transposed import PhasedTranspose


@pytest.mark.parametrize(
    ("kernel", "stride", "padding", "output_padding"),
    [(4, 2, 1, 1), (4, 2, 2, 1), (3, 2, 1, 1), (5, 2, 2, 1), (9, 3, 3, 1), (2, 2, 0, 0), (3, 1, 1, 0)],
)
def test_its_phases_are_a_transposed_convolution(
    kernel: int, stride: int, padding: int, output_padding: int
) -> None:
    torch.manual_seed(kernel)
    layer = PhasedTranspose(
        5, 3, kernel, stride=stride, padding=padding, output_padding=output_padding
    ).double()
    x = torch.randn(2, 5, 7, 9, dtype=torch.float64, requires_grad=True)
    trained, known = layer.phased(x), layer(x)
    assert trained.shape == known.shape
    torch.testing.assert_close(trained, known)
    goal = torch.randn_like(known)
    slopes = [torch.autograd.grad((y * goal).sum(), (x, *layer.parameters())) for y in (trained, known)]
    torch.testing.assert_close(*slopes)


def test_a_wanted_size_of_the_output_is_met() -> None:
    layer = PhasedTranspose(2, 2, 3, stride=2, padding=1, output_padding=0)
    assert layer(torch.zeros(1, 2, 4, 4), output_size=[8, 8]).shape == (1, 2, 8, 8)


def test_phases_are_what_bfloat16_is_trained_in(monkeypatch: pytest.MonkeyPatch) -> None:
    layer = PhasedTranspose(2, 2, 3, stride=2, padding=1, output_padding=1)
    asked: list[torch.dtype] = []
    monkeypatch.setattr(layer, "phased", lambda x: asked.append(x.dtype))
    x = torch.zeros(1, 2, 4, 4)
    layer.train()(x)
    layer.to(torch.bfloat16).eval()(x.bfloat16())
    assert not asked
    layer.train()(x.bfloat16())
    assert asked == [torch.bfloat16]
