"""What a run's world is made of, read from the compiled model: physics, frictions, camera."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from mpgrasp.suite import Suite, episode_seed

if TYPE_CHECKING:
    import mujoco

    from mpgrasp.episode.episode import EpisodeConfig


def world_card(suite: Suite, config: EpisodeConfig, seed: int) -> dict[str, Any]:
    """Physics, camera and arm of a run, with the keys `physics`, `camera`, `motion`, `ik` and `reflex`.

    Builds the first scene of every turn on the way, so that objects that cannot be used come to light
    before the first episode.

    Raises:
        AssetError: an object or arena that cannot be used.
        CameraError: the camera backend is not to be had.
    """
    from mpgrasp.camera.noise import DepthNoise
    from mpgrasp.camera.wrist_camera import WristCamera
    from mpgrasp.motion.ik_config import IkConfig
    from mpgrasp.motion.reflex import ReflexConfig
    from mpgrasp.motion.trajectory import MotionConfig
    from mpgrasp.scene.scene import build_scene

    scenes = [
        build_scene(suite.scene_config(episode), episode_seed(suite.name, seed, episode))
        for episode in range(len(suite.scenes))
    ]
    camera = WristCamera(scenes[0].model, backend=config.camera_backend)
    return {
        "physics": physics_card(scenes[0].model),
        "camera": {
            "backend": camera.backend,
            "intrinsics": camera.intrinsics,
            "noise": DepthNoise() if config.noise else None,
        },
        "motion": MotionConfig(),
        "ik": IkConfig(),
        "reflex": ReflexConfig(),
    }


def physics_card(model: mujoco.MjModel) -> dict[str, Any]:
    """The settings on which contact-rich results depend: solver options and every named geom's contacts."""
    import mujoco

    option = model.opt
    geoms = {}
    for index in range(model.ngeom):
        geom = model.geom(index)
        if geom.name and (geom.contype[0] or geom.conaffinity[0]):
            geoms[geom.name] = {
                "friction": geom.friction,
                "condim": int(geom.condim[0]),
                "solref": geom.solref,
                "solimp": geom.solimp,
            }
    return {
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
