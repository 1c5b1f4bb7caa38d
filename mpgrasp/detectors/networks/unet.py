"""U-Net, the third network of the paper's architecture ablation (Fig. 8): the FCN with skip connections.

Ronneberger, Fischer and Brox: U-Net (https://arxiv.org/abs/1505.04597): the decoder gets, concatenated to its
own, the encoder's features of each resolution.
"""

from __future__ import annotations

import torch
from torch import Tensor

from mpgrasp.detectors.networks.declaration import NetworkDeclaration
from mpgrasp.detectors.networks.fcn import FCN, FCNConfig


class UNet(FCN):
    """(n, channels, H, W) -> pos, cos, sin and width, each (n, 1, H, W); H and W are multiples of 32."""

    skips = True

    def join(self, decoded: Tensor, encoded: Tensor) -> Tensor:
        """Return both, concatenated."""
        return torch.cat([decoded, encoded], dim=1)


DECLARATIONS = {
    "unet": NetworkDeclaration(
        network=UNet,
        config=FCNConfig,
        source="the paper's Fig. 8; [U-Net](https://arxiv.org/abs/1505.04597)",
        variants={"ablation": {}},
    ),
}
