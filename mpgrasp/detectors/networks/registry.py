"""Networks by name: what can be trained, loaded and run.

A network is declared in its own file. To add one, write a module with `DECLARATIONS` and name it here.
Importing this module does not import torch; asking for a declaration does.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mpgrasp import paths
from mpgrasp.detectors.networks.declaration import NetworkDeclaration
from mpgrasp.exceptions import ConfigError
from mpgrasp.forking import refuse_inherited_torch

if TYPE_CHECKING:
    from torch import nn

NETWORKS: dict[str, str] = {
    "dhrnet": "mpgrasp.detectors.networks.dhrnet",
    "tfgrasp": "mpgrasp.detectors.networks.tfgrasp",
    "ggcnn": "mpgrasp.detectors.networks.ggcnn",
    "ggcnn2": "mpgrasp.detectors.networks.ggcnn",
    "grconvnet": "mpgrasp.detectors.networks.grconvnet",
    "lenz": "mpgrasp.detectors.networks.lenz",
    "pinto": "mpgrasp.detectors.networks.pinto",
    "fcn": "mpgrasp.detectors.networks.fcn",
    "fcn_residual": "mpgrasp.detectors.networks.fcn",
    "unet": "mpgrasp.detectors.networks.unet",
}
"""Module whose `DECLARATIONS` hold the network of each name."""
OPENING_FULLY = frozenset({"pinto"})
"""Networks that claim no opening: a detector claims all of the hand's stroke for them."""


def check_network(name: str) -> None:
    """Raise ConfigError unless there is a network of that name."""
    if name not in NETWORKS:
        raise ConfigError("unknown network", got=name, allowed=NETWORKS)


def default_weights(name: str) -> Path:
    """Return the path of a network's shipped weights."""
    return paths.WEIGHTS / f"{name}.safetensors"


def declaration(name: str) -> NetworkDeclaration:
    """Return what its file declares of a network.

    Raises:
        ConfigError: unknown name.
    """
    check_network(name)
    found: NetworkDeclaration = import_module(NETWORKS[name]).DECLARATIONS[name]
    return found


def build_network(name: str, settings: Mapping[str, Any]) -> nn.Module:
    """Return the network of that name with fresh weights; `settings` are keyword arguments of its config.

    Raises:
        ConfigError: unknown name or settings, or a process that torch would hang in.
    """
    declared = declaration(name)
    refuse_inherited_torch()
    try:
        return declared.build(settings)
    except TypeError as error:
        raise ConfigError(f"unusable settings of {name}: {error}", got=settings) from error
