"""Runtimes, which compute a network: torch on a GPU, OpenVINO, or torch on the CPU.

"auto" takes the fastest that is to be had: CUDA where there is a GPU, else OpenVINO, in bfloat16 where the
processor has instructions for it, else torch with channels last. All of them give the same bits for the same
image, and none uses more threads than torch is told to (OMP_NUM_THREADS or torch.set_num_threads), so that
processes with one thread each do not fight for cores. Importing this module does not import torch; nor does a
network that OpenVINO has compiled before.
"""

from __future__ import annotations

import logging
import sys
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from mpgrasp.detectors.runtimes import RUNTIMES, SHARED
from mpgrasp.detectors.runtimes.openvino import OpenVinoRuntime, openvino_precision
from mpgrasp.exceptions import ConfigError
from mpgrasp.extras import is_installed

if TYPE_CHECKING:
    from mpgrasp.detectors.networks.weights import NetworkWeights

Float32 = NDArray[np.float32]

_DRIVERS = (Path("/dev/nvidiactl"), Path("/dev/dxg"), Path("/dev/kfd"))
"""Where Linux, its subsystem for Windows, and AMD's driver show that there is a GPU."""
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


def check_runtime(runtime: str) -> None:
    """Raise ConfigError unless there is a runtime of that name."""
    if runtime not in RUNTIMES:
        raise ConfigError("unknown runtime", got=runtime, allowed=RUNTIMES)


def runtime_name(runtime: str) -> str:
    """Return the name that `make_runtime` is going to give: "openvino bf16", say. Compiles nothing."""
    check_runtime(runtime)
    if runtime == SHARED:
        raise ConfigError("a network that is shared comes from a weights file", got=runtime, allowed="auto")
    cuda = has_cuda()
    precision = None if runtime == "torch" or (runtime == "auto" and cuda) else openvino_precision()
    if precision is not None:
        return f"openvino {precision}"
    if runtime == "openvino":
        raise ConfigError(
            "OpenVINO cannot be used here", got=runtime, allowed="auto, torch, or pip install openvino"
        )
    return "torch f32, cuda" if cuda else "torch f32"


def has_cuda() -> bool:
    """True if torch can compute on a GPU; imports it only where that may be."""
    if not is_installed("torch"):
        return False
    if "torch" not in sys.modules:
        try:
            built_without = metadata.version("torch").endswith("+cpu")
        except metadata.PackageNotFoundError:
            return False
        if built_without or (sys.platform == "linux" and not any(map(Path.exists, _DRIVERS))):
            return False
    import torch

    return bool(torch.cuda.is_available())


def make_runtime(weights: NetworkWeights, runtime: str = "auto") -> Runtime:
    """Return the network, ready to be run; OpenVINO compiles it, or reads what it compiled before.

    Raises:
        ConfigError: unknown runtime, or OpenVINO was asked for and cannot run this network.
    """
    from mpgrasp.detectors.runtimes.torch_runtime import TorchRuntime

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
