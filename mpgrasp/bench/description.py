"""Content of run.json: all that decides a run's results, and what they were made with."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

from mpgrasp.bench.plan import Plan
from mpgrasp.bench.player import Player
from mpgrasp.exceptions import OutputError

_PROGRAM = ("python", "-m", "mpgrasp.bench")


def describe(plan: Plan, player: Player, command: Sequence[str]) -> dict[str, Any]:
    """Content of run.json; its `configuration` is what two runs in one folder must agree in."""
    from mpgrasp.bench.provenance import provenance
    from mpgrasp.bench.world_card import world_card

    return {
        "format": 1,
        "command": shlex.join([*_PROGRAM, *command]),
        "started": datetime.now().astimezone().isoformat(timespec="seconds"),
        "configuration": configuration(plan, player),
        **world_card(plan.suite, player.episode_config, plan.seed),
        "made_with": provenance(),
    }


def configuration(plan: Plan, player: Player) -> dict[str, Any]:
    """All that decides what a run's lines say."""
    from mpgrasp.bench.provenance import sha256
    from mpgrasp.detectors.detector import reads_truth
    from mpgrasp.paths import WEIGHTS

    return {
        "suite": plan.suite,
        "episode": player.episode_config,
        "detectors": [
            {
                "name": name,
                "weights": str(given) if (given := plan.weights.get(name)) else None,
                # of the shipped weights where none are given; a plug-in's own are its own affair
                "sha256": sha256(given or WEIGHTS / f"{name}.safetensors"),
                "reads_truth": reads_truth(detector),
                "device": getattr(detector, "device", None),
                "runtime": getattr(detector, "runtime", None),
                "config": getattr(detector, "config", None),
            }
            for name, detector in player.detectors.items()
        ],
        "controllers": [
            {"name": name, "config": getattr(controller, "config", None)}
            for name, controller in player.controllers.items()
        ],
        "episodes": plan.episodes,
        "until_ci": plan.until_ci,
        "max_episodes": None if plan.until_ci is None else plan.max_episodes,
        "seed": plan.seed,
        "camera": plan.camera,
        "noise": plan.noise,
    }


def command_of(run: dict[str, Any], path: Path) -> list[str]:
    """Arguments of the command that a run.json says it was made with.

    Raises:
        OutputError: it does not say.
    """
    try:
        words = shlex.split(run["command"])
    except (KeyError, ValueError, AttributeError) as error:
        raise OutputError(
            "run.json does not say by which command it was made", got=str(path), allowed="`command`"
        ) from error
    return words[len(_PROGRAM) :]
