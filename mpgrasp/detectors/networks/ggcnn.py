"""GG-CNN and GG-CNN2 as published, so that their state dicts load unchanged.

Morrison, Corke and Leitner: Closing the Loop for Robotic Grasping (RSS 2018), and Learning robust, real-time,
reactive robotic grasping (IJRR 2019); https://github.com/dougsm/ggcnn.
"""

from __future__ import annotations

from dataclasses import dataclass

from torch import Tensor, nn
from torch.nn import functional as F

from mpgrasp.detectors.networks.declaration import HEADS, MAX_CHANNELS, NetworkDeclaration, PublishedWeights
from mpgrasp.detectors.networks.transposed import PhasedTranspose
from mpgrasp.exceptions import ConfigError


@dataclass(frozen=True, kw_only=True)
class GGCNNConfig:
    """Settings of either; their sizes are as published."""

    channels: int = 1
    """Input channels."""

    def __post_init__(self) -> None:
        if not 1 <= self.channels <= MAX_CHANNELS:
            raise ConfigError("unusable GG-CNN settings", got=self, allowed=f"1 to {MAX_CHANNELS} channels")


class _GGCNN(nn.Module):
    def __init__(self, config: GGCNNConfig, features: int, kernel: int) -> None:
        super().__init__()
        self.config = config
        for head in HEADS:
            self.add_module(f"{head}_output", nn.Conv2d(features, 1, kernel))

    def _initialise(self) -> None:
        for module in self.modules():
            if isinstance(module, nn.Conv2d | nn.ConvTranspose2d):
                nn.init.xavier_uniform_(module.weight)

    def _maps(self, features: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        pos, cos, sin, width = (getattr(self, f"{head}_output")(features).float() for head in HEADS)
        return pos, cos, sin, width


class GGCNN(_GGCNN):
    """(n, channels, H, W) -> pos, cos, sin and width, each (n, 1, H, W).

    H and W are multiples of 12; it was designed for 300.
    """

    def __init__(self, config: GGCNNConfig | None = None) -> None:
        config = config or GGCNNConfig()
        super().__init__(config, features=32, kernel=2)
        self.conv1 = nn.Conv2d(config.channels, 32, 9, stride=3, padding=3)
        self.conv2 = nn.Conv2d(32, 16, 5, stride=2, padding=2)
        self.conv3 = nn.Conv2d(16, 8, 3, stride=2, padding=1)
        self.convt1 = PhasedTranspose(8, 8, 3, stride=2, padding=1, output_padding=1)
        self.convt2 = PhasedTranspose(8, 16, 5, stride=2, padding=2, output_padding=1)
        self.convt3 = PhasedTranspose(16, 32, 9, stride=3, padding=3, output_padding=1)
        self._initialise()

    def forward(self, x: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        for layer in (self.conv1, self.conv2, self.conv3, self.convt1, self.convt2, self.convt3):
            x = F.relu(layer(x))
        return self._maps(x)


class GGCNN2(_GGCNN):
    """(n, channels, H, W) -> pos, cos, sin and width, each (n, 1, H, W); H and W are multiples of 4."""

    def __init__(self, config: GGCNNConfig | None = None) -> None:
        config = config or GGCNNConfig()
        super().__init__(config, features=16, kernel=1)
        self.features = nn.Sequential(
            *_conv_relu(config.channels, 16, 11),
            *_conv_relu(16, 16, 5),
            nn.MaxPool2d(2),
            *_conv_relu(16, 16, 5),
            *_conv_relu(16, 16, 5),
            nn.MaxPool2d(2),
            *_conv_relu(16, 32, 5, dilation=2),
            *_conv_relu(32, 32, 5, dilation=4),
            nn.UpsamplingBilinear2d(scale_factor=2),
            *_conv_relu(32, 16, 3),
            nn.UpsamplingBilinear2d(scale_factor=2),
            *_conv_relu(16, 16, 3),
        )
        self._initialise()

    def forward(self, x: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        return self._maps(self.features(x))


def _conv_relu(inputs: int, outputs: int, kernel: int, dilation: int = 1) -> tuple[nn.Module, nn.Module]:
    padding = kernel // 2 * dilation
    return nn.Conv2d(inputs, outputs, kernel, padding=padding, dilation=dilation), nn.ReLU(inplace=True)


_PUBLISHED_WIDTH_PX = 150.0
_PUBLISHED_CARD = {
    "data": "Cornell",
    "source": "https://github.com/dougsm/ggcnn",
    "licence": "BSD-3-Clause",
}

DECLARATIONS = {
    "ggcnn": NetworkDeclaration(
        network=GGCNN,
        config=GGCNNConfig,
        source="[GG-CNN](https://arxiv.org/abs/1804.05172)",
        input_size=300,
        multiple_of=12,
        published=PublishedWeights(
            entry="convt3.weight",
            width_px=_PUBLISHED_WIDTH_PX,
            card=_PUBLISHED_CARD,
            sizes={"channels": ("conv1.weight", 1)},
        ),
    ),
    "ggcnn2": NetworkDeclaration(
        network=GGCNN2,
        config=GGCNNConfig,
        source="[GG-CNN2](https://doi.org/10.1177/0278364919859066)",
        multiple_of=4,
        published=PublishedWeights(
            entry="features.0.weight",
            width_px=_PUBLISHED_WIDTH_PX,
            card=_PUBLISHED_CARD,
            sizes={"channels": ("features.0.weight", 1)},
        ),
    ),
}
