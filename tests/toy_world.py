"""A small world of one geom of every kind, views of it, and a mark for tests that need OpenGL."""

from __future__ import annotations

import cv2
import mujoco
import numpy as np
import pytest

from mpgrasp.camera import rasteriser
from mpgrasp.camera.wrist_camera import WristCamera
from mpgrasp.depth import CameraIntrinsics, DepthFrame
from mpgrasp.exceptions import CameraError
from mpgrasp.geometry import FloatArray, look_at, looking_down

World = tuple[mujoco.MjModel, mujoco.MjData]

XML = """
<mujoco>
  <asset>
    <hfield name="cloth" nrow="60" ncol="80" size=".3 .25 .006 .05"/>
    <mesh name="wedge" vertex="0 0 0 .05 0 0 0 .05 0 0 0 .06 .05 .05 .03"/>
  </asset>
  <worldbody>
    <geom type="plane" size="2 2 .1" pos="0 0 -.1"/>
    <geom type="hfield" hfield="cloth"/>
    <geom type="box" size=".03 .05 .02" pos="0 0 .03" euler="3 8 30"/>
    <geom type="sphere" size=".03" pos=".1 .1 .04"/>
    <geom type="capsule" size=".008 .05" pos="-.1 .1 .02" euler="0 90 20"/>
    <geom type="cylinder" size=".03 .02" pos=".1 -.1 .04" euler="4 3 0"/>
    <geom type="ellipsoid" size=".03 .02 .01" pos="0 .1 .02"/>
    <geom type="mesh" mesh="wedge" pos="-.1 -.1 .01"/>
    <geom type="box" size=".02 .02 .02" pos="0 0 .3" group="3"/>
    <geom type="box" size=".02 .02 .02" pos=".05 0 .3" rgba="1 0 0 0"/>
    <site size=".03" pos="-.05 0 .3"/>
    <body pos="0.02 -0.01 0.5" euler="10 -7 25">
      <geom type="box" size=".002 .002 .004" pos="0 0 -.012"/>
      <camera name="panda/wrist" euler="0 0 40" fovy="20"/>
    </body>
  </worldbody>
</mujoco>
"""
SMALL = CameraIntrinsics(fx=130.0, fy=150.0, cx=81.0, cy=57.3, width=160, height=120)
POSES = [
    looking_down([0.0, 0.0, 0.45], 0.3),
    looking_down([0.05, -0.02, 0.25], -2.0),
    look_at([0.2, 0.15, 0.4], [0, 0, 0], x_axis=(0, 1, 0)),
]

try:
    rasteriser.require_gl()
    HAS_GL = True
except CameraError:
    HAS_GL = False
needs_gl = pytest.mark.skipif(not HAS_GL, reason="no OpenGL on this machine")


def toy_world() -> World:
    """The world of `XML` with an uneven cloth, at 2.5 s, kinematics computed."""
    model = mujoco.MjModel.from_xml_string(XML)
    bumps = np.random.default_rng(0).standard_normal((60, 80)).astype(np.float32)
    bumps = np.asarray(cv2.GaussianBlur(bumps, (0, 0), 4), np.float32)
    model.hfield_data[:] = ((bumps - bumps.min()) / np.ptp(bumps)).ravel()
    data = mujoco.MjData(model)
    data.time = 2.5
    mujoco.mj_forward(model, data)
    return model, data


def edges_of(depth: FloatArray) -> np.ndarray:
    """Pixels with a depth step or a hole within one pixel."""
    filled = np.nan_to_num(depth, nan=9.0)
    kernel = np.ones((3, 3), np.uint8)
    return np.asarray(cv2.dilate(filled, kernel) - cv2.erode(filled, kernel) > 0.01)


def true_frame(camera: WristCamera, data: mujoco.MjData) -> DepthFrame:
    """Perfect depth from the model's own camera."""
    return camera.render(data, camera.pose(data))
