"""Boxes on the bare table, and ways to move the arm among them without the project's own motion."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np

from mpgrasp.geometry import FloatArray, looking_down, rotation_vector
from mpgrasp.paths import SCENES
from mpgrasp.robot import hand, panda
from mpgrasp.scene.objects.free_body import SOLIMP, SOLREF
from mpgrasp.scene.simulation import SERVO_PERIOD, Simulation
from mpgrasp.scene.solver import NO_SLIP_ITERATIONS, NO_SLIP_TOLERANCE

STATE = mujoco.mjtState.mjSTATE_INTEGRATION
CENTRE = (0.5, 0.0)


def box_scene(*sizes: tuple[float, float, float], mass: float = 0.05, robot: bool = True) -> Any:
    """Boxes of full sizes [m] in a row along y, the first at the workspace centre."""
    spec = mujoco.MjSpec.from_file(str(SCENES / "table.xml"))
    if robot:
        spec.attach(panda.panda_spec(), prefix=panda.PREFIX, frame=spec.worldbody.add_frame())
        spec.option.noslip_iterations, spec.option.noslip_tolerance = NO_SLIP_ITERATIONS, NO_SLIP_TOLERANCE
    names = tuple(f"box_{k}" for k in range(len(sizes)))
    for k, (name, size) in enumerate(zip(names, sizes, strict=True)):
        body = spec.worldbody.add_body(name=name, pos=[CENTRE[0], CENTRE[1] + 0.12 * k, size[2] / 2])
        body.add_freejoint()
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_BOX, size=np.array(size) / 2, mass=mass, condim=4, priority=1,
            friction=[0.6, 0.003, 0.0008], solref=list(SOLREF), solimp=list(SOLIMP),
        )  # fmt: skip
    model = spec.compile()
    data = mujoco.MjData(model)
    if robot:
        panda.set_home(model, data)
    state = np.empty(mujoco.mj_stateSize(model, STATE))
    mujoco.mj_getState(model, data, state, STATE)
    return SimpleNamespace(model=model, spec=spec, state=state, objects=names, config=None, seed=0)


class Kinematics:
    """Plain Newton iterations, enough for straight lines in the middle of the workspace."""

    def __init__(self) -> None:
        self.model = panda.arm_model()
        self.data = mujoco.MjData(self.model)

    def solve(self, T: FloatArray, q: FloatArray) -> FloatArray:
        for _ in range(200):
            self.data.qpos[:] = q
            mujoco.mj_kinematics(self.model, self.data)
            mujoco.mj_comPos(self.model, self.data)
            site = self.data.site("tcp")
            J = np.empty((6, 7))
            mujoco.mj_jacSite(self.model, self.data, J[:3], J[3:], self.model.site("tcp").id)
            turn = rotation_vector(T[:3, :3] @ site.xmat.reshape(3, 3).T)
            error = np.concatenate([T[:3, 3] - site.xpos, turn])
            if np.abs(error).max() < 1e-9:
                break
            q = q + np.linalg.pinv(J) @ (error * min(1.0, 0.1 / np.abs(error).max()))
        return np.array(q)


KINEMATICS = Kinematics()


def put(sim: Simulation, x: float, y: float, z: float) -> FloatArray:
    """Teleport the tool there, pointing down, and return its joint positions."""
    q = KINEMATICS.solve(looking_down((x, y, z)), panda.Q_HOME)
    sim.set_q(q)
    return q


def travel(
    sim: Simulation, q: FloatArray, start: FloatArray, end: FloatArray, speed: float
) -> tuple[FloatArray, float]:
    """Straight line with 0.5 m/s2 at both ends; final joint target and the largest tracking error [m]."""
    length, s, v, worst = float(np.linalg.norm(end - start)), 0.0, 0.0, 0.0
    while s < length - 1e-9:
        v = min(speed, v + 0.5 * SERVO_PERIOD, np.sqrt(max(length - s, 1e-6)))
        s = min(length, s + v * SERVO_PERIOD)
        point = start + (end - start) * s / length
        target = KINEMATICS.solve(looking_down(point), q)
        sim.set_arm_target(target, (target - q) / SERVO_PERIOD)
        q = target
        sim.step(5)
        worst = max(worst, float(np.linalg.norm(sim.T_world_tcp[:3, 3] - point)))
    sim.set_arm_target(q, np.zeros(7))
    sim.step(50)
    return q, worst


def grasp(sim: Simulation, size: tuple[float, float, float], force: float, offset: float = 0.0) -> None:
    """Grasp the box at the centre, tips 1.5 mm above the table or TCP at half height, and lift it 0.1 m."""
    low = np.array([CENTRE[0], CENTRE[1] + offset, max(size[2] / 2, hand.FINGERTIP_BEYOND_TCP + 0.0015)])
    high = low + np.array([0, 0, 0.1])
    q = put(sim, *high)
    sim.open_gripper(min(hand.GRIPPER_MAX_WIDTH, size[1] + 0.02))
    sim.step(400)
    q, _ = travel(sim, q, high, low, 0.1)
    sim.close_gripper(force)
    sim.step(600)
    travel(sim, q, low, high, 0.1)


def contact_force(sim: Simulation) -> float:
    """Largest normal force [N] of one geom of the robot against one that is not the robot's."""
    forces: dict[tuple[int, int], float] = {}
    wrench = np.zeros(6)
    for i, contact in enumerate(sim.data.contact):
        names = [sim.model.body(sim.model.geom_bodyid[g]).name for g in (contact.geom1, contact.geom2)]
        if sum(name.startswith("panda/") for name in names) == 1:
            mujoco.mj_contactForce(sim.model, sim.data, i, wrench)
            pair = (contact.geom1, contact.geom2)  # the points between two geoms share the load
            forces[pair] = forces.get(pair, 0.0) + float(wrench[0])
    return max(forces.values(), default=0.0)
