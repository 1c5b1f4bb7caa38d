"""Are thin objects seen? Detection of a stick against its thickness and the height of the tool point.

    python benchmarks/thickness.py

The study behind the paper's thin-object argument. A stick of 60 x 18 mm lies on the uneven cloth of the
`thin` suite; the camera looks straight down from where the wrist would have it, the robot itself is left out.
A detection is a frame in which MP-PC's exist_peak() answers yes and the best pixel's grasp is right; a false
peak is a yes with a wrong grasp, or any yes for the same cloth without the stick. Everything but thickness,
height and detector is shared: scene k has the same cloth and, up to settling, the same pose throughout.
"""

from __future__ import annotations

import argparse
import json
import os
import shlex
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NoReturn

import mujoco
import numpy as np
from PIL import Image, ImageDraw, ImageFont
from rich.console import Console
from rich.progress import track

from mpgrasp.bench.plugins import load_detector
from mpgrasp.bench.provenance import provenance, sha256
from mpgrasp.bench.statistics import wilson_interval
from mpgrasp.bench.suite import episode_seed
from mpgrasp.camera import BACKENDS, WristCamera
from mpgrasp.controllers.config import MppcConfig
from mpgrasp.controllers.reaching import peak_height
from mpgrasp.depth import CROP
from mpgrasp.detectors.detector import GraspDetector, reads_truth
from mpgrasp.exceptions import ConfigError, MpgraspError, OutputError
from mpgrasp.geometry import FloatArray, line_angle_difference, looking_down
from mpgrasp.grasp import GraspMap, best_pixel
from mpgrasp.object_model import ObjectModel, Part
from mpgrasp.paths import WEIGHTS
from mpgrasp.plain import plain
from mpgrasp.scene import SceneConfig, build_scene
from mpgrasp.training.generate import CAMERA_OVER_TCP

Detectors = Mapping[str, GraspDetector]
Verdict = tuple[str, float, float, str]
OUT = Path(__file__).resolve().parent / "results" / "thickness"
THICKNESSES = (2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0)  # [mm]
HEIGHTS = (0.175, 0.25, 0.35, 0.50)  # of the tool point over the table [m]
LENGTH, WIDTH, DENSITY = 0.060, 0.018, 1000.0  # of the stick [m, m, kg/m^3]
UNEVENNESS, REGION = 0.0006, 0.05  # of the cloth as in the thin suite [m, RMS], half the stick's square [m]
INSIDE, FARTHEST = 0.04, 0.11  # stick's centre to the image's edge at least, to its middle at most [m]
END, NEAR, TURN = 0.005, 0.005, 30.0  # a right grasp: off the ends, off the axis [m], off square [degrees]
_CAMERA_STREAM, _NOISE_STREAM = 21, 22  # of a scene's seed
KEY, RATE = ("detector", "thickness_mm", "tcp_height_m"), ("rate", "wilson_low", "wilson_high")
_PARKED = 20.0  # [m], height at which no downward camera sees the stick


@dataclass(frozen=True, kw_only=True)
class Study:
    """What is looked at."""

    thicknesses: tuple[float, ...] = THICKNESSES
    heights: tuple[float, ...] = HEIGHTS
    scenes: int = 40
    seed: int = 0
    camera: str = "auto"

    def __post_init__(self) -> None:
        if self.scenes < 1:
            raise ConfigError("unusable number of scenes", got=self.scenes, allowed="1 or more")

    def scene_seed(self, k: int) -> int:
        """Seed of scene k: of cloth, pose, place of the camera and sensor noise."""
        return episode_seed("thickness", self.seed, k)


