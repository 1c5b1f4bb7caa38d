"""A network as a grasp detector: depth image -> network -> grasp map.

Post-processing follows the published code (https://github.com/dougsm/ggcnn, https://github.com/dougsm/mvp_grasp):
the quality is smoothed with 2 px, the angle and the width with 1 px. Cosine and sine of the doubled angle are
smoothed before the angle is taken from them, because smoothed angles are wrong where they wrap.
"""

from __future__ import annotations

import copy
import itertools
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn
from torch.nn.utils import fusion

from mpgrasp.depth import CROP, DepthFrame, crop_resize, inpaint
from mpgrasp.detectors.weights import NetworkWeights, load_weights
from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import wrap_half_pi
from mpgrasp.grasp import GraspMap
from mpgrasp.height_map import HeightMap

Float32 = NDArray[np.float32]


@dataclass(frozen=True, kw_only=True)
class NetworkDetectorConfig:
    """What happens around the network."""

    crop: int = CROP
    """Side of the central square that the network sees [px]; smaller images are used as far as they go."""
    quality_sigma: float = 2.0
    """Smoothing of the quality [px]."""
    angle_sigma: float = 1.0
    """Smoothing of cosine and sine [px]."""
    width_sigma: float = 1.0
    """Smoothing of the width [px]."""
    min_seen: float = 0.05
    """Least share of pixels with a return; with fewer the image says nothing."""
    min_relief: float = 1e-4
    """Least difference between depths; with less the image says nothing [m]."""
    precision: str = "float32"
    """"float32", or "bfloat16" where the processor computes in it."""

    def __post_init__(self) -> None:
        if self.precision not in ("float32", "bfloat16"):
            raise ConfigError("unknown precision", got=self.precision, allowed=("float32", "bfloat16"))
        if self.crop < 1 or min(self.quality_sigma, self.angle_sigma, self.width_sigma) < 0:
            raise ConfigError("unusable detector settings", got=self, allowed="crop from 1, sigmas from 0")


class NetworkDetector:
    """A grasp network behind the `GraspDetector` protocol. It keeps nothing from one frame to the next."""

    def __init__(self, weights: NetworkWeights, config: NetworkDetectorConfig | None = None) -> None:
        self.name = weights.name
        self.weights = weights
        self.config = config or NetworkDetectorConfig()
        self.device = "cuda" if torch.cuda.is_available() else "cpu"
        network = _fold_batch_norms(copy.deepcopy(weights.network).eval())
        # convolutions on the CPU are a third faster with channels last
        self._network = network.to(device=self.device).to(memory_format=torch.channels_last)  # type: ignore[call-overload]

    @classmethod
    def load(
        cls, name: str, weights: Path | str | None = None, config: NetworkDetectorConfig | None = None
    ) -> NetworkDetector:
        """The detector of that name with weights from a file, by default the shipped ones.

        Raises:
            WeightsError: the file is missing, unreadable or made for another network.
        """
        return cls(load_weights(name, weights), config)

    def reset(self, truth: HeightMap | None) -> None:
        """Start an episode; a network knows nothing but images."""

    def predict(self, frame: DepthFrame) -> GraspMap:
        """Grasp map of the frame's central square; all quality is zero where the image says nothing."""
        crop = min(self.config.crop, *frame.depth.shape)
        image = crop_resize(frame, crop, self.weights.input.size)
        depth = inpaint(image.depth)
        seen = np.isfinite(image.depth).mean() >= self.config.min_seen
        if not seen or np.ptp(depth) < self.config.min_relief:
            quality, angle, width = (np.zeros(depth.shape, np.float32) for _ in range(3))
        else:
            quality, angle, width = self.grasp_arrays(depth)
        return GraspMap(
            quality=quality,
            angle=angle,
            width=width,
            depth=depth,
            intrinsics=image.intrinsics,
            T_world_camera=image.T_world_camera,
            time=image.time,
        )

    def grasp_arrays(self, depth: Float32) -> tuple[Float32, Float32, Float32]:
        """Quality, angle [rad] and width [px], each (size, size), of a depth image [m] without NaN."""
        return postprocess(self._heads(self.weights.input(depth)), self.weights.width_px, self.config)

    def _heads(self, image: Float32) -> Float32:
        """Raw heads (4, size, size) for an input (channels, size, size)."""
        x = torch.from_numpy(image)[None].to(self.device)
        x = x.contiguous(memory_format=torch.channels_last)
        low = self.config.precision == "bfloat16"
        with torch.inference_mode(), torch.autocast(self.device, torch.bfloat16, enabled=low):
            heads = self._network(x)
        return torch.cat(heads, dim=1)[0].float().cpu().numpy()


def postprocess(
    heads: Float32, width_px: float, config: NetworkDetectorConfig | None = None
) -> tuple[Float32, Float32, Float32]:
    """Quality in [0, 1], angle [rad] and width [px], each (H, W), from the raw heads (4, H, W)."""
    c = config or NetworkDetectorConfig()
    pos, cos, sin, width = heads
    quality = np.clip(_smooth(pos, c.quality_sigma), 0.0, 1.0)
    doubled = np.arctan2(_smooth(sin, c.angle_sigma), _smooth(cos, c.angle_sigma))
    opening = np.maximum(_smooth(width, c.width_sigma) * np.float32(width_px), 0.0)
    return quality, wrap_half_pi(doubled / 2).astype(np.float32), opening


def _smooth(image: Float32, sigma: float) -> Float32:
    if sigma == 0:
        return image
    size = 2 * round(4 * sigma) + 1  # as far as scipy's and scikit-image's filters reach
    blurred = cv2.GaussianBlur(
        np.ascontiguousarray(image), (size, size), sigma, borderType=cv2.BORDER_REPLICATE
    )
    return np.asarray(blurred, np.float32)


def _fold_batch_norms(network: nn.Module) -> nn.Module:
    """Convolution and batch norm that follow each other become one convolution: same function, less time."""
    for name, child in network.named_children():
        if isinstance(child, nn.Sequential):
            layers = list(child)
            for k, (first, second) in enumerate(itertools.pairwise(layers)):
                if isinstance(first, nn.Conv2d) and isinstance(second, nn.BatchNorm2d):
                    layers[k], layers[k + 1] = fusion.fuse_conv_bn_eval(first, second), nn.Identity()
            setattr(network, name, nn.Sequential(*layers))
        _fold_batch_norms(getattr(network, name))
    return network
