"""Laws of the U-Net's skip connections."""

from __future__ import annotations

import torch

from mpgrasp.detectors.networks.fcn import FCNConfig
from mpgrasp.detectors.networks.unet import UNet


def test_the_decoder_gets_the_encoder_s_features_of_each_resolution() -> None:
    network = UNet(FCNConfig(width=3, blocks=1)).eval()
    encoded: list[torch.Tensor] = []
    joined: list[torch.Tensor] = []
    for level in network.down:
        level.register_forward_hook(lambda _, __, y: encoded.append(y))
    for level in network.up:
        level.register_forward_hook(lambda _, args, __: joined.append(args[0]))
    with torch.inference_mode():
        network(torch.randn(1, 1, 64, 64))
    for got, skip in zip(joined, encoded[-2::-1], strict=True):
        assert torch.equal(got[:, got.shape[1] // 2 :], skip)
