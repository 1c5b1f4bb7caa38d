"""Grasp detectors: a depth frame in, a grasp for every pixel out.

`DETECTORS` names them all: "dhrnet" is the paper's network, "oracle" reads the scene's true height map,
"heuristic" is trained on nothing, and the others are the networks that the paper compares with. Importing
this package does not import torch; making a network detector does, unless OpenVINO has compiled it before.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from mpgrasp.detectors.config import HeuristicConfig, NetworkDetectorConfig, OracleConfig
from mpgrasp.detectors.detector import GraspDetector
from mpgrasp.detectors.networks.registry import NETWORKS
from mpgrasp.detectors.runtimes import RUNTIMES
from mpgrasp.exceptions import ConfigError

DetectorConfig = NetworkDetectorConfig | HeuristicConfig | OracleConfig
"""Settings of a detector: of a network's image processing, of the heuristic, or the oracle's hand."""
_Maker = Callable[[Path | str | None, str, DetectorConfig | None], GraspDetector]


def _network(name: str) -> _Maker:
    def make(weights: Path | str | None, runtime: str, config: DetectorConfig | None) -> GraspDetector:
        from mpgrasp.detectors.network_detector import NetworkDetector

        assert config is None or isinstance(config, NetworkDetectorConfig)
        return NetworkDetector.load(name, weights, config, runtime)

    return make


def _oracle(weights: Path | str | None, runtime: str, config: DetectorConfig | None) -> GraspDetector:
    from mpgrasp.detectors.oracle import OracleDetector

    _refuse_weights("oracle", weights)
    assert config is None or isinstance(config, OracleConfig)
    return OracleDetector(config)


def _heuristic(weights: Path | str | None, runtime: str, config: DetectorConfig | None) -> GraspDetector:
    from mpgrasp.detectors.heuristic import HeuristicDetector

    _refuse_weights("heuristic", weights)
    assert config is None or isinstance(config, HeuristicConfig)
    return HeuristicDetector(config)


def _refuse_weights(name: str, weights: Path | str | None) -> None:
    if weights is not None:
        raise ConfigError(f"the {name} has no weights", got=str(weights), allowed="no weights file")


DETECTORS: dict[str, _Maker] = {
    **{name: _network(name) for name in NETWORKS},
    "heuristic": _heuristic,
    "oracle": _oracle,
}
"""Every network of the registry, the heuristic and the oracle; torch is loaded when one is made."""


def detector_defaults(name: str) -> DetectorConfig:
    """Return the settings that a detector of the registry has unless others are given; loads no torch."""
    own: dict[str, DetectorConfig] = {"oracle": OracleConfig(), "heuristic": HeuristicConfig()}
    return own.get(name) or NetworkDetectorConfig()


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
