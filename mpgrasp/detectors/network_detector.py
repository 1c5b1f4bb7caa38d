"""A network as a grasp detector: depth image, and colour where the network reads it -> network -> grasp map.

Post-processing follows the published code (https://github.com/dougsm/ggcnn, https://github.com/dougsm/mvp_grasp):
the quality is smoothed with 2 px, the angle and the width with 1 px. Cosine and sine of the doubled angle are
smoothed before the angle is taken from them, because smoothed angles are wrong where they wrap.
"""

from __future__ import annotations

import logging
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.typing import NDArray

from mpgrasp.depth import DepthFrame, inpaint
from mpgrasp.detectors.central_square import central_square, empty_map, says_something
from mpgrasp.detectors.config import NetworkDetectorConfig
from mpgrasp.detectors.networks.registry import OPENING_FULLY, check_network, default_weights
from mpgrasp.detectors.runtimes import SHARED
from mpgrasp.detectors.runtimes.compiled import (
    CompiledNetwork,
    fingerprint,
    of_weights,
    read_in_torch,
    remember,
    without_torch,
)
from mpgrasp.detectors.runtimes.runtime import Runtime, make_runtime, runtime_name
from mpgrasp.exceptions import ConfigError, WeightsError
from mpgrasp.grasp import GraspMap
from mpgrasp.height_map import HeightMap
from mpgrasp.robot.hand import GRIPPER_MAX_WIDTH

if TYPE_CHECKING:
    from mpgrasp.detectors.networks.weights import NetworkWeights

Float32 = NDArray[np.float32]

LARGEST = 1e6
"""Outputs of a network beyond this, or not finite, are no outputs; trained ones are around 1."""

_log = logging.getLogger(__name__)


