"""Laws of maps as pictures."""

from __future__ import annotations

import numpy as np

from mpgrasp.recording.false_colour import HOLE, shade, shade_depth, shade_lines


def test_shading_runs_from_dark_to_bright_and_marks_holes() -> None:
    picture = shade(np.array([[0.0, 0.5, 1.0, np.nan]]), 0.0, 1.0).astype(int)
    brightness = picture[0, :3].sum(axis=1)
    assert (np.diff(brightness) > 0).all()
    assert tuple(picture[0, 3]) == HOLE
    depth = shade_depth(np.array([[0.4, 0.5, np.nan]])).astype(int)
    assert depth[0, 0].sum() > depth[0, 1].sum()
    assert (shade_depth(np.full((2, 2), np.nan)) == HOLE).all()


def test_angles_half_a_turn_apart_have_one_colour() -> None:
    one, other = np.array([[-np.pi / 2 + 0.01]]), np.array([[np.pi / 2 + 0.01]])
    weight = np.ones((1, 1))
    np.testing.assert_array_equal(shade_lines(one, weight), shade_lines(other, weight))
