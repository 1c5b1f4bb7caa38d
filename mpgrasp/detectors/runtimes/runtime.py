"""Runtimes, which compute a network: torch on a GPU, OpenVINO, or torch on the CPU.

"auto" takes the fastest that is to be had: CUDA where there is a GPU, else OpenVINO, in bfloat16 where the
processor has instructions for it, else torch with channels last. All of them give the same bits for the same
image, and none uses more threads than torch is told to (OMP_NUM_THREADS or torch.set_num_threads), so that
processes with one thread each do not fight for cores.
"""

from __future__ import annotations

import copy
import itertools
import logging
from contextlib import nullcontext
from typing import Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn
from torch.nn.utils import fusion

from mpgrasp.detectors.networks.weights import NetworkWeights
from mpgrasp.detectors.runtimes import RUNTIMES
from mpgrasp.detectors.runtimes.openvino import OpenVinoRuntime, openvino_precision
from mpgrasp.exceptions import ConfigError
from mpgrasp.forking import refuse_inherited_torch

Float32 = NDArray[np.float32]

_log = logging.getLogger(__name__)


class Runtime(Protocol):
    """A network that is ready to be run."""

    name: str
    """Name in two or three words, such as "openvino bf16"."""
    device: str
    """"cpu" or "cuda"."""
    cached: bool
    """True if it was compiled before, and only had to be read."""

    def __call__(self, image: Float32) -> Float32:
        """Return heads (4, H, W) for an input (channels, H, W): quality, cosine, sine, width."""
        ...


class TorchRuntime:
    """A network in single precision on the GPU, if there is one, or on the CPU.

    Args:
        weights: of the network, which is left as it is.
        plain: on the CPU and layer by layer as it was trained, which is what all else is measured against.
    """

    cached = False

    def __init__(self, weights: NetworkWeights, *, plain: bool = False) -> None:
        self.device = "cuda" if torch.cuda.is_available() and not plain else "cpu"
        self.name = "torch f32, plain" if plain else _torch_name(self.device)
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


def _torch_name(device: str) -> str:
    return "torch f32, cuda" if device == "cuda" else "torch f32"


def check_runtime(runtime: str) -> None:
    """Raise ConfigError unless there is a runtime of that name."""
    if runtime not in RUNTIMES:
        raise ConfigError("unknown runtime", got=runtime, allowed=RUNTIMES)


def runtime_name(runtime: str) -> str:
    """Return the name that `make_runtime` is going to give: "openvino bf16", say. Compiles nothing."""
    check_runtime(runtime)
    cuda = torch.cuda.is_available()
    precision = None if runtime == "torch" or (runtime == "auto" and cuda) else openvino_precision()
    if precision is not None:
        return f"openvino {precision}"
    if runtime == "openvino":
        raise ConfigError(
            "OpenVINO cannot be used here", got=runtime, allowed="auto, torch, or pip install openvino"
        )
    return _torch_name("cuda" if cuda else "cpu")


def make_runtime(weights: NetworkWeights, runtime: str = "auto") -> Runtime:
    """Return the network, ready to be run; OpenVINO compiles it, or reads what it compiled before.

    Raises:
        ConfigError: unknown runtime, or OpenVINO was asked for and cannot run this network.
    """
    if runtime_name(runtime).startswith("torch"):
        return TorchRuntime(weights)
    try:
        return OpenVinoRuntime(weights)
    except Exception as error:  # OpenVINO raises whatever its parts raise
        said = (str(error).strip().splitlines() or [type(error).__name__])[0]
        if runtime == "openvino":
            raise ConfigError(
                f"OpenVINO cannot run this network: {said}", got=weights.name, allowed="auto or torch"
            ) from error
        _log.warning("OpenVINO cannot run %s, so torch does (same maps, slower): %s", weights.name, said)
        return TorchRuntime(weights)


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
