"""The Franka Emika Robot (FER, "Panda") with hand and wrist camera: model and poses.

Its limits are those of `mpgrasp.robot.limits`. Frames, inertials and meshes come from franka_description.
"""

from __future__ import annotations

import sys
from functools import cache
from pathlib import Path

import mujoco

from mpgrasp.exceptions import AssetError, ConfigError
from mpgrasp.paths import PANDA_ASSETS
from mpgrasp.robot import hand
from mpgrasp.robot.limits import CARTESIAN_SPEED_MAX as CARTESIAN_SPEED_MAX
from mpgrasp.robot.limits import DDQ_MAX as DDQ_MAX
from mpgrasp.robot.limits import DQ_MAX as DQ_MAX
from mpgrasp.robot.limits import Q_HOME as Q_HOME
from mpgrasp.robot.limits import Q_MAX as Q_MAX
from mpgrasp.robot.limits import Q_MIN as Q_MIN

PREFIX = "panda/"
"""Prefix of the robot's elements in a world to which it is attached."""
ROBOT_GROUP = 2
"""Geom group of everything that belongs to the robot, and of nothing else."""

ARM_JOINTS = tuple(f"joint{i}" for i in range(1, 8))
FINGER_JOINTS = ("finger_joint1", "finger_joint2")


_DESCRIPTION = Path("share/example-robot-data/robots/panda_description/meshes/collision")


@cache
def mesh_directory() -> Path:
    """Folder of the arm's collision meshes in the installed package example-robot-data.

    Raises:
        AssetError: the package is not installed.
    """
    # The wheel keeps its data under cmeel.prefix beside the packages and has nothing to import.
    for entry in sys.path:
        candidate = Path(entry) / "cmeel.prefix" / _DESCRIPTION
        if (candidate / "link0.stl").is_file():
            return candidate.resolve()
    raise AssetError(
        "the Panda's meshes are not installed",
        got=f"no cmeel.prefix/{_DESCRIPTION} on sys.path",
        allowed="pip install example-robot-data",
    )


def panda_spec() -> mujoco.MjSpec:
    """A fresh, unprefixed model of the arm with hand and camera, base frame at the origin.

    Attach it with the prefix `panda/`. Mesh paths in it are absolute, so that a saved world opens in
    the plain viewer on the same computer.

    Raises:
        AssetError: the meshes or the model file are missing.
    """
    path = PANDA_ASSETS / "panda.xml"
    if not path.is_file():
        raise AssetError("the Panda's model is missing", got=str(path), allowed="a complete installation")
    spec = mujoco.MjSpec.from_file(str(path))
    directory = mesh_directory()
    for mesh in spec.meshes:
        mesh.file = str(directory / mesh.file)
    return spec


def set_home(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Put the attached robot into its home pose with open gripper, at rest, targets included."""
    for name, value in zip(ARM_JOINTS, Q_HOME, strict=True):
        joint = model.joint(PREFIX + name)
        data.qpos[joint.qposadr] = value
        data.qvel[joint.dofadr] = 0.0
        data.ctrl[model.actuator(PREFIX + name).id] = value
    for name in FINGER_JOINTS:
        joint = model.joint(PREFIX + name)
        data.qpos[joint.qposadr] = hand.GRIPPER_MAX_WIDTH / 2
        data.qvel[joint.dofadr] = 0.0
    data.ctrl[model.actuator(PREFIX + "gripper").id] = hand.GRIPPER_MAX_WIDTH


def arm_model() -> mujoco.MjModel:
    """Kinematic model for IK: seven joints, fingers fixed open, and the table as a plane at z = 0.

    Names carry no prefix (`joint1`, `tcp`, `hand`, ...); the plane is called `table`.
    """
    spec = panda_spec()
    spec.modelname = "panda_arm"
    for element in (*spec.keys, *spec.tendons, *spec.equalities, *spec.actuators):
        spec.delete(element)
    for name, joint, side in zip(("left_finger", "right_finger"), FINGER_JOINTS, (1, -1), strict=True):
        finger = spec.body(name)
        finger.pos[1] += side * hand.GRIPPER_MAX_WIDTH / 2
        spec.delete(spec.joint(joint))
    spec.worldbody.add_geom(name="table", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[2, 2, 0.01])
    return spec.compile()


def collision_pairs(model: mujoco.MjModel) -> list[tuple[list[str], list[str]]]:
    """Groups of geoms of an `arm_model()` that must keep apart, as mink's collision limit takes them.

    The fingers may come close to the table, where grasps happen; the hand and the camera may not.

    Raises:
        ConfigError: a model with other names.
    """
    tool, fingers = ["hand", "camera_housing"], ["left_pad", "right_pad"]
    pairs = [
        (tool, ["table"]),
        ([*tool, *fingers], ["link0", "link1", "link2"]),
        (["camera_housing"], ["link5"]),
    ]
    missing = {name for pair in pairs for group in pair for name in group} - {
        model.geom(i).name for i in range(model.ngeom)
    }
    if missing:
        raise ConfigError("not an arm model", got=f"no geoms {sorted(missing)}", allowed="panda.arm_model()")
    return pairs
