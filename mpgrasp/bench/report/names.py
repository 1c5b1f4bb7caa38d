"""Names of detectors and controllers as people write them."""

from __future__ import annotations

from mpgrasp.bench.record import Method

_NAMES = {
    "dhrnet": "DHRNet", "tfgrasp": "TF-Grasp", "ggcnn": "GG-CNN", "ggcnn2": "GG-CNN2",
    "grconvnet": "GR-ConvNet", "lenz": "Lenz et al.", "pinto": "Pinto et al.",
    "fcn": "FCN", "fcn_residual": "FCN with residuals", "unet": "U-Net",
    "oracle": "oracle", "heuristic": "heuristic",
    "mppc": "MP-PC", "mvp": "MVP", "mppc_robust": "robust MP-PC", "mvp_robust": "robust MVP",
    "open_loop": "open loop", "straight_down": "straight down",
}  # fmt: skip


def name_of(method: Method) -> str:
    """A detector and a controller in words."""
    return " + ".join(map(name_of_player, method))


def name_of_player(name: str) -> str:
    """A detector or a controller in words."""
    return _NAMES.get(name, name)
