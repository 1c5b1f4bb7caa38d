"""Describes the world of a run's episodes: physics, contacts, camera, and the configurations of the arm."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from mpgrasp.bench.results.run_card import Card, WorldCard
from mpgrasp.files.json_values import json_value
from mpgrasp.suite import Suite, episode_seed

if TYPE_CHECKING:
    import mujoco

    from mpgrasp.episode.config import EpisodeConfig


def world_card(suite: Suite, config: EpisodeConfig, seed: int) -> WorldCard:
    """Physics, camera and arm of a suite's episodes, read from its first one as it is before it is played.

    Builds the first scene of every turn on the way, so that objects that cannot be used come to light
    before the first episode.

    Args:
        suite: whose episodes they are.
        config: of the episodes.
        seed: of the run.

    Raises:
        AssetError: an object or arena that cannot be used.
        CameraError: the camera backend is not to be had.
    """
    from mpgrasp.episode.world import World
    from mpgrasp.scene.scene import build_scene

    for turn in range(1, len(suite.scenes)):
        build_scene(suite.scene_config(turn), episode_seed(suite.name, seed, turn))
    world = World(suite.scene_config(0), episode_seed(suite.name, seed, 0), config)
    try:
        return WorldCard(physics=physics_card(world.scene.model), **json_value(world.configs()))
    finally:
        world.close()


def physics_card(model: mujoco.MjModel) -> Card:
    """The settings on which contact-rich results depend: solver options and every named geom's contacts."""
    import mujoco

    option = model.opt
    geoms: dict[str, Any] = {}
    for index in range(model.ngeom):
        geom = model.geom(index)
        if geom.name and (geom.contype[0] or geom.conaffinity[0]):
            geoms[geom.name] = {
                "friction": geom.friction,
                "condim": int(geom.condim[0]),
                "solref": geom.solref,
                "solimp": geom.solimp,
            }
    card: Card = json_value(
        {
            "engine": f"MuJoCo {mujoco.__version__}",
            "timestep": option.timestep,
            "integrator": mujoco.mjtIntegrator(option.integrator).name,
            "solver": mujoco.mjtSolver(option.solver).name,
            "cone": mujoco.mjtCone(option.cone).name,
            "impratio": option.impratio,
            "iterations": option.iterations,
            "tolerance": option.tolerance,
            "ls_iterations": option.ls_iterations,
            "noslip_iterations": option.noslip_iterations,
            "noslip_tolerance": option.noslip_tolerance,
            "gravity": option.gravity,
            "disableflags": option.disableflags,
            "enableflags": option.enableflags,
            "geoms": geoms,
        }
    )
    return card
