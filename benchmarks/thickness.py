"""Are thin objects seen? Detection of a stick against its thickness and the height of the tool point.

    python benchmarks/thickness.py

The study behind the paper's thin-object argument. A stick of 60 x 18 mm lies on the uneven cloth of the
`thin` suite; the camera looks straight down from where the wrist would have it, the robot itself is left out.
A detection is a frame in which MP-PC's exist_peak() answers yes and the best pixel's grasp is right; a false
peak is a yes with a wrong grasp, or any yes for the same cloth without the stick. Everything but thickness,
height and detector is shared: scene k has the same cloth and, up to settling, the same pose throughout.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np
from study import (
    RESULTS,
    Parser,
    about,
    error_bars,
    figure,
    load_detectors,
    not_negative,
    prepare,
    publish,
    rate,
    run_command,
    style,
    track,
)

from mpgrasp.camera.backends import BACKENDS
from mpgrasp.camera.wrist_camera import WristCamera
from mpgrasp.command_line import COUNT, SEED
from mpgrasp.controllers.config import ReachConfig
from mpgrasp.depth import CROP
from mpgrasp.detectors.detector import GraspDetector, reads_truth
from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import FloatArray, line_angle_difference, looking_down
from mpgrasp.grasp import GraspMap, best_pixel, peak_height
from mpgrasp.scene.config import SceneConfig
from mpgrasp.scene.objects.model import ObjectModel, Part
from mpgrasp.scene.scene import build_scene
from mpgrasp.suite import episode_seed
from mpgrasp.training.data.views import CAMERA_OVER_TCP

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Detectors = Mapping[str, GraspDetector]
Sighting = tuple[str, float, float, str]
"""Detector, thickness [mm], height [m], and what was seen: detected, false_peak, no_peak or right."""
OUT = RESULTS / "thickness"
THICKNESSES = (2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0)  # [mm]
HEIGHTS = (0.175, 0.25, 0.35, 0.50)  # of the tool point over the table [m]
LENGTH, WIDTH, DENSITY = 0.060, 0.018, 1000.0  # of the stick [m, m, kg/m^3]
UNEVENNESS, REGION = 0.0006, 0.05  # of the cloth as in the thin suite [m, RMS], half the stick's square [m]
INSIDE, FARTHEST = 0.04, 0.11  # stick's centre to the image's edge at least, to its middle at most [m]
END, NEAR, TURN = 0.005, 0.005, 30.0  # a right grasp: off the ends, off the axis [m], off square [degrees]
_CAMERA_STREAM, _NOISE_STREAM = 21, 22  # of a scene's seed
KEY = ("detector", "thickness_mm", "tcp_height_m")
_PARKED = 20.0  # [m], height at which no downward camera sees the stick


@dataclass(frozen=True, kw_only=True)
class Study:
    """Sticks, heights and scenes of the study."""

    thicknesses: tuple[float, ...] = THICKNESSES
    heights: tuple[float, ...] = HEIGHTS
    scenes: int = 40
    seed: int = 0
    camera: str = "auto"

    def __post_init__(self) -> None:
        not_negative("seed", self.seed)
        if self.scenes < 1:
            raise ConfigError("unusable number of scenes", got=self.scenes, allowed="1 or more")

    def scene_seed(self, k: int) -> int:
        """Seed of scene k: of cloth, pose, place of the camera and sensor noise."""
        return episode_seed("thickness", self.seed, k)


def run(study: Study, detectors: Detectors) -> list[dict[str, Any]]:
    """A cell per detector, thickness (0: no stick) and height, in that order: counts, rates, intervals."""
    counts: Counter[Sighting] = Counter()
    for k in track(range(study.scenes), "scenes", study.scenes):
        for thickness in study.thicknesses:
            bare = thickness == study.thicknesses[0]  # without a stick all thicknesses look alike
            counts.update(_look(study, k, thickness, detectors, bare))
    cells = []
    for key in ((d, t, h) for d in detectors for t in (0.0, *study.thicknesses) for h in study.heights):
        cell: dict[str, Any] = dict(zip(KEY, key, strict=True)) | {"n": study.scenes}
        for what in ("false_peak",) if key[1] == 0 else ("detected", "false_peak", "no_peak", "right"):
            cell[what] = rate(counts[(*key, what)], study.scenes)
        cells.append(cell)
    return cells


def _look(study: Study, k: int, thickness: float, detectors: Detectors, bare: bool) -> list[Sighting]:
    """Sightings in scene k with a stick of that thickness [mm] and, if `bare`, without it as well."""
    seed, threshold = study.scene_seed(k), ReachConfig().peak_threshold
    box = Part(shape="box", size=(LENGTH / 2, WIDTH / 2, thickness / 2000))
    stick = ObjectModel(name="stick", parts=(box,), mass=DENSITY * box.volume)
    config = SceneConfig(objects=(stick,), half_extent=REGION, cloth_unevenness=UNEVENNESS)
    scene = build_scene(config, seed, robot=False)
    camera = WristCamera(scene.model, study.camera, crop=CROP)
    data, place = scene.data(), np.random.default_rng([seed, _CAMERA_STREAM]).uniform(-1, 1, 2)
    pose = np.vstack([data.body("stick").xmat.reshape(3, 3), data.body("stick").xpos])
    truth = scene.height_map() if any(map(reads_truth, detectors.values())) else None
    found = []
    for empty in (False, True) if bare else (False,):
        if empty:
            data.joint("stick/free").qpos[2] = _PARKED
            mujoco.mj_forward(scene.model, data)
            if truth is not None:
                truth = replace(truth, height=truth.support, label=np.zeros_like(truth.label))
        for detector in detectors.values():
            detector.reset(truth if reads_truth(detector) else None)
        for height in study.heights:
            over_table = height + CAMERA_OVER_TCP
            half_view = CROP / 2 / camera.intrinsics.fx * over_table
            at = pose[3, :2] + place * min(half_view - INSIDE, FARTHEST)
            noise = np.random.default_rng([seed, _NOISE_STREAM, round(1000 * height)])
            frame = camera.render(data, looking_down([*at, over_table]), noise)
            for name, detector in detectors.items():
                grasp_map = detector.predict(frame)
                right = not empty and is_right(grasp_map, pose)
                peak = "detected" if right else "false_peak"
                seen = peak if peak_height(grasp_map.quality) > threshold else "no_peak"
                of = name, 0.0 if empty else thickness, height
                found += [(*of, seen)] + [(*of, "right")] * right
    camera.close()
    return found


def is_right(grasp_map: GraspMap, pose: FloatArray) -> bool:
    """True if the best pixel's grasp holds the stick; pose (4, 3) is its rotation and, below, position."""
    grasp = grasp_map.grasp_at(*best_pixel(grasp_map.quality))
    along = pose[:2, 0] / np.linalg.norm(pose[:2, 0])  # the long axis is x, seen from above
    offset = grasp.position[:2] - pose[3, :2]
    beyond = max(abs(float(offset @ along)) - (LENGTH / 2 - END), 0.0)
    aside = float(along[0] * offset[1] - along[1] * offset[0])
    turn = line_angle_difference(grasp.angle, np.arctan2(along[1], along[0]) + np.pi / 2)
    return bool(np.hypot(beyond, aside) <= NEAR and turn <= np.deg2rad(TURN))  # NaN is not


