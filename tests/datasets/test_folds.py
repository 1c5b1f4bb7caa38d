"""Laws of folds: every image is in one, objects stay together, and names alone decide."""

from __future__ import annotations

import pytest

from mpgrasp.datasets.folds import assign, members, spread
from mpgrasp.exceptions import ConfigError

OBJECTS = {f"{k:03d}": f"thing {k // 7}" for k in range(103)}
"""15 objects, of seven images but for the last."""


@pytest.mark.parametrize("split", ["iw", "ow"])
@pytest.mark.parametrize("count", [2, 5])
def test_every_image_is_in_one_fold_and_folds_are_even(split: str, count: int) -> None:
    fold = assign(OBJECTS, split, count)  # type: ignore[arg-type]
    assert fold.keys() == OBJECTS.keys()
    found = members(fold, count)
    assert sorted(name for names in found for name in names) == sorted(OBJECTS)
    sizes = [len(names) for names in found]
    assert max(sizes) - min(sizes) <= (1 if split == "iw" else 7)


def test_object_wise_no_object_is_in_two_folds_and_image_wise_most_are() -> None:
    def shared(split: str) -> int:
        fold = assign(OBJECTS, split)  # type: ignore[arg-type]
        homes = [{fold[i] for i, thing in OBJECTS.items() if thing == t} for t in set(OBJECTS.values())]
        return sum(len(home) > 1 for home in homes)

    assert shared("ow") == 0
    assert shared("iw") > 10


def test_the_order_of_the_images_decides_nothing() -> None:
    backwards = dict(reversed(OBJECTS.items()))
    assert assign(backwards, "ow") == assign(OBJECTS, "ow")
    assert assign(backwards, "iw") == assign(OBJECTS, "iw")


def test_folds_are_no_runs_of_neighbours() -> None:
    fold = assign(OBJECTS, "iw")
    same = sum(fold[f"{k:03d}"] == fold[f"{k + 1:03d}"] for k in range(102))
    assert same < 45


@pytest.mark.parametrize(("split", "count"), [("xx", 5), ("ow", 16), ("iw", 104), ("iw", 1)])
def test_folds_that_cannot_be_are_refused(split: str, count: int) -> None:
    with pytest.raises(ConfigError):
        assign(OBJECTS, split, count)  # type: ignore[arg-type]


def test_the_spread_is_the_mean_and_the_deviation_of_a_sample() -> None:
    assert spread([0.5, 0.7]) == pytest.approx((0.6, 0.1 * 2**0.5))
    assert spread([0.5]) == (0.5, 0.0)