class NetworkDetector:
    """A grasp network behind the `GraspDetector` protocol. It keeps nothing from one frame to the next.

    Args:
        weights: the network, or one that was compiled before.
        config: image processing before and after it.
        runtime: what computes it: "auto", "torch" or "openvino", or something that is ready to.
        mark: fingerprint of the file that they were read from, if it is one: by that they are found compiled.

    Raises:
        ConfigError: unknown runtime, or OpenVINO where there is none.
    """

    def __init__(
        self,
        weights: NetworkWeights | CompiledNetwork,
        config: NetworkDetectorConfig | None = None,
        runtime: str | Runtime = "auto",
        mark: str | None = None,
    ) -> None:
        self.name, self._input, self._width_px = weights.name, weights.input, weights.width_px
        self.config = config or NetworkDetectorConfig()
        self._calibration = weights.calibration if self.config.calibrated else None
        self.reads_truth, self.reads_colour = False, weights.input.reads_colour
        self._network, self._mark, self._asked = weights, mark, runtime
        self._runtime: Runtime | None = None
        self._name = runtime_name(runtime) if isinstance(runtime, str) else runtime.name
        self._seconds = 0.0

    @classmethod
    def load(
        cls,
        name: str,
        weights: Path | str | None = None,
        config: NetworkDetectorConfig | None = None,
        runtime: str | Runtime = "auto",
    ) -> NetworkDetector:
        """Return the detector of that name with weights from a file, by default the shipped ones.

        Raises:
            ConfigError: unknown runtime, or OpenVINO where there is none.
            WeightsError: the file is missing, unreadable or made for another network.
        """
        check_network(name)
        file = default_weights(name) if weights is None else Path(weights)
        if weights is None and not file.is_file():
            raise WeightsError(
                f"no weights are shipped for {name}",
                allowed=f"--weights FILE; python -m mpgrasp.training train {name} makes one",
            )
        if runtime == SHARED:
            from mpgrasp.detectors.runtimes.shared import shared_network

            shared = shared_network(name, file)
            return cls(shared, config, shared.runtime)
        if isinstance(runtime, str) and runtime_name(runtime).startswith("openvino"):
            clock = time.perf_counter()
            compiled = without_torch(name, file)
            if compiled is not None:
                detector = cls(compiled, config, compiled.runtime)
                detector._seconds = time.perf_counter() - clock
                return detector
        mark = fingerprint(file)
        read = read_in_torch(name, file)
        return cls(read, config, runtime, mark if mark == fingerprint(file) else None)

    @property
    def weights(self) -> NetworkWeights:
        """The network in torch, read anew where a compiled one is used."""
        if isinstance(self._network, CompiledNetwork):
            return read_in_torch(self.name, self._network.weights)
        return self._network

    @property
    def runtime(self) -> str:
        """Runtime that computes the network, in two or three words: "openvino bf16", "torch f32, cuda"."""
        return self._name if self._runtime is None else self._runtime.name

    @property
    def device(self) -> str:
        """Device that computes the network: "cpu" or "cuda"."""
        return "cuda" if "cuda" in self.runtime else "cpu"

    @property
    def readiness(self) -> str:
        """State of the runtime and time to get ready: "dhrnet: openvino bf16, ready in 1.3 s (cached)"."""
        if self._runtime is None:
            return f"{self.name}: {self.runtime}, not ready yet"
        cached = " (cached)" if self._runtime.cached else ""
        return f"{self.name}: {self.runtime}, ready in {self._seconds:.1f} s{cached}"

    def warm_up(self) -> float:
        """Compile the network, or read it from the cache, and run it once; the first frame would, otherwise.

        Returns:
            The time that took, or had taken where it was done before [s].
        """
        if self._runtime is None:
            clock = time.perf_counter()
            ready = make_runtime(self.weights, self._asked) if isinstance(self._asked, str) else self._asked
            if self._mark is not None and not isinstance(self._network, CompiledNetwork):
                remember(of_weights(self._network, ready, Path()), self._mark)
            image = self._input
            ready(np.zeros((image.channels, image.size, image.size), np.float32))
            self._runtime, self._seconds = ready, self._seconds + time.perf_counter() - clock
            _log.info(self.readiness)
        return self._seconds

    def reset(self, truth: HeightMap | None) -> None:
        """Start an episode; a network knows nothing but images."""

    def predict(self, frame: DepthFrame) -> GraspMap:
        """Return the grasp map of the frame's central square; quality is 0 where nothing can be said.

        Raises:
            ConfigError: a network that reads colour got a frame without it.
        """
        if self.reads_colour and frame.rgb is None:
            raise ConfigError(
                f"{self.name} with {self._input.modality} input reads colour, and the frame has none",
                allowed="frames with rgb, as from WristCamera(colour=True), which needs OpenGL",
            )
        image = central_square(frame, self.config.crop, self._input.size)
        seen = says_something(frame, image)
        measured = np.isfinite(image.depth)
        image = replace(image, depth=inpaint(image.depth))
        nothing = replace(empty_map(image), measured=measured)
        if not seen:
            return nothing
        quality, angle, width = self.grasp_arrays(image.depth, image.rgb)
        if self.name in OPENING_FULLY:
            width = np.float32(GRIPPER_MAX_WIDTH * image.intrinsics.fx) / image.depth
        return replace(nothing, quality=quality, angle=angle, width=width)

    def grasp_arrays(
        self, depth: Float32, rgb: NDArray[np.uint8] | None = None
    ) -> tuple[Float32, Float32, Float32]:
        """Return quality, angle [rad] and width [px], each (size, size), of a depth image [m] without NaN.

        All are zero where the network's output is not finite: broken weights must not choose a grasp.
        """
        heads = self._heads(self._input(depth, rgb))
        if not -LARGEST < heads.min() <= heads.max() < LARGEST:  # False for NaN too
            _log.warning("%s: an output that is not finite; the frame has no grasp", self.name)
            heads = np.zeros_like(heads)
        quality, angle, width = postprocess(heads, self._width_px, self.config)
        return (quality if self._calibration is None else self._calibration(quality)), angle, width

    def _heads(self, image: Float32) -> Float32:
        """Return raw heads (4, size, size) for an input (channels, size, size)."""
        self.warm_up()
        assert self._runtime is not None
        return self._runtime(image)


def postprocess(
    heads: Float32, width_px: float, config: NetworkDetectorConfig | None = None
) -> tuple[Float32, Float32, Float32]:
    """Return quality in [0, 1], angle [rad] and width [px], each (H, W), from the raw heads (4, H, W)."""
    c = config or NetworkDetectorConfig()
    pos, cos, sin, width = heads
    quality = np.clip(_smooth(pos, c.quality_sigma), 0.0, 1.0)
    doubled = np.arctan2(_smooth(sin, c.angle_sigma), _smooth(cos, c.angle_sigma))
    opening = np.maximum(_smooth(width, c.width_sigma) * np.float32(width_px), 0.0)
    angle = np.asarray(doubled / 2, np.float32)
    angle[angle >= np.pi / 2] -= np.float32(np.pi)  # half open, as `wrap_half_pi` has it
    return quality, angle, opening


def _smooth(image: Float32, sigma: float) -> Float32:
    if sigma == 0:
        return image
    size = 2 * round(4 * sigma) + 1  # as far as scipy's and scikit-image's filters reach
    blurred = cv2.GaussianBlur(
        np.ascontiguousarray(image), (size, size), sigma, borderType=cv2.BORDER_REPLICATE
    )
    return np.asarray(blurred, np.float32)
