"""Content of run.json: all that decides a run's results, and what they were made with."""

from __future__ import annotations

import hashlib
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Any

from mpgrasp.bench.playing.plan import Plan
from mpgrasp.bench.playing.player import Player
from mpgrasp.bench.playing.recorded_command import PROGRAM
from mpgrasp.files.json_values import plain
from mpgrasp.suite import Suite


def describe(plan: Plan, player: Player, command: Sequence[str]) -> dict[str, Any]:
    """Content of run.json; its `configuration` is what two runs in one folder must agree in.

    The world card of the first suite stands at the top; those of several stand by name in `worlds`.
    """
    from mpgrasp.bench.playing.world_card import world_card
    from mpgrasp.bench.results.provenance import provenance

    cards = [world_card(suite, player.episode_configs[suite.name], plan.seed) for suite in plan.suites]
    several = len(cards) > 1
    return {
        "format": 1,
        "command": shlex.join([*PROGRAM, *command]),
        "started": datetime.now().astimezone().isoformat(timespec="seconds"),
        "configuration": configuration(plan, player),
        **cards[0],
        **({"worlds": {s.name: card for s, card in zip(plan.suites, cards, strict=True)}} if several else {}),
        **(
            {"objects": [_without_folder(verdict.card()) for verdict in plan.objects]} if plan.objects else {}
        ),
        "made_with": provenance(),
    }


def configuration(plan: Plan, player: Player) -> dict[str, Any]:
    """All that decides what a run's lines say; of a programme, `suite` is the name and `suites` says more.

    Files are given by name and hash: where they lie decides nothing, and is nobody's business.
    """
    from mpgrasp.bench.results.provenance import sha256
    from mpgrasp.detectors.detector import reads_truth
    from mpgrasp.paths import WEIGHTS

    suites = [
        {
            "suite": suite_card(suite),
            "episode": player.episode_configs[suite.name],
            "episodes": plan.batch(suite),
        }
        for suite in plan.suites
    ]
    return {
        **(suites[0] if plan.programme is None else {"suite": plan.programme, "suites": suites}),
        "cells": ["/".join(cell) for cell in plan.cells],
        "detectors": [
            {
                "name": name,
                "weights": given.name if (given := plan.weights.get(name)) else None,
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
        "until_ci": plan.until_ci,
        "max_episodes": None if plan.until_ci is None else plan.max_episodes,
        "seed": plan.seed,
        "camera": plan.camera,
        "noise": plan.noise,
    }


def suite_card(suite: Suite) -> dict[str, Any]:
    """A suite as plain values; an object's mesh is given by the hash of its pieces."""
    # names in place of meshes, whose vertices would fill pages
    named = (
        replace(s, objects=tuple(getattr(item, "name", item) for item in s.objects)) for s in suite.scenes
    )
    card: dict[str, Any] = plain(replace(suite, scenes=tuple(named)))
    for scene, written in zip(suite.scenes, card["scenes"], strict=True):
        written["objects"] = [_object_card(item) for item in scene.objects]
    return card


def _object_card(item: Any) -> Any:
    meshes = [part.vertices for part in getattr(item, "parts", ()) if part.vertices is not None]
    if not meshes:
        return plain(item)
    digest = hashlib.sha256()
    for vertices in meshes:
        digest.update(vertices.tobytes())
    card: dict[str, Any] = plain(replace(item, parts=item.parts[:1]))
    return {**card, "parts": {"pieces": len(item.parts), "sha256": digest.hexdigest()}}


def _without_folder(card: Mapping[str, Any]) -> dict[str, Any]:
    return {**card, "file": Path(card["file"]).name}
