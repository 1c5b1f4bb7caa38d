"""The oracle: grasps of the true height map, looked up where each pixel of the view meets the scene.

It is the ceiling of every detector and the proof that world, robot and controllers are sound. It sees the
same frames as the networks, noise included, but only to know where its pixels lie.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mpgrasp.depth import DepthFrame, inpaint
from mpgrasp.detectors.antipodal.analysis import WorldGrasps, antipodal_grasps
from mpgrasp.detectors.central_square import central_square, empty_map, says_something
from mpgrasp.detectors.config import OracleConfig
from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import FloatArray
from mpgrasp.grasp import GraspMap, world_to_image_angle
from mpgrasp.height_map import HeightMap


class OracleDetector:
    """Detector that reads the truth.

    Args:
        config: geometry of the gripper, and how sure its grasps must be.
    """

    name = "oracle"
    reads_truth = True

    def __init__(self, config: OracleConfig | None = None) -> None:
        self.config = config or OracleConfig()
        self._grasps: WorldGrasps | None = None

    def reset(self, truth: HeightMap | None) -> None:
        """Analyse the true shape of the scene.

        Raises:
            ConfigError: without a truth.
        """
        if truth is None:
            raise ConfigError(
                "the oracle was not told the true shape", allowed="reset(truth) with a height map"
            )
        self._grasps = antipodal_grasps(truth, self.config)

    def predict(self, frame: DepthFrame) -> GraspMap:
        """Return grasps of the frame's central square; pixels without depth have none.

        Raises:
            ConfigError: before the first `reset`.
        """
        if self._grasps is None:
            raise ConfigError("the oracle has no scene", allowed="reset(truth) before predict")
        image = central_square(frame)
        measured, filled = np.isfinite(image.depth), inpaint(image.depth)
        if not says_something(frame, image):
            return replace(empty_map(replace(image, depth=filled)), measured=measured)
        seen = grasps_in_view(self._grasps, image, known=measured, depth=filled)
        return replace(seen, measured=measured)


def grasps_in_view(
    grasps: WorldGrasps,
    image: DepthFrame,
    *,
    known: np.ndarray | None = None,
    depth: FloatArray | None = None,
) -> GraspMap:
    """Return world grasps as seen in an image: nearest cell under every pixel, nothing interpolated.

    Args:
        grasps: of the scene.
        image: a depth frame of (H, W) pixels of a camera that looks down.
        known: (H, W) where grasps may be; everywhere by default.
        depth: (H, W) [m] to use in place of the image's, such as a filled one.
    """
    depth = image.depth if depth is None else np.asarray(depth, np.float32)
    result = GraspMap(
        quality=np.zeros_like(depth),
        angle=np.zeros_like(depth),
        width=np.zeros_like(depth),
        depth=depth,
        intrinsics=image.intrinsics,
        T_world_camera=image.T_world_camera,
        time=image.time,
    )
    points = result.world_points()
    row, col, inside = grasps.height_map.cells(points[..., 0], points[..., 1])
    quality = np.where(inside, grasps.quality[row, col], 0)
    if known is not None:
        quality = np.where(known, quality, 0)
    found = quality > 0
    row, col = row[found], col[found]
    result.quality[found] = quality[found]
    result.angle[found] = world_to_image_angle(grasps.angle[row, col], image.T_world_camera)
    result.width[found] = grasps.width[row, col] * image.intrinsics.fx / depth[found]
    return result
