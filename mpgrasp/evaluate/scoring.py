"""Scoring of detectors on the images of a dataset, with what a report shows of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from mpgrasp.datasets.reader import Reader, Skipped, usable
from mpgrasp.detectors.detector import GraspDetector
from mpgrasp.evaluate.predict import Square, square
from mpgrasp.evaluate.scores import ImageScore, score

SHOWN = 6
"""Images whose predictions are drawn: the first ones."""
WORST = 12
"""Images on the sheet of those that went worst."""


@dataclass
class Scored:
    """What became of the images of a dataset."""

    rows: list[ImageScore] = field(default_factory=list)
    skipped: Skipped = field(default_factory=Skipped)
    units: set[str] = field(default_factory=set)
    """Units in which depth was stored."""
    shown: list[Square] = field(default_factory=list)
    """The first images."""
    _worst: list[tuple[int, float, str, Square]] = field(default_factory=list)

    @property
    def worst(self) -> list[Square]:
        """Images of which the detectors got least, the worst first."""
        return [entry[-1] for entry in self._worst]

    @property
    def images(self) -> int:
        """Number of images."""
        return len({row.image for row in self.rows})

    def add(
        self,
        reader: Reader,
        detectors: Mapping[str, GraspDetector],
        *,
        side: float | None = None,
        limit: int | None = None,
        strict: bool = False,
        levelled: bool = False,
        folds: Mapping[str, int] | None = None,
    ) -> None:
        """Score detectors on the images of a reader.

        Args:
            reader: of the dataset, or of a fold of it.
            detectors: by name.
            side: of the square around the labels [px]; None for the largest one in the middle.
            limit: number of images.
            levelled: True if the table of every image is levelled.
            strict: True to end at the first image that is broken.
            folds: fold of each image, from 0.

        Raises:
            ConfigError: no image can be used; or with `strict` one cannot.
        """
        for image in usable(reader, self.skipped, limit=limit, strict=strict):
            seen = square(image, side, levelled=levelled)
            rows = score(detectors, seen, None if folds is None else folds[image.name] + 1)
            self.rows += rows
            self.units.add(image.unit)
            if len(self.shown) < SHOWN:
                self.shown.append(seen)
            self._rank(seen, rows)

    def _rank(self, seen: Square, rows: list[ImageScore]) -> None:
        wrong = [row for row in rows if row.labelled and not row.top1]
        if wrong:
            entry = (-len(wrong), min(row.iou for row in wrong), seen.image.name, seen)
            self._worst = sorted([*self._worst, entry], key=lambda item: item[:3])[:WORST]
