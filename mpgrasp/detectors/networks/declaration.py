"""Declaration of a network: all that the project has to know of it, written in the network's own file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

from mpgrasp.depth import NETWORK_SIZE

if TYPE_CHECKING:
    from torch import Generator, Tensor, nn

HEADS = ("pos", "cos", "sin", "width")
"""Outputs of every network in this order; `<head>_output` in checkpoints."""
MAX_CHANNELS = 4096
"""Most channels that a setting of a network may ask for; weights that ask for more are no weights."""
MAX_REPEATS = 16
"""Most blocks or modules in a row that a setting may ask for."""


class Target(NamedTuple):
    """Labels of a batch of images, each (n, H, W), on the device of the network."""

    quality: Tensor
    """In [0, 1]."""
    angle: Tensor
    """Closing direction [rad]."""
    width: Tensor
    """In units of the width head."""
    valid: Tensor
    """Bool; nothing is to be learnt from the other pixels."""


@dataclass(frozen=True, kw_only=True)
class PublishedWeights:
    """State dicts that the authors of a network have published, which can be read as they are."""

    entry: str
    """Name of a tensor that tells them from the state dicts of all other networks."""
    width_px: float
    """Opening that a width output of 1 stands for, in pixels of the network's own image [px]."""
    card: Mapping[str, str]
    """Training data, source and licence."""
    sizes: Mapping[str, tuple[str, int]] = field(default_factory=dict)
    """Settings that are read from the shape of a tensor: its name, and the axis."""
    read: Callable[[Mapping[str, Tensor]], tuple[dict[str, Any], dict[str, Tensor]]] | None = None
    """Returns the settings of such a state dict, and its tensors by the names that the network has for them;
    None where the names are the same."""


@dataclass(frozen=True, kw_only=True)
class NetworkDeclaration:
    """One network: it maps an image (n, channels, H, W) to the four `HEADS`, each (n, 1, H, W)."""

    network: Callable[[Any], nn.Module]
    """Class of the network, which is made from its config."""
    config: type[Any]
    """Config dataclass; its fields are the settings in a weights file. It has `channels`, and `size` if the
    network fits images of one size only."""
    source: str
    """Publication, in Markdown, for docs/networks.md."""
    input_size: int = NETWORK_SIZE
    """Side of the images that the network was designed for [px]."""
    multiple_of: int = 1
    """The network's maps have the size of its image if that is a multiple of this [px]."""
    variants: Mapping[str, Mapping[str, Any]] = field(default_factory=lambda: {"authors": {}})
    """Settings by name of the sizes that docs/networks.md lists; without settings, for all modalities."""
    published: PublishedWeights | None = None
    """Published state dicts, if there are any that can be read."""
    loss: Callable[[Any, Tensor, Target, Generator], Tensor] | None = None
    """Loss of the network for a batch of images (n, channels, H, W), for a network that is not trained by the
    maps that it makes of whole images; what it draws at random it draws from the generator."""

    def build(self, settings: Mapping[str, Any]) -> nn.Module:
        """Return the network with fresh weights; `settings` are keyword arguments of its config."""
        return self.network(self.config(**settings))
