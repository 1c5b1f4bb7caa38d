"""FCN and FCN with residual blocks: the first two networks of the paper's architecture ablation (Fig. 8).

One encoder down to 1/32 of the input's resolution (max pooling) and one decoder back up (bilinear), as in
fully convolutional networks (Long, Shelhamer and Darrell, https://arxiv.org/abs/1411.4038), with blocks of
two 3x3 convolutions, plain or residual (He et al., https://arxiv.org/abs/1512.03385). The paper gives no
sizes. So that the comparison is about architecture, these share with the shipped DHRNet its finest resolution
(features and heads at half of the input's), its coarsest, its blocks per resolution and, closely, its
parameters and multiply-adds (docs/networks.md).
"""

from __future__ import annotations

from dataclasses import dataclass

from torch import Tensor, nn
from torch.nn import functional as F

from mpgrasp.detectors.networks.declaration import MAX_CHANNELS, MAX_REPEATS, NetworkDeclaration
from mpgrasp.detectors.networks.grasp_network import GraspNetwork, conv_bn, resize
from mpgrasp.exceptions import ConfigError

LEVELS = 5
"""Resolutions: 1/2, 1/4, 1/8, 1/16 and 1/32 of the input's."""


@dataclass(frozen=True, kw_only=True)
class FCNConfig:
    """Size of an FCN or a U-Net."""

    channels: int = 1
    """Input channels."""
    width: int = 15
    """Channels at half of the input's resolution; each coarser level has twice as many."""
    blocks: int = 2
    """Blocks of two convolutions at each level, down and up."""

    def __post_init__(self) -> None:
        sizes = (self.channels, self.width)
        if min(*sizes, self.blocks) < 1 or max(sizes) > MAX_CHANNELS or self.blocks > MAX_REPEATS:
            raise ConfigError(
                "unusable FCN settings",
                got=self,
                allowed=f"1 to {MAX_CHANNELS} channels, 1 to {MAX_REPEATS} blocks",
            )


class FCN(GraspNetwork):
    """(n, channels, H, W) -> pos, cos, sin and width, each (n, 1, H, W); H and W are multiples of 32."""

    residual = False
    """True if blocks add their input to their output."""
    skips = False
    """True if the decoder sees the encoder's features of its resolution."""

    def __init__(self, config: FCNConfig | None = None) -> None:
        super().__init__()
        self.config = c = config or FCNConfig()
        widths = [c.width * 2**k for k in range(LEVELS)]
        self.stem = conv_bn(c.channels, c.width, 3, stride=2)
        self.down, self.reduce, self.up = nn.ModuleList(), nn.ModuleList(), nn.ModuleList()
        for before, width in zip([c.width, *widths], widths, strict=False):
            self.down.append(self._level(before, width))
        for coarser, width in zip(widths[:0:-1], widths[-2::-1], strict=True):
            self.reduce.append(conv_bn(coarser, width, 1))
            self.up.append(self._level(width * 2 if self.skips else width, width))
        self.add_heads(c.width)

    def _level(self, inputs: int, width: int) -> nn.Sequential:
        sizes = [inputs] + [width] * (self.config.blocks - 1)
        return nn.Sequential(*(_Block(n, width, residual=self.residual) for n in sizes))

    def forward(self, x: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        features: Tensor = self.stem(x)
        encoded: list[Tensor] = []  # finest first
        for level in self.down:
            features = level(F.max_pool2d(features, 2) if encoded else features)
            encoded.append(features)
        for reduce, level, same_size in zip(self.reduce, self.up, encoded[-2::-1], strict=True):
            # fewer channels before the resizing: the same linear map at a quarter of the cost
            features = level(self.join(resize(reduce(features), same_size), same_size))
        return self.maps(features, x)

    def join(self, decoded: Tensor, encoded: Tensor) -> Tensor:
        """Return the decoder's next input; `encoded` are the encoder's features of the same resolution."""
        return decoded


class ResidualFCN(FCN):
    """FCN with residual blocks."""

    residual = True


class _Block(nn.Module):
    def __init__(self, inputs: int, width: int, *, residual: bool) -> None:
        super().__init__()
        self.body = nn.Sequential(*conv_bn(inputs, width, 3), *conv_bn(width, width, 3, relu=False))
        self.skip: nn.Module | None = None
        if residual:
            self.skip = nn.Identity() if inputs == width else conv_bn(inputs, width, 1, relu=False)

    def forward(self, x: Tensor) -> Tensor:
        y: Tensor = self.body(x)
        return F.relu(y if self.skip is None else y + self.skip(x), inplace=True)


DECLARATIONS = {
    "fcn": NetworkDeclaration(
        network=FCN,
        config=FCNConfig,
        source="the paper's Fig. 8; [FCN](https://arxiv.org/abs/1411.4038)",
        variants={"ablation": {}},
    ),
    "fcn_residual": NetworkDeclaration(
        network=ResidualFCN,
        config=FCNConfig,
        source="the paper's Fig. 8; [residual blocks](https://arxiv.org/abs/1512.03385)",
        variants={"ablation": {}},
    ),
}
