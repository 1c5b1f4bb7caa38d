"""Laws of levelling: the table becomes flat, what rises over it stays, and holes stay holes."""

from __future__ import annotations

import numpy as np
import pytest

from mpgrasp.datasets.labelled_image import LabelledImage
from mpgrasp.datasets.levelling import level, table_depth

SHAPE = (240, 300)


def seen_aslant(radial: bool, noise: float = 3e-4) -> tuple[np.ndarray, np.ndarray]:
    """Depth [m] of a table seen under 30 degrees, and the height of the box on it [m]."""
    v, u = np.indices(SHAPE, float)
    x, y = (u - 149.5) / 300, (v - 119.5) / 300
    z = 0.8 / (1 + np.tan(np.deg2rad(30)) * y)
    height = np.where((np.abs(u - 120) < 40) & (np.abs(v - 140) < 15), 0.03, 0.0)
    depth = (z - height) * (np.sqrt(1 + x**2 + y**2) if radial else 1.0)
    depth += np.random.default_rng(0).normal(0, noise, SHAPE)
    depth[10:20, 10:30] = np.nan
    return depth.astype(np.float32), height


@pytest.mark.parametrize("radial", [False, True])
def test_a_table_seen_aslant_becomes_flat_and_the_box_on_it_stays(radial: bool) -> None:
    depth, height = seen_aslant(radial)
    assert np.nanstd(depth[height == 0]) > 0.05, "it was far from flat"
    image = LabelledImage(name="a", object="a", depth=depth, rgb=None, rectangles=(), focal_px=300.0)
    found = level(image).depth
    table = found[height == 0]
    middle = np.nanmedian(table)
    near = np.abs(np.indices(SHAPE)[0] - 140) < 60
    assert np.nanstd(found[(height == 0) & near]) < 0.006
    rise = middle - np.nanmedian(found[height > 0])
    assert rise == pytest.approx(0.03, abs=0.008)
    assert (np.isnan(found) == np.isnan(depth)).all()
    assert middle == pytest.approx(np.nanmedian(depth), abs=0.02)


def test_a_flat_table_stays_as_it_is() -> None:
    depth = np.full(SHAPE, 0.5, np.float32)
    depth[100:120, 100:160] = 0.46
    table = table_depth(depth)
    assert table is not None
    assert np.abs(table - 0.5).max() < 1e-6


def test_what_is_hardly_seen_is_left_alone() -> None:
    depth = np.full(SHAPE, np.nan, np.float32)
    depth[:8, :8] = 0.5
    image = LabelledImage(name="a", object="a", depth=depth, rgb=None, rectangles=(), focal_px=300.0)
    assert level(image) is image
