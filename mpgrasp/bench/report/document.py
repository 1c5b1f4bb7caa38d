"""Parts of a report that the templates lay out: tables, figures and filmstrips.

Text between single backticks is code in every one of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Table:
    """A table of text; all rows are as long as the headings."""

    caption: str
    headings: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str = ""
    """Meaning of the marks in it."""

    def __post_init__(self) -> None:
        assert all(len(row) == len(self.headings) for row in self.rows), self.caption


@dataclass(frozen=True, kw_only=True)
class Figure:
    """A drawing; Markdown has its caption and its description only."""

    caption: str
    alt: str
    """Description for those who cannot see it."""
    svg: str
    """An `<svg>` element."""


@dataclass(frozen=True, kw_only=True)
class Still:
    """One image of a filmstrip."""

    source: str
    """The image as a data URI."""
    alt: str


@dataclass(frozen=True, kw_only=True)
class Filmstrip:
    """Images of one episode, beside each other."""

    caption: str
    alt: str
    stills: Sequence[Still]
