"""Gymnasium's names of the environments; gymnasium finds them by itself where mpgrasp is installed.

import gymnasium

env = gymnasium.make("mpgrasp/Clutter-v0", detector="oracle")
"""

from __future__ import annotations

import gymnasium

SUITES = {
    "Grasp-v0": None,
    "Thin-v0": "thin",
    "Thin2mm-v0": "thin_2mm",
    "Single-v0": "single",
    "Unseen-v0": "unseen",
    "Clutter-v0": "pile",
}
"""Suite of each environment; None: of its argument `suite`, the USB stick by default."""
NAMESPACE = "mpgrasp"


def register() -> None:
    """Register all environments that are not registered yet; what they need is loaded when one is made."""
    inside = getattr(gymnasium.envs.registration, "current_namespace", None) == NAMESPACE
    for name, suite in SUITES.items():
        if f"{NAMESPACE}/{name}" not in gymnasium.registry:
            gymnasium.register(
                id=name if inside else f"{NAMESPACE}/{name}",
                entry_point="mpgrasp.env:GraspEnv",
                kwargs={} if suite is None else {"suite": suite},
            )
