"""The networks by name: what can be trained, loaded and run.

All map an image (n, channels, H, W) to quality, cosine, sine and width, each (n, 1, H, W). Importing this
module does not import torch; building a network does.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import TYPE_CHECKING, Any

from mpgrasp.exceptions import ConfigError

if TYPE_CHECKING:
    from torch import nn

HEADS = ("pos", "cos", "sin", "width")
"""Outputs in this order; `<head>_output` in checkpoints."""


def _lazy(module: str, network: str, config: str) -> Callable[[Mapping[str, Any]], nn.Module]:
    def build(settings: Mapping[str, Any]) -> nn.Module:
        found = import_module(f"mpgrasp.detectors.networks.{module}")
        made: nn.Module = getattr(found, network)(getattr(found, config)(**settings))
        return made

    return build


NETWORKS: dict[str, Callable[[Mapping[str, Any]], nn.Module]] = {
    "dhrnet": _lazy("dhrnet", "DHRNet", "DHRNetConfig"),
    "tfgrasp": _lazy("tfgrasp", "TFGrasp", "TFGraspConfig"),
    "ggcnn": _lazy("ggcnn", "GGCNN", "GGCNNConfig"),
    "ggcnn2": _lazy("ggcnn", "GGCNN2", "GGCNNConfig"),
    "fcn": _lazy("fcn", "FCN", "FCNConfig"),
    "fcn_residual": _lazy("fcn", "ResidualFCN", "FCNConfig"),
    "unet": _lazy("unet", "UNet", "FCNConfig"),
}
"""Builders by name: settings -> network with fresh weights."""

INPUT_SIZE = {"ggcnn": 300}
"""Side of the input image of networks that were not designed for `depth.NETWORK_SIZE` [px]."""


def build_network(name: str, settings: Mapping[str, Any]) -> nn.Module:
    """The network of that name with fresh weights; `settings` are keyword arguments of its config.

    Raises:
        ConfigError: unknown name or settings.
    """
    if name not in NETWORKS:
        raise ConfigError("unknown network", got=name, allowed=NETWORKS)
    try:
        return NETWORKS[name](settings)
    except TypeError as error:
        raise ConfigError(f"unusable settings of {name}: {error}", got=settings) from error


RUNTIMES = ("auto", "torch", "openvino")
"""What can compute a network; see `mpgrasp.detectors.runtimes.runtime`."""
