"""A small world and an episode of a few ticks in it, for tests of recorders."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
from fakes import FakeResult

from mpgrasp.camera.wrist_camera import WristCamera
from mpgrasp.depth import crop_resize, inpaint
from mpgrasp.geometry import looking_down
from mpgrasp.grasp import Grasp, GraspMap
from mpgrasp.recording.recorder import Recorder, TickRecord

XML = """
<mujoco>
  <asset>
    <hfield name="cloth" nrow="21" ncol="31" size=".3 .2 .01 .05"/>
    <mesh name="wedge" vertex="0 0 0 .05 0 0 0 .05 0 0 0 .06 .05 .05 .03"/>
    <material name="red" rgba="0.8 0.1 0.1 1"/>
  </asset>
  <worldbody>
    <light pos="0 0 2"/>
    <geom type="plane" size="2 2 .1" pos="0 0 -.1"/>
    <geom name="table" type="box" size=".5 .5 .02" pos="0.5 0 -.021" rgba=".5 .4 .3 1"/>
    <geom name="cloth" type="hfield" hfield="cloth" pos="0.5 0 0" rgba=".6 .6 .6 1"/>
    <body name="stick" pos="0.5 0 .03"><freejoint/>
      <geom type="box" size=".03 .01 .004" material="red"/>
      <geom type="capsule" size=".005 .02"/><geom type="cylinder" size=".005 .02"/>
      <geom type="sphere" size=".01"/><geom type="ellipsoid" size=".01 .02 .01"/>
      <geom type="mesh" mesh="wedge"/>
    </body>
    <camera name="panda/wrist" pos="0.5 0 0.5" fovy="60"/>
  </worldbody>
</mujoco>
"""


def toy_simulation() -> Any:
    model = mujoco.MjModel.from_xml_string(XML)
    model.hfield_data[:] = np.random.default_rng(0).random(model.nhfielddata)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return SimpleNamespace(
        model=model, data=data, time=0.0, T_world_tcp=looking_down([0.5, 0.0, 0.4]), gripper_width=0.08
    )


GRASP = Grasp(position=np.array([0.5, 0.02, 0.03]), angle=0.4, width=0.05, quality=0.8)


def play(recorder: Recorder, simulation: Any, ticks: int = 6) -> None:
    camera = WristCamera(simulation.model, "ray", crop=350)
    rng = np.random.default_rng(0)
    recorder.start(simulation)
    for k in range(ticks):
        simulation.time = simulation.data.time = 0.1 * k
        simulation.data.qpos[2] = 0.03 + 0.01 * k
        mujoco.mj_forward(simulation.model, simulation.data)
        seeing = k < ticks - 2
        frame = crop_resize(camera.capture(simulation.data, rng)) if seeing else None
        grasp_map = None
        if frame is not None:
            quality = rng.random(frame.depth.shape).astype(np.float32)
            grasp_map = GraspMap(
                quality=quality,
                angle=(quality - 0.5) * 3,
                width=quality * 60,
                depth=inpaint(frame.depth),
                intrinsics=frame.intrinsics,
                T_world_camera=frame.T_world_camera,
                time=frame.time,
            )
        grids: dict[str, Any] = {
            "entropy": rng.random((20, 30)),
            "utility": rng.random((20, 30)),
            "peak": True,
            "cost": 0.3,
        }
        recorder.tick(
            TickRecord(
                phase="reach" if seeing else "lift",
                simulation=simulation,
                frame=frame,
                grasp_map=grasp_map,
                diagnostics=grids if seeing else {},
                twist_commanded=np.arange(6.0),
                twist_achieved=np.arange(6.0) / 2,
                min_singular_value=0.2 - 0.01 * k,
                manipulability=0.1,
                grasp=None if seeing else GRASP,
                event="reflex: joint 3 too fast" if k == ticks - 1 else None,
            )
        )
    recorder.finish("success")


def shown(scene_config: Any, seed: int, *, recorder: Recorder, **_: Any) -> FakeResult:
    """An episode of six ticks in the small world, which a recorder is shown."""
    play(recorder, toy_simulation())
    return FakeResult(seed, scene_config)
