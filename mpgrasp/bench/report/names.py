"""Names of detectors and controllers as people write them."""

from __future__ import annotations

_NAMES = {
    "dhrnet": "DHRNet", "tfgrasp": "TF-Grasp", "ggcnn": "GG-CNN", "ggcnn2": "GG-CNN2", "fcn": "FCN",
    "fcn_residual": "FCN with residuals", "unet": "U-Net", "oracle": "oracle",
    "mppc": "MP-PC", "mvp": "MVP", "open_loop": "open loop",
}  # fmt: skip


def name_of(detector: str, controller: str) -> str:
    """A cell in words, without its suite."""
    return f"{_NAMES.get(detector, detector)} + {_NAMES.get(controller, controller)}"
