"""Parameters and floating-point operations of the networks: `python -m mpgrasp.detectors.networks.cost`.

It prints docs/networks.md. Networks are counted without memory for weights and features.
"""

from __future__ import annotations

import argparse
import copy
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from mpgrasp.detectors.networks.registry import NETWORKS, build_network, declaration

if TYPE_CHECKING:
    from torch import nn

CHANNELS = (1, 3, 4)
"""Input channels of depth, colour and both."""
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
- `lenz` judges 47,040 rectangles and the best 100 of them again, `pinto` 784 patches of 72 px. "authors" of
  `pinto` is AlexNet on as many patches, resized to 227 px; the authors looked at fewer of them, at random.
- `tfgrasp`, `lenz` and `pinto` are laid out for 224x224; `ggcnn` was designed for 300x300 and takes any
  multiple of 12, `ggcnn2` and `grconvnet` of 4, the others of 32.
"""


def parameters(network: nn.Module) -> int:
    """Return the number of values that training learns."""
    return sum(p.numel() for p in network.parameters())


def flops(network: nn.Module, channels: int, size: int) -> float:
    """Return 2 x multiply-adds of convolutions and matrix products for a (channels, size, size) image."""
    import torch
    from torch.utils.flop_counter import FlopCounterMode

    network = copy.deepcopy(network).to("meta").eval()
    with torch.no_grad(), FlopCounterMode(display=False) as counter:
        network(torch.zeros(1, channels, size, size, device="meta"))
    return float(counter.get_total_flops())


def variants() -> Iterator[tuple[str, str, dict[str, Any]]]:
    """Yield (network, variant, settings) of the rows in the table."""
    for name in NETWORKS:
        for variant, settings in declaration(name).variants.items():
            yield name, variant, dict(settings)


def document() -> str:
    """Return the text of docs/networks.md."""
    import torch

    lines = ["| network | preset | input | channels | parameters | GFLOP | source |", "|" + " --- |" * 7]
    for name, variant, settings in variants():
        declared = declaration(name)
        size = declared.input_size
        for channels in CHANNELS if not settings else CHANNELS[:1]:
            with torch.device("meta"):
                network = build_network(name, {**settings, "channels": channels})
            cells = (
                f"`{name}`",
                variant,
                f"{size}x{size}",
                channels,
                f"{parameters(network):,}",
                f"{flops(network, channels, size) / 1e9:.2f}",
                declared.source,
            )
            lines.append("| " + " | ".join(map(str, cells)) + " |")
    return _TEXT.format(table="\n".join(lines))


if __name__ == "__main__":
    argparse.ArgumentParser(
        prog="python -m mpgrasp.detectors.networks.cost",
        description="Print the table of networks, their parameters and multiply-adds (docs/networks.md).",
    ).parse_args()
    print(document(), end="")
