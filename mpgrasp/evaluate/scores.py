"""Scores of detectors on a dataset: rates with intervals, and paired tests over the same images."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

from mpgrasp.datasets.folds import spread
from mpgrasp.datasets.labelled_image import LabelledImage
from mpgrasp.datasets.rectangle_metric import best_iou, right
from mpgrasp.detectors.detector import GraspDetector
from mpgrasp.evaluate.predict import Square, grasps, predict
from mpgrasp.grasp import GraspRectangle
from mpgrasp.statistics import holm, mcnemar, wilson_interval

BORDER = 0.06
"""Distance from the edge of an image within which a best grasp is suspicious, as a share of its side."""
TOP = 5
"""Grasps of an image of which one must be right, beside the best one alone."""


@dataclass(frozen=True, kw_only=True)
class ImageScore:
    """One detector on one image."""

    image: str
    object: str
    detector: str
    top1: bool
    """The best grasp is right."""
    top5: bool
    """One of the best five is."""
    iou: float
    """Greatest overlap of the best grasp with a label whose angle agrees."""
    border: bool
    """The best grasp lies within `BORDER` of the image's edge, where there is seldom an object."""
    labelled: bool = True
    """The image has labels; without, top1, top5 and iou say nothing, and it counts for no rate by them."""
    fold: int | None = None
    """Fold of the image, from 1; None without folds."""
    u: float = math.nan
    """Best grasp in the whole image: column of its centre [px] ..."""
    v: float = math.nan
    """... row [px] ..."""
    angle: float = math.nan
    """... closing direction, counter-clockwise on screen [rad] ..."""
    width_px: float = math.nan
    """... and opening [px]."""


@dataclass(frozen=True, kw_only=True)
class Rate:
    """Share of images with its 95 % Wilson interval."""

    count: int
    n: int

    @property
    def interval(self) -> tuple[float, float]:
        """Bounds of the interval."""
        return wilson_interval(self.count, self.n)

    def __str__(self) -> str:
        low, high = self.interval
        return f"{100 * self.count / max(self.n, 1):.1f} ({100 * low:.1f}-{100 * high:.1f})"


@dataclass(frozen=True, kw_only=True)
class PairedTest:
    """Two detectors over the same images, by their best grasps."""

    a: str
    b: str
    a_alone: int
    b_alone: int
    p_holm: float
    """McNemar's exact test, after Holm's correction over all pairs."""


def score(detectors: Mapping[str, GraspDetector], seen: Square, fold: int | None = None) -> list[ImageScore]:
    """Return the score of every detector on a square of an image, which may be of a fold."""
    rows, image = [], seen.image
    for name, detector in detectors.items():
        found = grasps(predict(detector, image), image.depth.shape[0], TOP)
        best = seen.back(found[0])
        rows.append(
            ImageScore(
                image=image.name,
                object=image.object,
                detector=name,
                top1=right(found[:1], image.rectangles),
                top5=right(found, image.rectangles),
                iou=best_iou(found[0], image.rectangles),
                border=_at_border(found[0], image),
                labelled=bool(image.rectangles),
                fold=fold,
                u=best.u,
                v=best.v,
                angle=best.angle,
                width_px=best.width_px,
            )
        )
    return rows


def _at_border(grasp: GraspRectangle, image: LabelledImage) -> bool:
    size = image.depth.shape[0]
    return bool(min(grasp.u, grasp.v, size - 1 - grasp.u, size - 1 - grasp.v) < BORDER * size)


def rates(rows: Sequence[ImageScore], detector: str) -> dict[str, Rate]:
    """Return the rates of a detector by the name of the column: top1, top5, and best grasps at the border."""
    mine = [row for row in rows if row.detector == detector]
    labelled = [row for row in mine if row.labelled]
    of = {"top1": labelled, "top5": labelled, "border": mine}
    return {key: Rate(count=sum(getattr(row, key) for row in some), n=len(some)) for key, some in of.items()}


def fold_spread(rows: Sequence[ImageScore], detector: str) -> tuple[float, float] | None:
    """Return mean and standard deviation of `top1` over the folds; None without folds."""
    by_fold: dict[int, list[bool]] = {}
    for row in rows:
        if row.detector == detector and row.fold is not None and row.labelled:
            by_fold.setdefault(row.fold, []).append(row.top1)
    return spread(sum(right) / len(right) for right in by_fold.values()) if by_fold else None


def paired_tests(rows: Sequence[ImageScore]) -> list[PairedTest]:
    """Return the test of every two detectors."""
    names = list(dict.fromkeys(row.detector for row in rows))
    labelled = [row for row in rows if row.labelled]
    right_by = {name: {row.image: row.top1 for row in labelled if row.detector == name} for name in names}
    counts = []
    for a, b in combinations(names, 2):
        common = right_by[a].keys() & right_by[b].keys()
        pairs = [(right_by[a][image], right_by[b][image]) for image in common]
        counts.append((a, b, sum(x and not y for x, y in pairs), sum(y and not x for x, y in pairs)))
    corrected = holm([mcnemar(one, other) for _, _, one, other in counts])
    return [
        PairedTest(a=a, b=b, a_alone=one, b_alone=other, p_holm=p)
        for (a, b, one, other), p in zip(counts, corrected, strict=True)
    ]
