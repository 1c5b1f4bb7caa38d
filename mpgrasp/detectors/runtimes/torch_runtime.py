"""Networks in torch: on a GPU where there is one, or on the CPU."""

from __future__ import annotations

import copy
import itertools
from collections.abc import Sequence
from contextlib import nullcontext

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn
from torch.nn.utils import fusion

from mpgrasp.detectors.networks.weights import NetworkWeights
from mpgrasp.forking import refuse_inherited_torch

Float32 = NDArray[np.float32]

BATCH = 16
"""Images that are computed at once where several processes share a network."""


class TorchRuntime:
    """A network in single precision on the GPU, if there is one, or on the CPU.

    Args:
        weights: of the network, which is left as it is.
        plain: on the CPU and layer by layer as it was trained, which is what all else is measured against.
    """

    cached = False

    def __init__(self, weights: NetworkWeights, *, plain: bool = False) -> None:
        self.device = "cuda" if torch.cuda.is_available() and not plain else "cpu"
        self.name = "torch f32, plain" if plain else torch_name(self.device)
        network = copy.deepcopy(weights.network).eval().to(self.device)
        # convolutions on the CPU are a third faster with channels last
        self._layout = torch.contiguous_format if plain else torch.channels_last
        network = network if plain else fold_batch_norms(network)
        self._network = network.to(memory_format=self._layout)  # type: ignore[call-overload]

    def __call__(self, image: Float32) -> Float32:
        refuse_inherited_torch()
        x = torch.from_numpy(np.ascontiguousarray(image))[None].to(self.device, memory_format=self._layout)
        # without these, cuDNN rounds to 10 bits and may take another algorithm at the next call
        exact = torch.backends.cudnn.flags(
            enabled=True, benchmark=False, deterministic=True, allow_tf32=False
        )
        with torch.inference_mode(), exact if self.device == "cuda" else nullcontext():
            heads = torch.cat(tuple(self._network(x)), dim=1)
        return np.asarray(heads[0].float().cpu().numpy(), np.float32)


class TorchBatch:
    """A network on several images at once, in bfloat16 on a GPU, in single precision on the CPU.

    Every batch is filled up to the same size, so that the heads of an image depend on that image alone,
    however many others come with it.

    Args:
        weights: of the network, which is left as it is.
        size: images of a batch.
        device: "cuda" or "cpu"; by default the GPU if there is one.
    """

    cached = False

    def __init__(self, weights: NetworkWeights, size: int = BATCH, device: str | None = None) -> None:
        self.device = device or ("cuda" if torch.cuda.is_available() else "cpu")
        self.size = size
        self._kind = torch.bfloat16 if self.device == "cuda" else torch.float32
        precision = "bf16" if self.device == "cuda" else "f32"
        self.name = f"torch {precision}, {self.device}, {size} at once"
        image = weights.input
        self._images = torch.zeros((size, image.channels, image.size, image.size), dtype=torch.float32)
        network = fold_batch_norms(copy.deepcopy(weights.network).eval())
        self._network = network.to(self.device, self._kind)

    def __call__(self, image: Float32) -> Float32:
        return self.all_of([image])[0]

    def all_of(self, images: Sequence[Float32]) -> list[Float32]:
        """Return heads (4, H, W) for each input (channels, H, W), in their order."""
        refuse_inherited_torch()
        heads: list[Float32] = []
        exact = torch.backends.cudnn.flags(enabled=True, benchmark=False, deterministic=True)
        with torch.inference_mode(), exact if self.device == "cuda" else nullcontext():
            for start in range(0, len(images), self.size):
                part = images[start : start + self.size]
                self._images.zero_()
                for k, image in enumerate(part):
                    self._images[k] = torch.from_numpy(np.ascontiguousarray(image))
                found = torch.cat(tuple(self._network(self._images.to(self.device, self._kind))), dim=1)
                heads += [np.asarray(found[k].float().cpu().numpy(), np.float32) for k in range(len(part))]
        return heads


def torch_name(device: str) -> str:
    """Return the name of a runtime on a device: "torch f32, cuda"."""
    return "torch f32, cuda" if device == "cuda" else "torch f32"


def fold_batch_norms(network: nn.Module) -> nn.Module:
    """Make one convolution of each that a batch norm follows: same function, less time."""
    for name, child in network.named_children():
        if isinstance(child, nn.Sequential):
            layers = list(child)
            for k, (first, second) in enumerate(itertools.pairwise(layers)):
                if isinstance(first, nn.Conv2d) and isinstance(second, nn.BatchNorm2d):
                    layers[k], layers[k + 1] = fusion.fuse_conv_bn_eval(first, second), nn.Identity()
            setattr(network, name, nn.Sequential(*layers))
        fold_batch_norms(getattr(network, name))
    return network
