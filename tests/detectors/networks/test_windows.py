"""Laws of windows: they show the pixels that they say, and what is said of them covers the image."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from mpgrasp.detectors.networks.windows import Windows, drawn_pixels

SIZE, STRIDE = 32, 8


@pytest.fixture
def offsets() -> np.ndarray:
    return np.random.default_rng(0).integers(-20, 21, (3, 7, 2))


@pytest.fixture
def windows(offsets: np.ndarray) -> Windows:
    return Windows(SIZE, STRIDE, offsets)


def by_hand(image: np.ndarray, row: int, column: int, points: np.ndarray) -> np.ndarray:
    """Pixels around one, those of the border beyond it."""
    rows, columns = np.clip(points + np.array([row, column]), 0, SIZE - 1).T
    return image[:, rows, columns]


def test_a_window_shows_the_pixels_at_its_offsets(windows: Windows, offsets: np.ndarray) -> None:
    image = torch.randn(2, 3, SIZE, SIZE)
    shown = windows.at_places(windows.squares(windows.padded(image)), slice(1, 3))
    assert shown.shape == (2, 3, 2, 7, 16)
    centres = range(STRIDE // 2, SIZE, STRIDE)
    for k, kind in enumerate((1, 2)):
        for p, (row, column) in enumerate((r, c) for r in centres for c in centres):
            for n in range(2):
                expected = by_hand(image[n].numpy(), row, column, offsets[kind])
                assert np.array_equal(shown[n, :, k, :, p].numpy(), expected)


def test_any_pixel_can_be_the_centre(windows: Windows, offsets: np.ndarray) -> None:
    image = torch.randn(2, 3, SIZE, SIZE)
    pixels = torch.tensor([[0, SIZE * SIZE - 1], [33, 500]])
    kinds = torch.tensor([[0, 2], [1, 1]])
    shown = windows.at(windows.padded(image), windows.padded_pixels(pixels), kinds)
    for n in range(2):
        for k in range(2):
            row, column = divmod(int(pixels[n, k]), SIZE)
            expected = by_hand(image[n].numpy(), row, column, offsets[int(kinds[n, k])])
            assert np.array_equal(shown[n, :, k].numpy(), expected)


def test_the_best_place_is_the_best_of_the_image(windows: Windows) -> None:
    quality = torch.rand(1, 16) / 2
    quality[0, 6] = 1.0  # second row, third column
    pos, *_ = windows.spread(quality, torch.zeros(1, 3, 16))
    row, column = divmod(int(pos.flatten().argmax()), SIZE)
    assert abs(row - (STRIDE + STRIDE // 2)) <= 1
    assert abs(column - (2 * STRIDE + STRIDE // 2)) <= 1


def test_angle_and_width_are_those_of_the_nearest_place(windows: Windows) -> None:
    others = torch.arange(48, dtype=torch.float32).reshape(1, 3, 16)
    _, *maps = windows.spread(torch.ones(1, 16), others)
    for k, said in enumerate(maps):
        blocks = said[0, 0].reshape(4, STRIDE, 4, STRIDE)
        assert torch.equal(blocks.amin(dim=(1, 3)).flatten(), others[0, k])
        assert torch.equal(blocks.amax(dim=(1, 3)).flatten(), others[0, k])


def test_half_of_what_is_drawn_is_labelled_and_none_of_it_invalid() -> None:
    quality = torch.zeros(2, SIZE, SIZE)
    quality[0, 3:5, 3:9] = 0.5
    valid = torch.ones(2, SIZE, SIZE, dtype=torch.bool)
    valid[:, :, 16:] = False
    pixels = drawn_pixels(quality, valid, 200, torch.Generator().manual_seed(0))
    assert pixels.shape == (2, 400)
    assert (quality[0].flatten()[pixels[0, :200]] > 0).all()
    assert valid.flatten(1).gather(1, pixels).all()
    assert len(set(pixels[1].tolist())) > 200  # without a label all pixels are as likely


def test_the_same_dice_draw_the_same_pixels() -> None:
    quality, valid = torch.rand(2, SIZE, SIZE), torch.ones(2, SIZE, SIZE, dtype=torch.bool)
    drawn = [drawn_pixels(quality, valid, 9, torch.Generator().manual_seed(s)) for s in (3, 3, 4)]
    assert torch.equal(drawn[0], drawn[1])
    assert not torch.equal(drawn[0], drawn[2])
