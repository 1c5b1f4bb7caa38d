"""The interface of all datasets: names of images, each of which is read, or is said to be broken."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from mpgrasp.datasets.labelled_image import LabelledImage
from mpgrasp.exceptions import ConfigError, MpgraspError


class BrokenImageError(MpgraspError):
    """An image of a dataset that cannot be used: a file that is missing or torn, or no label left."""


class Reader(Protocol):
    """A dataset on disk."""

    title: str
    """Name for people."""

    @property
    def names(self) -> Sequence[str]:
        """Names of the images, in a fixed order."""
        ...

    def object_of(self, name: str) -> str:
        """Return what is on an image, so that splits by object are possible."""
        ...

    def read(self, name: str) -> LabelledImage:
        """Return an image.

        Raises:
            BrokenImageError: it cannot be used.
        """
        ...


class Subset:
    """Some images of a dataset, as a dataset: of a fold, or of all folds.

    Args:
        whole: the dataset.
        names: of the images, in the order in which they are read.
    """

    def __init__(self, whole: Reader, names: Sequence[str]) -> None:
        self.title, self.names, self._whole = whole.title, names, whole

    def object_of(self, name: str) -> str:
        """Return what is on an image."""
        return self._whole.object_of(name)

    def read(self, name: str) -> LabelledImage:
        """Return an image.

        Raises:
            BrokenImageError: it cannot be used.
        """
        return self._whole.read(name)


@dataclass
class Skipped:
    """Images that were left out, and why."""

    reasons: dict[str, str] = field(default_factory=dict)
    """By name."""

    def __str__(self) -> str:
        if not self.reasons:
            return "no image was left out"
        name, reason = next(iter(self.reasons.items()))
        if len(self.reasons) == 1:
            return f"1 image was left out, {name}: {reason}"
        return f"{len(self.reasons)} images were left out, the first one {name}: {reason}"


def usable(
    reader: Reader, skipped: Skipped, *, limit: int | None = None, strict: bool = False
) -> Iterator[LabelledImage]:
    """Yield the images of a dataset that can be used.

    Args:
        reader: of the dataset.
        skipped: is told which are left out.
        limit: number of images after which it ends.
        strict: True to stop at the first that is broken.

    Raises:
        ConfigError: there is none; or with `strict` one that is broken.
    """
    found = 0
    for name in reader.names:
        if limit is not None and found >= limit:
            break
        try:
            image = reader.read(name)
        except BrokenImageError as error:
            if strict:
                raise ConfigError(f"a broken image of {reader.title}: {error}", got=name) from error
            skipped.reasons[name] = str(error)
            continue
        found += 1
        yield image
    if not found:
        raise ConfigError(f"no usable image of {reader.title}", got=str(skipped), allowed="one or more")
