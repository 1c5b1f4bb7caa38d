"""Table II of the paper: accuracy on Cornell by the rectangle metric [%], as its authors report it."""

from __future__ import annotations

from typing import NamedTuple


class PaperRow(NamedTuple):
    """One row of Table II."""

    method: str
    channels: str
    """d, rgb or rgbd."""
    iw: float | None
    """Image-wise [%]; None where it is not told."""
    ow: float | None
    """Object-wise [%]."""


TABLE_II = (
    PaperRow("GG-CNN", "d", 73.0, 69.0),
    PaperRow("GR-ConvNet", "d", 93.2, 94.3),
    PaperRow("GR-ConvNet", "rgb", 96.6, 95.5),
    PaperRow("GR-ConvNet", "rgbd", 97.7, 96.6),
    PaperRow("TF-Grasp", "d", 95.2, 94.9),
    PaperRow("TF-Grasp", "rgb", 96.78, 95.0),
    PaperRow("TF-Grasp", "rgbd", 97.99, 96.7),
    PaperRow("DHRNet", "d", 98.86, 96.5),
    PaperRow("DHRNet", "rgb", 98.05, 96.5),
    PaperRow("DHRNet", "rgbd", 99.17, 97.3),
)
"""Rows of the methods that are here; the paper has nine more."""
