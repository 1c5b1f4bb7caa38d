"""Laws of meshes of several solids."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from toy_meshes import write

from mpgrasp.exceptions import AssetError
from mpgrasp.geometry import FloatArray
from mpgrasp.scene.objects.from_mesh import MAX_SOLIDS, read_body
from mpgrasp.scene.objects.solids import MAX_GAP, gaps, require_together, share_of_union

pytest.importorskip("coacd")


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A cache of one's own."""
    monkeypatch.setenv("MPGRASP_CACHE", str(tmp_path / "cache"))


def block(edge: float, x: float = 0.0) -> FloatArray:
    """Corners (8, 3) of a cube whose centre lies at x."""
    corners = np.array(np.meshgrid(*[(-edge / 2, edge / 2)] * 3)).reshape(3, -1).T
    return np.asarray(corners + np.array([x, 0, 0]))


def together(path: Path, *solids: FloatArray) -> Path:
    return write(trimesh.util.concatenate([trimesh.convex.convex_hull(solid) for solid in solids]), path)


@pytest.mark.parametrize("gap", [-0.005, -0.001, 0.0005, 0.004, 0.02])
def test_the_gap_between_two_cubes_is_the_one_they_were_set_apart_by(gap: float) -> None:
    found = gaps([[block(0.02)], [block(0.02, 0.02 + gap)]])
    assert found == {(0, 1): pytest.approx(gap, abs=1e-5)}


def test_a_chain_of_solids_hangs_together_and_one_apart_does_not() -> None:
    step = 0.02 + 0.8 * MAX_GAP
    chain = [[block(0.02, k * step)] for k in (0, 2, 1, 3)]
    require_together(chain)
    with pytest.raises(AssetError, match=r"several bodies apart; got '2 bodies, 10\.0 mm"):
        require_together([*chain, [block(0.02, 3 * step + 0.03)]])


@pytest.mark.parametrize(
    ("solids", "share"),
    [
        ([block(0.04), block(0.02)], 64 / 72),  # one in the other
        ([block(0.02), block(0.02, 0.01)], 3 / 4),  # half of each in the other
        ([block(0.02), block(0.02)], 1 / 2),
        ([block(0.02), block(0.02, 0.0205)], 1.0),
        ([block(0.02)], 1.0),
    ],
)
def test_space_that_solids_share_is_counted_once(solids: list[FloatArray], share: float) -> None:
    assert share_of_union([[solid] for solid in solids]) == pytest.approx(share, rel=0.01)


def test_a_body_within_a_body_adds_no_mass(tmp_path: Path) -> None:
    body = read_body(together(tmp_path / "a.stl", block(0.04), block(0.02)))
    assert body.volume == pytest.approx(0.04**3, rel=0.01)


def test_bodies_apart_and_too_many_bodies_are_refused(tmp_path: Path) -> None:
    with pytest.raises(AssetError, match="several bodies apart"):
        read_body(together(tmp_path / "apart.stl", block(0.02), block(0.02, 0.03)))
    crumbs = [block(0.004, 0.0045 * k) for k in range(MAX_SOLIDS + 1)]
    with pytest.raises(AssetError, match="many bodies"):
        read_body(together(tmp_path / "crumbs.stl", *crumbs))
