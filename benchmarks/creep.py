"""Creep of what the hand holds: an object is grasped, lifted, shaken, and then held for a minute.

    python benchmarks/creep.py --objects usb_stick key soap --scenes 4

Prints how far each object moves and turns in the hand meanwhile, the worst of its grasps: in several scenes,
through its middle and 8 mm beside it. Only the pads hold it. The solver's no-slip pass may be given other
limits, to see what it is for: --sweeps 2 --tolerance 1e-6 creep. Leaves no files.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence

import numpy as np
import study
from rich.console import Console
from rich.table import Table

from mpgrasp.geometry import FloatArray, invert, looking_down, rotation_vector, wrap_half_pi
from mpgrasp.grasp import Grasp
from mpgrasp.linear_algebra import norm
from mpgrasp.motion.arm_driver import ArmDriver
from mpgrasp.motion.execution import execute_grasp
from mpgrasp.motion.ik import solve_pose
from mpgrasp.scene.config import SceneConfig
from mpgrasp.scene.objects.catalogue import OBJECT_SETS, load_object
from mpgrasp.scene.scene import build_scene
from mpgrasp.scene.simulation import Simulation
from mpgrasp.scene.solver import NO_SLIP_ITERATIONS, NO_SLIP_TOLERANCE
from mpgrasp.workspace import WORKSPACE_CENTRE

OFFSETS = (0.0, 0.008)
"""From the object's middle to the grasp, along its x axis [m]."""
START_HEIGHT = 0.25
"""Of the tool point over the table [m]."""


def grasped(name: str, seed: int, offset: float, sweeps: int, tolerance: float) -> Simulation:
    """A simulation at the end of a grasp across the object's y axis, whatever came of it."""
    model = load_object(name)
    scene = build_scene(SceneConfig(objects=(model,), half_extent=0.12), seed)
    scene.model.opt.noslip_iterations, scene.model.opt.noslip_tolerance = sweeps, tolerance
    simulation = Simulation(scene)
    simulation.set_q(solve_pose(simulation.q, looking_down([*WORKSPACE_CENTRE, START_HEIGHT])))
    T = simulation.object_pose(name)
    top = (model.points @ T[:3, :3].T)[:, 2].max()
    grasp = Grasp(
        position=T[:3, 3] + T[:3, 0] * offset + [0.0, 0.0, top],
        angle=float(wrap_half_pi(np.arctan2(T[1, 1], T[0, 1]))),
        width=float(np.ptp(model.points[:, 1])),
        quality=1.0,
    )
    execute_grasp(ArmDriver(simulation), grasp)
    return simulation


def creep(simulation: Simulation, seconds: float) -> tuple[float, float] | None:
    """Way [m] and turn [rad] of what is held, in the hand and after a time [s]; None if nothing is held."""
    if not (held := simulation.held()):
        return None
    (name,) = held

    def in_hand() -> FloatArray:
        return invert(simulation.T_world_tcp) @ simulation.object_pose(name)

    before = in_hand()
    simulation.step(round(seconds / simulation.model.opt.timestep))
    moved = invert(before) @ in_hand()
    return norm(moved[:3, 3]), norm(rotation_vector(moved[:3, :3]))


def main(command: Sequence[str] | None = None) -> int:
    """Command line: print the table; returns the exit code."""
    return study.run_command(_run, command)


def _run(command: Sequence[str]) -> None:
    parser = study.Parser(prog="creep.py", description=__doc__)
    parser.add_argument("--objects", nargs="+", default=OBJECT_SETS["thin"], help="default: the thin ones")
    parser.add_argument("--scenes", type=int, default=4, help="scenes of each object (default 4)")
    parser.add_argument("--seconds", type=float, default=60.0, help="to hold it (default 60)")
    parser.add_argument("--sweeps", type=int, default=NO_SLIP_ITERATIONS, help="default: the project's")
    parser.add_argument("--tolerance", type=float, default=NO_SLIP_TOLERANCE, help="default: the project's")
    options = parser.parse_args(command)
    study.positive("number", options.scenes, options.seconds, options.sweeps, options.tolerance)
    for name in options.objects:
        load_object(name)
    table = Table(title=f"Held for {options.seconds:g} s, {options.sweeps} sweeps to {options.tolerance:g}")
    table.add_column("object")
    for heading in ("held", "way mm", "turn deg", "us a step"):
        table.add_column(heading, justify="right")
    for name in options.objects:
        table.add_row(
            name, *_figures(name, options.scenes, options.seconds, options.sweeps, options.tolerance)
        )
    Console().print(table)


def _figures(name: str, scenes: int, seconds: float, sweeps: int, tolerance: float) -> list[str]:
    """Cells of an object's row: grasps that hold, largest way and turn, time of a step."""
    found, busy = [], 0.0
    for seed in range(scenes):
        for offset in OFFSETS:
            simulation = grasped(name, seed, offset, sweeps, tolerance)
            start = time.process_time()
            result = creep(simulation, seconds)
            if result is not None:
                busy += time.process_time() - start
                found.append(result)
    held = f"{len(found)} of {scenes * len(OFFSETS)}"
    if not found:
        return [held, "", "", ""]
    way, turn = np.max(found, axis=0)
    per_step = 1e6 * busy / len(found) / seconds * simulation.model.opt.timestep
    return [held, f"{1e3 * way:.3f}", f"{np.degrees(turn):.2f}", f"{per_step:.1f}"]


if __name__ == "__main__":
    sys.exit(main())
