"""Describes a run for its run.json: all that decides its results, and what they are made with."""

from __future__ import annotations

import hashlib
import shlex
from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime
from typing import Any

from mpgrasp.bench.playing.plan import Plan
from mpgrasp.bench.playing.player import Player
from mpgrasp.bench.playing.recorded_command import PROGRAM
from mpgrasp.bench.record import record_of
from mpgrasp.bench.results.plug_in_source import source_hash
from mpgrasp.bench.results.run_card import (
    Card,
    Configuration,
    ControllerCard,
    DetectorCard,
    RunDescription,
    SuiteCard,
    SuitePart,
    WorldCard,
)
from mpgrasp.detectors.detector import GraspDetector
from mpgrasp.files.json_values import json_value
from mpgrasp.settings.tree import WORLD_GROUPS, tree
from mpgrasp.suite import Suite


def describe(plan: Plan, player: Player, command: Sequence[str]) -> RunDescription:
    """Content of run.json.

    Raises:
        MpgraspError: an object, an arena or a camera backend that cannot be used.
    """
    from mpgrasp.bench.playing.world_card import world_card
    from mpgrasp.bench.results.provenance import provenance

    worlds: dict[str, WorldCard] = {}
    known: list[tuple[Any, WorldCard]] = []  # points of a sweep may share a world
    for suite in plan.suites:
        config = player.episode_configs[suite.name]
        decided_by = suite_card(suite).scenes, json_value(config)
        like = next((card for place, card in known if place == decided_by), None)
        if like is None:
            like = world_card(suite, config, plan.seed)
            known.append((decided_by, like))
        worlds[suite.name] = like
    first = worlds[plan.suites[0].name]
    if plan.sweep or plan.ladder:
        worlds = {name: card for name, card in worlds.items() if card != first}
    return RunDescription(
        format=1,
        command=shlex.join([*PROGRAM, *command]),
        started=datetime.now().astimezone().isoformat(timespec="seconds"),
        configuration=configuration(plan, player),
        physics=first.physics,
        camera=first.camera,
        motion=first.motion,
        ik=first.ik,
        reflex=first.reflex,
        worlds=worlds if len(worlds) > 1 else {},
        objects=tuple(verdict.card() for verdict in plan.objects),
        made_with=provenance(),
    )


def configuration(plan: Plan, player: Player) -> Configuration:
    """All that decides what a run's lines say; of a programme, `suite` is the name and `suites` says more.

    Files are given by name and hash: where they lie decides nothing, and is nobody's business.
    """
    parts = tuple(_part(plan, suite, player) for suite in plan.suites)
    alone = plan.programme is None
    return Configuration(
        settings=parts[0].settings if alone else {},
        suite=plan.programme or parts[0].suite,
        suites=() if alone else parts,
        sweep=plan.sweep,
        ladder=plan.ladder,
        race=plan.race,
        episode=parts[0].episode if alone else None,
        episodes=parts[0].episodes if alone else None,
        cells=tuple(str(method) for method in plan.methods),
        detectors=tuple(_detector_card(plan, name, item) for name, item in player.detectors.items()),
        controllers=tuple(
            ControllerCard(
                name=name,
                config=json_value(getattr(controller, "config", None)),
                source=source_hash("controller", name),
            )
            for name, controller in player.controllers.items()
        ),
        until_ci=plan.until_ci,
        max_episodes=None if plan.until_ci is None else plan.max_episodes,
        seed=plan.seed,
        camera=plan.camera,
        noise=plan.noise,
        shard=None if plan.shard is None else str(plan.shard),
    )


def _part(plan: Plan, suite: Suite, player: Player) -> SuitePart:
    """One suite as it is played: its episodes' own settings, and the tree of all."""
    card, config = suite_card(suite), player.episode_configs[suite.name]
    scenes = card.scenes[0] if len(card.scenes) == 1 else list(card.scenes)
    played = plan.settings_of(suite.name)
    groups = json_value(tree(config, played.controllers, played.detectors))
    episode = {key: value for key, value in json_value(config).items() if key not in WORLD_GROUPS}
    return SuitePart(
        settings={"scene": scenes, **groups}, suite=card, episode=episode, episodes=plan.batch(suite)
    )


def _detector_card(plan: Plan, name: str, detector: GraspDetector) -> DetectorCard:
    from mpgrasp.bench.results.provenance import sha256
    from mpgrasp.detectors.detector import device_of, reads_truth, runtime_of
    from mpgrasp.paths import WEIGHTS

    given = plan.weights.get(name)
    return DetectorCard(
        name=name,
        weights=None if given is None else given.name,
        # of the shipped weights where none are given; a plug-in's own are its own affair
        sha256=sha256(given or WEIGHTS / f"{name}.safetensors"),
        reads_truth=reads_truth(detector),
        device=json_value(device_of(detector)),
        runtime=json_value(runtime_of(detector)),
        config=json_value(getattr(detector, "config", None)),
        source=source_hash("detector", name),
    )


def suite_card(suite: Suite) -> SuiteCard:
    """A suite as plain values; an object's mesh is given by the hash of its pieces."""
    # names in place of meshes, whose vertices would fill pages
    named = (
        replace(s, objects=tuple(getattr(item, "name", item) for item in s.objects)) for s in suite.scenes
    )
    card: Card = json_value(replace(suite, scenes=tuple(named)))
    for scene, written in zip(suite.scenes, card["scenes"], strict=True):
        written["objects"] = [_object_card(item) for item in scene.objects]
    return record_of(SuiteCard, card)


def _object_card(item: Any) -> Any:
    meshes = [part.vertices for part in getattr(item, "parts", ()) if part.vertices is not None]
    if not meshes:
        return json_value(item)
    digest = hashlib.sha256()
    for vertices in meshes:
        digest.update(vertices.tobytes())
    card: Card = json_value(replace(item, parts=item.parts[:1]))
    return {**card, "parts": {"pieces": len(item.parts), "sha256": digest.hexdigest()}}