def run(study: Study, detectors: Detectors) -> list[dict[str, Any]]:
    """A cell per detector, thickness (0: no stick) and height, in that order: counts, rates, intervals."""
    counts: Counter[Verdict] = Counter()
    hidden = not sys.stderr.isatty()
    for k in track(range(study.scenes), "scenes", console=Console(stderr=True), disable=hidden):
        for thickness in study.thicknesses:
            bare = thickness == study.thicknesses[0]  # without a stick all thicknesses look alike
            counts.update(_look(study, k, thickness, detectors, bare))
    cells = []
    for key in ((d, t, h) for d in detectors for t in (0.0, *study.thicknesses) for h in study.heights):
        cell: dict[str, Any] = dict(zip(KEY, key, strict=True)) | {"n": study.scenes}
        for what in ("false_peak",) if key[1] == 0 else ("detected", "false_peak", "no_peak", "right"):
            number, n = counts[(*key, what)], study.scenes
            low, high = wilson_interval(number, n)
            cell[what] = {"count": number, "rate": number / n, "wilson_low": low, "wilson_high": high}
        cells.append(cell)
    return cells


def _look(study: Study, k: int, thickness: float, detectors: Detectors, bare: bool) -> list[Verdict]:
    """Verdicts on scene k with a stick of that thickness [mm] and, if `bare`, without it as well."""
    seed, threshold = study.scene_seed(k), MppcConfig().peak_threshold
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
                verdict = peak if peak_height(grasp_map.quality) > threshold else "no_peak"
                of = name, 0.0 if empty else thickness, height
                found += [(*of, verdict)] + [(*of, "right")] * right
    camera.close()
    return found


def is_right(grasp_map: GraspMap, pose: FloatArray) -> bool:
    """Whether the best pixel's grasp holds the stick; pose (4, 3) is its rotation and, below, position."""
    grasp = grasp_map.grasp_at(*best_pixel(grasp_map.quality))
    along = pose[:2, 0] / np.linalg.norm(pose[:2, 0])  # the long axis is x, seen from above
    offset = grasp.position[:2] - pose[3, :2]
    beyond = max(abs(float(offset @ along)) - (LENGTH / 2 - END), 0.0)
    aside = float(along[0] * offset[1] - along[1] * offset[0])
    turn = line_angle_difference(grasp.angle, np.arctan2(along[1], along[0]) + np.pi / 2)
    return bool(np.hypot(beyond, aside) <= NEAR and turn <= np.deg2rad(TURN))  # NaN is not


