"""Grasp detectors: a depth frame in, a grasp for every pixel out.

`DETECTORS` names them all. "dhrnet" is the paper's network; "ggcnn" is GG-CNN2, trained here on the same data
(the published GG-CNN and GG-CNN2 files load through `weights`); "oracle" reads the scene's true height map.
Importing this package does not import torch; making a network detector does.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from mpgrasp.detectors.detector import GraspDetector
from mpgrasp.exceptions import ConfigError

__all__ = ["DETECTORS", "GraspDetector", "make_detector"]


def _network(name: str) -> Callable[[Path | str | None], GraspDetector]:
    def make(weights: Path | str | None) -> GraspDetector:
        from mpgrasp.detectors.network_detector import NetworkDetector

        return NetworkDetector.load(name, weights)

    return make


def _oracle(weights: Path | str | None) -> GraspDetector:
    from mpgrasp.detectors.oracle import OracleDetector

    if weights is not None:
        raise ConfigError("the oracle has no weights", got=str(weights), allowed="no weights file")
    return OracleDetector()


DETECTORS: dict[str, Callable[[Path | str | None], GraspDetector]] = {
    "dhrnet": _network("dhrnet"),
    "ggcnn": _network("ggcnn"),
    "oracle": _oracle,
}


def make_detector(name: str, weights: Path | str | None = None) -> GraspDetector:
    """The detector of that name; `weights` replaces the shipped file.

    Raises:
        ConfigError: there is no such detector, or it takes no weights.
        WeightsError: the weights are missing, unreadable or made for another network.
    """
    if name not in DETECTORS:
        raise ConfigError("unknown detector", got=name, allowed=DETECTORS)
    return DETECTORS[name](weights)
