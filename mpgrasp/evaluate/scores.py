"""Scores of detectors on a dataset: rates with intervals, and paired tests over the same images."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

from mpgrasp.datasets.labelled_image import LabelledImage
from mpgrasp.datasets.rectangle_metric import best_iou, right
from mpgrasp.detectors.detector import GraspDetector
from mpgrasp.evaluate.predict import grasps
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


def score(detectors: Mapping[str, GraspDetector], image: LabelledImage) -> list[ImageScore]:
    """Return the score of every detector on a square image."""
    rows = []
    for name, detector in detectors.items():
        found = grasps(detector, image, TOP)
        rows.append(
            ImageScore(
                image=image.name,
                object=image.object,
                detector=name,
                top1=right(found[:1], image.rectangles),
                top5=right(found, image.rectangles),
                iou=best_iou(found[0], image.rectangles),
                border=_at_border(found[0], image),
            )
        )
    return rows


def _at_border(grasp: GraspRectangle, image: LabelledImage) -> bool:
    size = image.depth.shape[0]
    return bool(min(grasp.u, grasp.v, size - 1 - grasp.u, size - 1 - grasp.v) < BORDER * size)


def rates(rows: Sequence[ImageScore], detector: str) -> dict[str, Rate]:
    """Return the rates of a detector by the name of the column: top1, top5, and best grasps at the border."""
    mine = [row for row in rows if row.detector == detector]
    return {
        key: Rate(count=sum(getattr(row, key) for row in mine), n=len(mine))
        for key in ("top1", "top5", "border")
    }


def paired_tests(rows: Sequence[ImageScore]) -> list[PairedTest]:
    """Return the test of every two detectors."""
    names = list(dict.fromkeys(row.detector for row in rows))
    right_by = {name: {row.image: row.top1 for row in rows if row.detector == name} for name in names}
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
