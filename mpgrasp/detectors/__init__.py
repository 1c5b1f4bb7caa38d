"""Grasp detectors: a depth frame in, a grasp for every pixel out.

`DETECTORS` names them all: "dhrnet" is the paper's network, "oracle" reads the scene's true height map, and
the others are the networks that the paper compares with. Importing this package does not import torch; making
a network detector does.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from mpgrasp.detectors.config import NetworkDetectorConfig, OracleConfig
from mpgrasp.detectors.detector import GraspDetector
from mpgrasp.detectors.networks.registry import NETWORKS
from mpgrasp.detectors.runtimes import RUNTIMES
from mpgrasp.exceptions import ConfigError

DetectorConfig = NetworkDetectorConfig | OracleConfig
"""Settings of a detector: those of a network's image processing, or the hand that the oracle knows."""
_Maker = Callable[[Path | str | None, str, DetectorConfig | None], GraspDetector]


def _network(name: str) -> _Maker:
    def make(weights: Path | str | None, runtime: str, config: DetectorConfig | None) -> GraspDetector:
        from mpgrasp.detectors.network_detector import NetworkDetector

        assert not isinstance(config, OracleConfig)
        return NetworkDetector.load(name, weights, config, runtime)

    return make


def _oracle(weights: Path | str | None, runtime: str, config: DetectorConfig | None) -> GraspDetector:
    from mpgrasp.detectors.oracle import OracleDetector

    if weights is not None:
        raise ConfigError("the oracle has no weights", got=str(weights), allowed="no weights file")
    assert not isinstance(config, NetworkDetectorConfig)
    return OracleDetector(config)


DETECTORS: dict[str, _Maker] = {
    **{name: _network(name) for name in NETWORKS},
    "oracle": _oracle,
}
"""Every network of the registry, and the oracle; torch is loaded when one is made."""


def detector_defaults(name: str) -> DetectorConfig:
    """Return the settings that a detector of the registry has unless others are given; loads no torch."""
    return OracleConfig() if name == "oracle" else NetworkDetectorConfig()


def make_detector(
    name: str,
    weights: Path | str | None = None,
    runtime: str = "auto",
    config: DetectorConfig | None = None,
) -> GraspDetector:
    """Return the detector of that name; `weights` replaces the shipped file, `runtime` computes a network.

    Raises:
        ConfigError: there is no such detector or runtime, or it takes no weights.
        WeightsError: the weights are missing, unreadable or made for another network.
    """
    if name not in DETECTORS:
        raise ConfigError("unknown detector", got=name, allowed=DETECTORS)
    if runtime not in RUNTIMES:
        raise ConfigError("unknown runtime", got=runtime, allowed=RUNTIMES)
    return DETECTORS[name](weights, runtime, config)
