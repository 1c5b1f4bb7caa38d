"""Parameters and floating-point operations of the networks: `python -m mpgrasp.detectors.networks.cost`.

It prints docs/networks.md. Networks are counted without memory for weights and features.
"""

from __future__ import annotations

import argparse
import copy
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from mpgrasp.depth import NETWORK_SIZE
from mpgrasp.detectors.networks.registry import INPUT_SIZE, build_network

if TYPE_CHECKING:
    from torch import nn

CHANNELS = (1, 3, 4)
"""Input channels of depth, colour and both."""
SOURCES = {
    "dhrnet": "the paper; branches as in [HRNet](https://arxiv.org/abs/1908.07919)",
    "tfgrasp": "[TF-Grasp](https://arxiv.org/abs/2202.11911)",
    "ggcnn": "[GG-CNN](https://arxiv.org/abs/1804.05172)",
    "ggcnn2": "[GG-CNN2](https://doi.org/10.1177/0278364919859066)",
    "fcn": "the paper's Fig. 8; [FCN](https://arxiv.org/abs/1411.4038)",
    "fcn_residual": "the paper's Fig. 8; [residual blocks](https://arxiv.org/abs/1512.03385)",
    "unet": "the paper's Fig. 8; [U-Net](https://arxiv.org/abs/1505.04597)",
}
_TEXT = """\
# Networks

Written by `python -m mpgrasp.detectors.networks.cost > docs/networks.md`. Every network maps an image to
quality, cosine and sine of twice the angle, and width, one value a pixel. GFLOP: 2 x the multiply-adds of
convolutions and matrix products for one image of the size given; norms, activations, softmax and resizing
are not counted. More input channels only enlarge the first convolution.

{table}

- `dhrnet`, authors: width 48, `DHRNetConfig(**AUTHORS)`. The heads mix each branch before it is resized, the
  same linear map as mixing all of them afterwards; in the latter order it is 35.7 GFLOP.
- `dhrnet`, branches: the paper's fusion ablation, `head` "all", "lower" and "highest", all three without the
  shipped network's fine head (features of the stem at half resolution beside the branches, which begin at a
  quarter): it would bring back the high resolution that Fig. 9a leaves out.
- `fcn`, `fcn_residual`, `unet`: the paper gives no sizes. They have the shipped `dhrnet`'s finest resolution
  (a half), coarsest (1/32) and blocks per resolution, and nearly its parameters and GFLOP; they differ from
  each other in the residual blocks or the skip connections alone.
- `tfgrasp` is laid out for 224x224; `ggcnn` was designed for 300x300 and takes any multiple of 12, `ggcnn2`
  of 4, the others of 32.
"""


def parameters(network: nn.Module) -> int:
    """Numbers that training learns."""
    return sum(p.numel() for p in network.parameters())


def flops(network: nn.Module, channels: int, size: int) -> float:
    """2 x multiply-adds of convolutions and matrix products for one (channels, size, size) image."""
    import torch
    from torch.utils.flop_counter import FlopCounterMode

    network = copy.deepcopy(network).to("meta").eval()
    with torch.no_grad(), FlopCounterMode(display=False) as counter:
        network(torch.zeros(1, channels, size, size, device="meta"))
    return float(counter.get_total_flops())


def presets() -> Iterator[tuple[str, str, dict[str, Any]]]:
    """(network, preset, settings) of the networks in the table."""
    from mpgrasp.detectors.networks.dhrnet import AUTHORS

    yield "dhrnet", "shipped", {}
    yield "dhrnet", "authors", AUTHORS
    yield "dhrnet", "all branches (Fig. 9b)", {"head": "all", "fine_head": False}
    yield "dhrnet", "lower branches (Fig. 9a)", {"head": "lower", "fine_head": False}
    yield "dhrnet", "highest branch", {"head": "highest", "fine_head": False}
    yield "tfgrasp", "authors", {}
    yield "ggcnn", "authors", {}
    yield "ggcnn2", "authors", {}
    yield from ((name, "ablation", {}) for name in ("fcn", "fcn_residual", "unet"))


def document() -> str:
    """The text of docs/networks.md."""
    import torch

    lines = ["| network | preset | input | channels | parameters | GFLOP | source |", "|" + " --- |" * 7]
    for name, preset, settings in presets():
        size = INPUT_SIZE.get(name, NETWORK_SIZE)
        for channels in CHANNELS if not settings else CHANNELS[:1]:
            with torch.device("meta"):
                network = build_network(name, {**settings, "channels": channels})
            cells = (
                f"`{name}`",
                preset,
                f"{size}x{size}",
                channels,
                f"{parameters(network):,}",
                f"{flops(network, channels, size) / 1e9:.2f}",
                SOURCES[name],
            )
            lines.append("| " + " | ".join(map(str, cells)) + " |")
    return _TEXT.format(table="\n".join(lines))


if __name__ == "__main__":
    argparse.ArgumentParser(
        prog="python -m mpgrasp.detectors.networks.cost",
        description="Print the table of networks, their parameters and multiply-adds (docs/networks.md).",
    ).parse_args()
    print(document(), end="")
