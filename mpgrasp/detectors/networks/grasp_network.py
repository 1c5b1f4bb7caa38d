"""Base of the convolutional grasp networks: four heads, first weights, convolutions with batch norm."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from mpgrasp.detectors.networks.declaration import HEADS

BN_MOMENTUM = 0.1
"""The paper's Section IV-A."""
HEAD_STD = 0.1
"""Spread of the heads' first weights. Ten times less and cosine and sine stay at zero for hundreds of steps;
three times more and the background's quality takes as long to come down."""


class GraspNetwork(nn.Module):
    """Base of networks that compute features below the input's resolution and resize their heads to it."""

    def add_heads(self, features: int) -> None:
        """Add the four 1x1 convolutions and initialise all weights; to be called last."""
        for name in HEADS:
            self.add_module(f"{name}_output", nn.Conv2d(features, 1, 1))
        for module in self.modules():
            if isinstance(module, nn.Conv2d):
                nn.init.kaiming_normal_(module.weight, nonlinearity="relu")
        for name in HEADS:
            nn.init.normal_(getattr(self, f"{name}_output").weight, std=HEAD_STD)

    def maps(self, features: Tensor, x: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """Return the four heads, (n, 1, H, W) each, of features (n, f, h, w) for an image x."""
        heads = [getattr(self, f"{name}_output") for name in HEADS]
        # one convolution instead of four saves a tenth of a training step
        weight, bias = torch.cat([h.weight for h in heads]), torch.cat([h.bias for h in heads])
        coarse = F.conv2d(features, weight, bias).float()
        pos, cos, sin, width = torch.split(resize(coarse, x), 1, dim=1)  # of (n, 4, H, W)
        return pos, cos, sin, width


def resize(x: Tensor, like: Tensor) -> Tensor:
    """Resize, bilinearly, to the height and width of another tensor."""
    return F.interpolate(x, size=like.shape[-2:], mode="bilinear", align_corners=False)


def conv_bn(inputs: int, outputs: int, kernel: int, *, stride: int = 1, relu: bool = True) -> nn.Sequential:
    """Return a convolution that keeps the size (up to its stride), batch norm and, on request, ReLU."""
    layers: list[nn.Module] = [
        nn.Conv2d(inputs, outputs, kernel, stride=stride, padding=kernel // 2, bias=False),
        nn.BatchNorm2d(outputs, momentum=BN_MOMENTUM),
    ]
    return nn.Sequential(*layers, nn.ReLU(inplace=True)) if relu else nn.Sequential(*layers)
