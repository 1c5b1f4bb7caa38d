"""Gymnasium's names of the environments, which importing this module registers.

import gymnasium
import mpgrasp.env_ids

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
    "Pile-v0": "pile",
    "Search-v0": "find_stick",
    "Clutter-v0": "find_pile",
    "Clear-v0": "stacked",
}
"""Suite of each environment; None: of its argument `suite`, the USB stick by default. In `Search-v0` and
`Clutter-v0` things need not be in view from the start: who goes straight down fails in most episodes."""
NAMESPACE = "mpgrasp"


def register() -> None:
    """Register all environments that are not registered yet; what they need is loaded when one is made."""
    inside = getattr(gymnasium.envs.registration, "current_namespace", None) == NAMESPACE
    for name, suite in SUITES.items():
        if f"{NAMESPACE}/{name}" not in gymnasium.registry:
            gymnasium.register(
                id=name if inside else f"{NAMESPACE}/{name}",
                entry_point="mpgrasp.clear_env:ClearEnv" if name == "Clear-v0" else "mpgrasp.env:GraspEnv",
                kwargs={} if suite is None else {"suite": suite},
            )


register()