def draw(cells: Sequence[Mapping[str, Any]], scenes: int) -> Any:
    """The PIL picture: a panel per detector, detection rate against thickness, a line per height."""
    detectors, heights = (list(dict.fromkeys(c[k] for c in cells)) for k in ("detector", "tcp_height_m"))
    wide, tall, left, top, gap = 1000, 640, 130, 110, 60  # [px], at twice the size for smooth lines
    picture = Image.new("RGB", (left + (wide + gap) * len(detectors), top + tall + 230), "white")
    pen, font, small = ImageDraw.Draw(picture), ImageFont.load_default(32), ImageFont.load_default(26)
    right = max(float(c["thickness_mm"]) for c in cells) + 1
    colours = ("#d1495b", "#e09f3e", "#2a9d8f", "#30638e", "#6d597a", "#222222")
    for panel, name in enumerate(detectors):
        x0 = left + panel * (wide + gap)
        pen.text((x0, top - 55), f"{name}: detection rate [%] of a 60 x 18 mm stick", "black", font)
        for percent in range(0, 101, 20):
            y = top + tall * (1 - percent / 100)
            pen.line((x0, y, x0 + wide, y), "#dddddd", 2)
            pen.text((x0 - 15, y), str(percent) if panel == 0 else "", "black", small, anchor="rm")
        for mm in sorted({c["thickness_mm"] for c in cells} - {0.0}):
            pen.text((x0 + wide * mm / right, top + tall + 15), f"{mm:g}", "black", small, anchor="ma")
        pen.text((x0 + wide / 2, top + tall + 55), "thickness [mm]", "black", small, anchor="ma")
        for row, height in enumerate(heights):
            colour, points = colours[row % len(colours)], []
            for c in cells:
                if (c["detector"], c["tcp_height_m"]) == (name, height) and c["thickness_mm"]:
                    # beside each other, so that the bars can be told apart
                    x = x0 + wide * c["thickness_mm"] / right + 9 * (row - (len(heights) - 1) / 2)
                    y, *ends = (top + tall * (1 - c["detected"][k]) for k in RATE)
                    points.append((x, y))
                    pen.line((x, ends[0], x, ends[1]), colour, 3)
                    pen.ellipse((x - 8, y - 8, x + 8, y + 8), colour)
            pen.line(points, colour, 4)
            x, y = x0 + wide / len(heights) * row, top + tall + 115
            pen.line((x, y, x + 40, y), colour, 6)
            pen.text((x + 52, y), f"tool at {height:g} m", "black", small, anchor="lm")
    pen.text((left, top + tall + 160), f"n = {scenes} a point; bars: 95 % Wilson", "#555555", small)
    return picture.resize((picture.width // 2, picture.height // 2), Image.Resampling.LANCZOS)


def table(cells: Sequence[Mapping[str, Any]]) -> str:
    """Per detector, thickness and height: detection % [interval] and, after a slash, false peaks."""
    lines: list[str] = []
    for cell in cells:
        mm, head = cell["thickness_mm"], f"{cell['detector']:>12} {cell['thickness_mm']:>4g} mm"
        if not (lines and lines[-1].startswith(head)):
            lines.append(head)
        text = (
            "{:.0f} [{:.0f}-{:.0f}]".format(*(100 * cell["detected"][k] for k in RATE)) if mm else "no stick"
        )
        lines[-1] += f"{text:>15} / {cell['false_peak']['count']:<2}"
    heights = dict.fromkeys(f"{c['tcp_height_m']:>13g} m     " for c in cells)
    return "\n".join([" " * 20 + "".join(heights), *lines])


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise ConfigError(message, allowed=f"see {self.prog} --help")


def _study(command: Sequence[str]) -> None:
    parser = _Parser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("--detector", metavar="D[,D]", default="dhrnet,ggcnn", help="default: %(default)s")
    add("--scenes", metavar="N", type=int, default=40, help="per thickness and height (default: 40)")
    add("--seed", metavar="S", type=int, default=0, help="0, 1, 2, ... (default: 0)")
    add("--camera", choices=BACKENDS, default="auto", help="default: %(default)s")
    add("--out", metavar="DIR", type=Path, default=OUT, help="gets thickness.json and thickness.png")
    options = parser.parse_args(command)
    study = Study(scenes=options.scenes, seed=options.seed, camera=options.camera)
    detectors = {name: load_detector(name) for name in options.detector.split(",")}
    report: dict[str, Any] = {
        "command": shlex.join(["python", "benchmarks/thickness.py", *command]),
        "study": study,
        "scene_seeds": [study.scene_seed(k) for k in range(study.scenes)],
        "peak_threshold": MppcConfig().peak_threshold,
        "weights_sha256": {d: sha256(WEIGHTS / f"{d}.safetensors") for d in detectors},
        "made_with": provenance(),
    }
    try:
        options.out.mkdir(parents=True, exist_ok=True)
        report["cells"] = run(study, detectors)
        (options.out / "thickness.json").write_text(json.dumps(plain(report), indent=1) + "\n", "utf-8")
        draw(report["cells"], study.scenes).save(options.out / "thickness.png", optimize=True)
    except OSError as error:
        raise OutputError(f"results cannot be written: {error}", got=str(options.out)) from error
    print("Detected % [95 % interval] / false peaks, by thickness and height of the tool over the table;")
    print(f"n = {study.scenes} in each cell.\n{table(report['cells'])}\nResults: {options.out}")


def main(command: Sequence[str] | None = None) -> int:
    """Run the command line (`sys.argv` if not given) and return the exit code; 2 for unusable input."""
    os.environ.setdefault("OMP_NUM_THREADS", "1")  # before torch is loaded, as in the benchmark
    try:
        _study(sys.argv[1:] if command is None else command)
    except MpgraspError as error:
        print("thickness: error:", " ".join(str(error).splitlines()), file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