def draw(cells: Sequence[Mapping[str, Any]], scenes: int) -> Figure:
    """A panel per detector: detection rate against thickness, a line per height."""
    detectors, heights = (list(dict.fromkeys(c[k] for c in cells)) for k in ("detector", "tcp_height_m"))
    picture, panels = figure(len(detectors))
    for axes, name in zip(panels, detectors, strict=True):
        for row, height in enumerate(heights):
            of_line = [c for c in cells if (c["detector"], c["tcp_height_m"]) == (name, height)]
            seen = [c for c in of_line if c["thickness_mm"]]
            # beside each other, so that the bars can be told apart
            x = [c["thickness_mm"] + 0.1 * (row - (len(heights) - 1) / 2) for c in seen]
            y, bars = error_bars([c["detected"] for c in seen])
            axes.errorbar(x, y, yerr=bars, capsize=2, label=f"tool at {height:g} m", **style(row))
        axes.set_xticks(sorted({c["thickness_mm"] for c in cells} - {0.0}))
        axes.set(title=name, xlabel="thickness of a 60 x 18 mm stick [mm]", ylim=(0, 101))
    panels[0].set_ylabel(f"detected [%]; n = {scenes}, bars: 95 % Wilson")
    panels[0].legend(loc="lower right")
    return picture


def table(cells: Sequence[Mapping[str, Any]]) -> str:
    """Per detector, thickness and height: detection % [interval] and, after a slash, false peaks."""
    lines: list[str] = []
    columns = ("rate", "wilson_low", "wilson_high")
    for cell in cells:
        mm, head = cell["thickness_mm"], f"{cell['detector']:>12} {cell['thickness_mm']:>4g} mm"
        if not (lines and lines[-1].startswith(head)):
            lines.append(head)
        text = (
            "{:.0f} [{:.0f}-{:.0f}]".format(*(100 * cell["detected"][k] for k in columns))
            if mm
            else "no stick"
        )
        lines[-1] += f"{text:>15} / {cell['false_peak']['count']:<2}"
    heights = dict.fromkeys(f"{c['tcp_height_m']:>13g} m     " for c in cells)
    return "\n".join([" " * 20 + "".join(heights), *lines])


def _study(command: Sequence[str]) -> None:
    parser = Parser(description=__doc__)
    add = parser.add_argument
    add("--detector", metavar="D[,D]", default="dhrnet,tfgrasp,ggcnn2", help="default: %(default)s")
    add("--scenes", metavar="N", type=COUNT, default=40, help="per thickness and height (default: 40)")
    add("--seed", metavar="S", type=SEED, default=0, help="0, 1, 2, ... (default: 0)")
    add("--camera", choices=BACKENDS, default="auto", help="default: %(default)s")
    add("--out", metavar="DIR", type=Path, default=OUT, help="default: benchmarks/results/thickness")
    options = parser.parse_args(command)
    study = Study(scenes=options.scenes, seed=options.seed, camera=options.camera)
    detectors, who = load_detectors(options.detector)
    told = about(
        "thickness", command, study=study, peak_threshold=ReachConfig().peak_threshold,
        scene_seeds=[study.scene_seed(k) for k in range(study.scenes)], **who,
    )  # fmt: skip
    prepare(options.out)
    cells = run(study, detectors)
    publish(options.out, "thickness", told, {"cells": cells}, cells, draw(cells, study.scenes))
    print("Detected % [95 % interval] / false peaks, by thickness and height of the tool over the table;")
    print(f"n = {study.scenes} in each cell.\n{table(cells)}\nResults: {options.out}")


def main(command: Sequence[str] | None = None) -> int:
    """Run the command line (`sys.argv` if not given) and return the exit code; 2 for unusable input."""
    return run_command(_study, command)


if __name__ == "__main__":
    sys.exit(main())
