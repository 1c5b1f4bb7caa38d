"""Multi-view picking as published, held against a reference in plain loops."""

from __future__ import annotations

import numpy as np
import pytest
from published_mvp import PublishedMvp
from toy_views import T_TCP_CAMERA, Blob, blob_map

from mpgrasp.controllers.config import ReachConfig
from mpgrasp.controllers.controller import Observation
from mpgrasp.controllers.grid_map import GridConfig
from mpgrasp.controllers.information import grid_entropy
from mpgrasp.controllers.mvp import Mvp
from mpgrasp.depth import CameraIntrinsics
from mpgrasp.geometry import looking_down

K = CameraIntrinsics(fx=385 * 0.64, fy=385 * 0.64, cx=111.5, cy=111.5, width=224, height=224)


@pytest.mark.parametrize("peak", [0.3, 0.9], ids=["weak", "strong"])
def test_mvp_is_the_published_law_tick_by_tick(peak: float) -> None:
    """Best cell, entropies and utility along a descent that wanders, with noise and missing depth."""
    extent, u = 0.34, 0.005
    controller = Mvp(ReachConfig(grid=GridConfig(extent=extent, cell=u)))
    reference = PublishedMvp(round(extent / u), u, 0.5 - extent / 2, -extent / 2)
    rng = np.random.default_rng(4)
    blob = Blob(x=0.53, y=0.04, quality=lambda height: peak)
    for tick, height in enumerate(np.linspace(0.5, 0.2, 8)):
        T_world_tcp = looking_down([0.43 + 0.004 * tick, -0.02 + 0.006 * tick, height], 0.1 * tick)
        T_world_camera = T_world_tcp @ T_TCP_CAMERA
        view = blob_map(blob, T_world_camera, rng)
        holes = rng.random(view.depth.shape) < 0.05
        view.depth[holes] = np.nan
        controller.update(Observation(time=tick / 10, T_world_tcp=T_world_tcp, grasp_map=view))

        v, index = np.mgrid[: K.height, : K.width]
        depth = view.depth.astype(float)
        rays = np.stack([(index - K.cx) / K.fx * depth, (v - K.cy) / K.fy * depth, depth], axis=-1)
        points = rays @ T_world_camera[:3, :3].T + T_world_camera[:3, 3]
        reference.look(points.reshape(-1, 3), view.quality.ravel().astype(float))

        best = controller.grid.best_cell()
        assert best is not None
        assert max(abs(best[0] - reference.best_cell()[0]), abs(best[1] - reference.best_cell()[1])) <= 1
        assert np.abs(grid_entropy(controller.grid) - reference.entropy()).max() < 0.01
        camera = float(T_world_camera[2, 3])
        sigma = 224 / K.fx * camera / 6  # a sixth of the view where it meets the table
        expected = reference.utility(sigma, (camera - 0.40) / 0.15)
        found = np.asarray(controller.diagnostics()["utility"])
        assert np.abs(found - expected).max() < 0.01
