"""A network that the inference server computes, for one of the processes that share it."""

from __future__ import annotations

import os
from multiprocessing import AuthenticationError
from multiprocessing.connection import Client
from multiprocessing.shared_memory import SharedMemory
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mpgrasp.detectors.networks.calibration import Calibration
from mpgrasp.detectors.networks.input import NetworkInput
from mpgrasp.detectors.runtimes.compiled import CompiledNetwork
from mpgrasp.detectors.runtimes.server import ADDRESS, HEADS, read, write
from mpgrasp.exceptions import ConfigError, MpgraspError

Float32 = NDArray[np.float32]


class SharedRuntime:
    """A network in the server's process.

    Args:
        name: in the registry of networks.
        weights: file of its weights.

    Raises:
        ConfigError: there is no server, or it is gone.
        WeightsError: the server cannot use the file.
    """

    def __init__(self, name: str, weights: Path) -> None:
        key, _, address = os.environ.get(ADDRESS, "").partition("@")
        if not address:
            raise ConfigError(
                "no inference server here",
                got="shared",
                allowed="--runtime shared of a run, which starts one",
            )
        try:
            self._connection = Client(address, authkey=bytes.fromhex(key))
            self._connection.send((name, str(weights.resolve())))
            told = self._connection.recv()
        except (OSError, EOFError, AuthenticationError) as error:
            raise _gone(error) from error
        if isinstance(told, MpgraspError):
            raise told
        self.name, self.device, self.cached = f"shared {told['runtime']}", told["device"], told["cached"]
        self.input, self.width_px = NetworkInput(**told["input"]), float(told["width_px"])
        scale = told["calibration"]
        self.calibration = None if scale is None else Calibration(**scale)
        self._memory = SharedMemory(told["memory"])
        self._shape = self.input.channels, self.input.size, self.input.size

    def __call__(self, image: Float32) -> Float32:
        x = np.ascontiguousarray(image, np.float32)
        if x.shape != self._shape:
            raise ConfigError("an image of another size", got=x.shape, allowed=self._shape)
        try:
            write(self._memory, 0, x)
            self._connection.send("compute")
            self._connection.recv()
        except (OSError, EOFError, ValueError) as error:
            raise _gone(error) from error
        return read(self._memory, x.size, (HEADS, *self._shape[1:]))

    def close(self) -> None:
        """Leave the server, which frees the memory."""
        self._connection.close()
        self._memory.close()


def shared_network(name: str, weights: Path) -> CompiledNetwork:
    """Return a network that the server computes.

    Raises:
        ConfigError: there is no server.
        WeightsError: it cannot use the file.
    """
    runtime = SharedRuntime(name, weights)
    return CompiledNetwork(
        name=name,
        input=runtime.input,
        width_px=runtime.width_px,
        runtime=runtime,
        weights=weights,
        calibration=runtime.calibration,
    )


def _gone(error: Exception) -> MpgraspError:
    said: Any = str(error) or type(error).__name__
    return ConfigError(f"the inference server is gone ({said})", got="--runtime shared", allowed="auto")
