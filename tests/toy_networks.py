"""Random small networks, their weight files, and frames for them to look at."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch

from mpgrasp.depth import CameraIntrinsics, DepthFrame
from mpgrasp.detectors.networks.input import NetworkInput
from mpgrasp.detectors.networks.registry import build_network
from mpgrasp.detectors.networks.weights import NetworkWeights, save_weights
from mpgrasp.geometry import FloatArray, looking_down

INTRINSICS = CameraIntrinsics(fx=385.0, fy=385.0, cx=319.5, cy=239.5, width=640, height=480)
SMALL = {"width": 4, "stem_width": 4, "head_width": 4, "blocks": 1}
IMAGE = NetworkInput(centre="median", scale=20.0)


def random_weights(
    name: str, settings: dict[str, Any], image: NetworkInput = IMAGE, channels: int | None = None
) -> NetworkWeights:
    settings = {**settings, "channels": channels or image.channels}
    return NetworkWeights(name=name, network=build_network(name, settings), settings=settings, input=image)


def frame(depth: FloatArray | None = None, T: FloatArray | None = None) -> DepthFrame:
    """A stick on a table, nearly, or that depth."""
    if depth is None:
        v, u = np.indices((480, 640))
        depth = np.where((abs(u - 340) < 12) & (abs(v - 220) < 40), 0.392, 0.4)
        depth = depth + np.random.default_rng(0).normal(0, 5e-4, depth.shape)
    return DepthFrame(
        depth=depth.astype(np.float32),
        intrinsics=replace(INTRINSICS, height=depth.shape[0], width=depth.shape[1]),
        T_world_camera=looking_down([0.5, 0.0, 0.4]) if T is None else T,
        time=1.5,
    )


def weight_files(folder: Path) -> dict[str, Path | None]:
    """Weights of random small networks, a published format among them; None for the oracle."""
    torch.manual_seed(0)
    made = {"dhrnet": SMALL, "ggcnn2": {}, "fcn": {}}
    for name, settings in made.items():
        save_weights(folder / f"{name}.safetensors", random_weights(name, settings))
    torch.save(build_network("ggcnn", {}).state_dict(), folder / "published.pt")
    return {
        **{name: folder / f"{name}.safetensors" for name in made},
        "ggcnn": folder / "published.pt",
        "oracle": None,
    }
