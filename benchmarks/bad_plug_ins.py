"""Detectors and controllers that must be found out, each made from a sound one by one change.

A plug-in is found out by one of three: the loader, which imports and makes it; the guards of every run,
which check what it returns; or the conformance kit, `python -m mpgrasp.check`, which plays it known scenes.
Tests try them all; so can a study.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

FoundBy = Literal["loader", "guard", "kit"]

SOUND_DETECTOR = '''
from dataclasses import replace

import cv2
import numpy as np

from mpgrasp import GraspMap
from mpgrasp.depth import crop_resize, inpaint


class Sound:
    """Takes the largest thing that stands 3 mm or more over the table across its shorter side."""

    name = "sound"

    def reset(self, truth):
        pass

    def predict(self, frame):
        image = crop_resize(frame, min(350, *frame.depth.shape))
        depth = inpaint(image.depth)
        maps = [np.zeros_like(depth) for _ in range(3)]
        view = GraspMap(quality=maps[0], angle=maps[1], width=maps[2], depth=depth,
                        intrinsics=image.intrinsics, T_world_camera=image.T_world_camera, time=image.time)
        height = np.nan_to_num(view.world_points()[..., 2], nan=0.0)
        count, label, stats, _ = cv2.connectedComponentsWithStats((height > 0.003).astype(np.uint8))
        if count < 2:
            return view
        largest = 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))
        v, u = np.nonzero(label == largest)
        if len(u) < 20:
            return view
        spread, axes = np.linalg.eigh(np.cov(u, v))
        across = axes[:, 0]  # of the shorter side
        angle = np.arctan2(-across[1], across[0])
        rows, cols = np.indices(depth.shape)
        far = (rows - v.mean()) ** 2 + (cols - u.mean()) ** 2
        view.quality[:] = np.where(label == largest, 0.9 * np.exp(-far / 2 / 8.0**2), 0)
        view.angle[:] = (angle + np.pi / 2) % np.pi - np.pi / 2
        view.width[:] = 1.3 * np.sqrt(12 * spread[0])
        return view
'''
"""A detector that every check lets pass."""

SOUND_CONTROLLER = '''
from dataclasses import replace

import numpy as np

from mpgrasp import Command
from mpgrasp.grasp import best_pixel


class Sound:
    """Comes straight down, and grasps at the best pixel that it has seen."""

    name = "sound"

    def reset(self, seed):
        self.best, self.failures = None, []

    def remember_failure(self, position):
        self.failures.append(position)

    def update(self, observation):
        view = observation.grasp_map
        quality = np.nan_to_num(view.quality)
        for failure in self.failures:
            near = np.hypot(*(view.world_points() - failure)[..., :2].transpose(2, 0, 1)) < 0.03
            quality = np.where(near, 0, quality)
        row, col = best_pixel(quality)
        if quality[row, col] > 0.1:
            grasp = view.grasp_at(row, col)
            if self.best is None or grasp.quality >= self.best.quality:
                self.best = grasp
        done = bool(observation.T_world_tcp[2, 3] <= 0.175)
        twist = np.array([0, 0, 0.0 if done else -0.05, 0, 0, 0])
        return Command(twist=twist, gripper=0.08, done=done)

    def final_grasp(self):
        return self.best

    def diagnostics(self):
        return {}
'''
"""A controller that every check lets pass."""


@dataclass(frozen=True, kw_only=True)
class BadPlugIn:
    """One such plug-in."""

    kind: Literal["detector", "controller"]
    source: str
    """Text of its module; the class is called `Bad`."""
    said: str
    """Regular expression that the error, or the kit's reason, matches."""
    by: FoundBy
    given_as: str = "{module}:Bad"
    """The name that a user gives it."""

    def write(self, folder: Path, module: str) -> str:
        """Write its module into a folder, and return the name that it is loaded by."""
        (folder / f"{module}.py").write_text(self.source, encoding="utf-8")
        return self.given_as.format(module=module, folder=folder)


def _indented(text: str) -> str:
    lines = text.strip("\n").splitlines()
    margin = min(len(line) - len(line.lstrip()) for line in lines if line.strip())
    return "\n".join("    " + line[margin:] for line in lines)


def _detector(said: str, body: str, by: FoundBy = "guard", before: str = "") -> BadPlugIn:
    source = f"{SOUND_DETECTOR}\n{before}\n\nclass Bad(Sound):\n{_indented(body)}\n"
    return BadPlugIn(kind="detector", source=source, said=said, by=by)


def _map(said: str, changes: str, by: FoundBy = "guard", before: str = "") -> BadPlugIn:
    """Return a detector whose map `m` of a `frame` is changed."""
    body = f"""
def predict(self, frame):
    m = super().predict(frame)
    return replace(m, {changes})
"""
    return _detector(said, body, by, before)


def _controller(said: str, body: str, by: FoundBy = "guard", before: str = "") -> BadPlugIn:
    source = f"{SOUND_CONTROLLER}\n{before}\n\nclass Bad(Sound):\n{_indented(body)}\n"
    return BadPlugIn(kind="controller", source=source, said=said, by=by)


def _command(said: str, changes: str, by: FoundBy = "guard") -> BadPlugIn:
    """Return a controller whose command `c` after an `observation` is changed."""
    body = f"""
def update(self, observation):
    c = super().update(observation)
    return replace(c, {changes})
"""
    return _controller(said, body, by)


def _grasp(said: str, changes: str, by: FoundBy = "guard") -> BadPlugIn:
    """Return a controller whose final grasp `g` is changed."""
    body = f"""
def final_grasp(self):
    g = super().final_grasp()
    return g and replace(g, {changes})
"""
    return _controller(said, body, by)


GUARDED: Mapping[str, BadPlugIn] = {
    # detectors
    "quality-logits": _map(
        "quality is out of range.*from -.*looks like logits", "quality=20 * m.quality - 6"
    ),
    "quality-255": _map("quality is out of range.*0-255: divide by 255", "quality=255 * m.quality"),
    "quality-uint8": _map(
        "quality is of the wrong type; got 'uint8.*0-255", "quality=(255 * m.quality).astype(np.uint8)"
    ),
    "quality-per-cent": _map("quality is out of range.*looks like per cent", "quality=100 * m.quality"),
    "quality-overshoot": _map("quality is out of range.*clip it", "quality=1.3 * m.quality"),
    "quality-nan": _map(
        "quality is not finite.*50176 not finite|quality is not finite.*none of it",
        "quality=m.quality * np.nan",
    ),
    "quality-one-nan": _map(
        "quality is not finite; got '.*, 1 not finite'",
        "quality=np.where(np.arange(m.quality.size).reshape(m.quality.shape) == 7, np.nan, m.quality)",
    ),
    "quality-infinite": _map("quality is not finite", "quality=m.quality + np.inf"),
    "quality-float16": _map(
        "quality is of the wrong type; got 'float16", "quality=m.quality.astype(np.float16)"
    ),
    "angle-degrees": _map("angle is out of range.*looks like degrees", "angle=np.rad2deg(m.angle) + 5"),
    "angle-unfolded": _map("angle is out of range.*wrap_half_pi", "angle=m.angle * 0 + 2.5"),
    "angle-nan": _map("angle is not finite", "angle=np.arctan2(m.angle * np.inf, 1) * np.nan"),
    "width-metres": _map("width has no opening of a whole pixel.*metres", "width=m.world_width()"),
    "width-negative": _map("width is out of range.*no opening is negative", "width=-m.width - 1"),
    "width-nan": _map("width is not finite", "width=m.width * np.nan"),
    "width-micrometres": _map("width is out of range", "width=1e6 * m.world_width() + 1e4"),
    "depth-millimetres": _map("depth is out of range.*millimetres", "depth=1000 * m.depth"),
    "depth-nan": _map("depth is NaN where the quality claims", "depth=np.full_like(m.depth, np.nan)"),
    "camera-pose": _map("T_world_camera is not the frame's", "T_world_camera=np.eye(4)"),
    "transposed": _map(
        r"quality has the wrong size; got \(224, 200\)",
        "intrinsics=replace(m.intrinsics, height=200), quality=m.quality[:200].T",
    ),
    "tensors": _map(
        r"quality is no numpy array.*Tensor.*detach\(\)\.cpu\(\)\.numpy\(\)",
        "quality=torch.from_numpy(m.quality)",
        before="import torch",
    ),
    "lists": _map("quality is no numpy array; got <class 'list'>", "quality=m.quality.tolist()"),
    "tuple": _detector(
        "predict returned no GraspMap; got 'an object of type tuple'",
        """
        def predict(self, frame):
            m = super().predict(frame)
            return m.quality, m.angle, m.width
        """,
    ),
    "none": _detector("predict returned no GraspMap; got 'None'", "def predict(self, frame): pass"),
    "one-tensor": _detector(
        r"predict returned no GraspMap; got 'torch tensor float32|predict returned no GraspMap; got 'float32",
        """
        def predict(self, frame):
            return torch.zeros(4, 224, 224)
        """,
        before="import torch",
    ),
    "async": _detector(
        "predict returned no GraspMap.*no `async def`",
        """
        async def predict(self, frame):
            return super().predict(frame)
        """,
    ),
    "changes-directory-later": _detector(
        "detector sound: changed the working directory; got '/'",
        """
        def predict(self, frame):
            os.chdir("/")
            return super().predict(frame)
        """,
        before="import os",
    ),
    # controllers
    "twist-nan": _command("twist is not finite", "twist=c.twist * np.nan"),
    "twist-infinite": _command("twist is not finite", "twist=c.twist + np.inf"),
    "twist-short": _command("twist has the wrong form; got 'float64 .3,.", "twist=c.twist[:3]"),
    "twist-list": _command("twist has the wrong form; got 'an object of type list'", "twist=[0.0] * 6"),
    "twist-mm": _command("twist is no motion of an arm.*mm/s", "twist=1000 * c.twist"),
    "twist-degrees": _command(
        "twist is no motion of an arm.*degrees per second", "twist=np.array([0, 0, -0.05, 0, 0, 28.6])"
    ),
    "gripper-80": _command("gripper is out of range; got 80.*0 to 0.08.*millimetres", "gripper=80"),
    "gripper-negative": _command("gripper is out of range; got -0.01", "gripper=-0.01"),
    "gripper-nan": _command("gripper is not finite", "gripper=float('nan')"),
    "gripper-none": _command("gripper is no number; got 'None'", "gripper=None"),
    "done-text": _command("done is no truth; got .*'no'", "done='no'"),
    "no-command": _controller(
        "update returned no Command; got 'float64",
        """
        def update(self, observation):
            return super().update(observation).twist
        """,
    ),
    "grasp-degrees": _grasp("final grasp's angle is out of range.*degrees", "angle=45.0"),
    "grasp-nan": _grasp("final grasp's position is not finite", "position=g.position * np.nan"),
    "grasp-millimetres": _grasp(
        "final grasp's position is out of reach.*milli", "position=1000 * g.position"
    ),
    "grasp-width-pixels": _grasp("final grasp's width is out of range.*pixels", "width=60.0"),
    "grasp-width-negative": _grasp("final grasp's width is out of range; got -0.05", "width=-0.05"),
    "grasp-quality": _grasp("final grasp's quality is out of range", "quality=230.0"),
    "grasp-tuple": _controller(
        "final_grasp returned no Grasp; got 'an object of type tuple'",
        "def final_grasp(self): return (0.5, 0.0, 0.0)",
    ),
    "diagnostics-list": _controller(
        "diagnostics returned no mapping", "def diagnostics(self): return [1, 2, 3]"
    ),
}
"""Plug-ins that the guards of every run refuse."""


def _module(said: str, line: str, **more: str) -> BadPlugIn:
    """Return a detector whose module does something when it is imported."""
    source = f"{line}\n{SOUND_DETECTOR}\n\nclass Bad(Sound):\n    pass\n"
    return BadPlugIn(kind="detector", source=source, said=said, by="loader", **more)


def _given_as(said: str, name: str) -> BadPlugIn:
    return _module(said, "", given_as=name)


LOADED: Mapping[str, BadPlugIn] = {
    "exits": _module(
        r"import of a detector plug-in ends the program: sys\.exit\(0\)", "import sys; sys.exit(0)"
    ),
    "exits-with-words": _module(r"sys\.exit\('no licence'\)", "import sys; sys.exit('no licence')"),
    "exits-hard": _module(r"ends the program: os\._exit\(0\)", "import os; os._exit(0)"),
    "interrupts": _module("raises KeyboardInterrupt, which nobody has typed", "raise KeyboardInterrupt"),
    "hangs": _module("import of a detector plug-in takes longer than", "import time; time.sleep(3600)"),
    "hangs-stubbornly": _module(
        "import of a detector plug-in takes longer than",
        """
import time
for _ in range(3):
    try:
        time.sleep(3600)
    except:
        pass
""",
    ),
    "hangs-when-made": _detector(
        "constructor of a detector plug-in takes longer than",
        "def __init__(self): threading.Event().wait()",
        by="loader",
        before="import threading",
    ),
    "exits-when-made": _controller(
        "constructor of a controller plug-in ends the program",
        "def __init__(self): quit_now()",
        by="loader",
        before="from sys import exit as quit_now",
    ),
    "breaks": _module("cannot be imported .ZeroDivisionError: division by zero", "1 / 0"),
    "needs-a-package": _module(
        "cannot be imported .ModuleNotFoundError: No module named 'no_such_package'", "import no_such_package"
    ),
    "does-not-parse": _module("cannot be imported .SyntaxError", "def ("),
    "no-such-class": _given_as("has no class 'Heur'.*allowed: Sound, Bad", "{module}:Heur"),
    "no-class": _given_as("has no such name; got '{module}:'".replace("{module}", r"\w+"), "{module}:"),
    "not-a-class": _given_as("has no class 'np'", "{module}:np"),
    "by-file": _given_as(r"no such file of a detector plug-in; got 'absent\.py'", "./absent.py:Bad"),
    "by-path": _given_as("has no class 'Heur'.*allowed: Sound, Bad", "{folder}/{module}.py:Heur"),
    "by-file-alone": _given_as(r"names no class.*allowed: \w+\.py:Class", "{module}.py"),
    "needs-arguments": _detector(
        "cannot be made .TypeError.*missing 1 required", "def __init__(self, weights): pass", by="loader"
    ),
    "lacks-predict": BadPlugIn(
        kind="detector",
        source="class Bad:\n    name = 'bad'\n    def reset(self, truth): pass\n",
        said="detector plug-in lacks predict.*allowed: methods reset, predict",
        by="loader",
    ),
    "lacks-update": BadPlugIn(
        kind="controller",
        source="class Bad:\n    name = 'bad'\n    def reset(self, seed): pass\n",
        said="controller plug-in lacks update, final_grasp, diagnostics",
        by="loader",
    ),
    "predict-takes-nothing": _detector(
        "predict cannot be called as it is.*allowed: .self, frame.", "def predict(self): pass", by="loader"
    ),
    "reset-takes-nothing": _controller(
        "reset cannot be called as it is.*allowed: .self, seed.", "def reset(self): pass", by="loader"
    ),
    "remember-failure-is-a-list": _controller(
        "remember_failure is no method", "remember_failure = []", by="loader"
    ),
    "controller-as-detector": BadPlugIn(
        kind="detector",
        source=f"{SOUND_CONTROLLER}\n\nclass Bad(Sound):\n    pass\n",
        said="detector plug-in lacks predict",
        by="loader",
    ),
}
"""Plug-ins that are refused when they are imported or made."""

KIT: Mapping[str, BadPlugIn] = {
    # detectors
    "no-name": _detector("name: it has no name", "name = None", by="kit"),
    "width-millimetres": _map(
        "unit of the width: .*differ by more than a factor", "width=1000 * m.world_width()", by="kit"
    ),
    "width-half": _map("unit of the width: .*whole opening", "width=m.width / 2", by="kit"),
    "blind": _map("sees a plain box: .*leads the robot nowhere", "quality=0 * m.quality", by="kit"),
    "width-of-the-whole-image": _map("unit of the width", "width=m.width * 4", by="kit"),
    "angle-along": _map(
        "direction of the angle: .*along the bar: add pi / 2", "angle=m.angle % np.pi - np.pi / 2", by="kit"
    ),
    "angle-clockwise": _map("direction of the angle: .*may be clockwise", "angle=-m.angle", by="kit"),
    "angle-not-halved": _map(
        "direction of the angle", "angle=(2 * m.angle + np.pi / 2) % np.pi - np.pi / 2", by="kit"
    ),
    "angle-in-the-world": _map(
        "direction of the angle: .*in another frame",
        "angle=wrap_half_pi(image_to_world_angle(m.angle, m.T_world_camera)).astype(np.float32)",
        by="kit",
        before="from mpgrasp.geometry import wrap_half_pi\nfrom mpgrasp.grasp import image_to_world_angle",
    ),
    "rows-for-columns": _map(
        "place of the grasp: .*rows and columns", "quality=m.quality.T.copy()", by="kit"
    ),
    "upside-down": _map("place of the grasp", "quality=m.quality[::-1].copy()", by="kit"),
    "intrinsics-not-scaled": _map(
        "geometry of the map: only .*not those of its image",
        "intrinsics=replace(m.intrinsics, fx=frame.intrinsics.fx, fy=frame.intrinsics.fy)",
        by="kit",
    ),
    "intrinsics-not-cropped": _map(
        "geometry of the map",
        "intrinsics=replace(frame.intrinsics.resize(224, 224))",
        by="kit",
    ),
    "sees-in-the-dark": _map(
        "frame without returns: .*quality 0.5",
        "quality=np.maximum(m.quality, 0.5), depth=np.nan_to_num(m.depth, nan=0.5)",
        by="kit",
    ),
    "random": _map(
        "same frame, same map: .*differs in", "quality=m.quality * np.random.uniform(0.9, 1)", by="kit"
    ),
    "keeps-frames": _detector(
        "reset forgets: .*from episode to episode",
        """
        mean = None

        def predict(self, frame):
            m = super().predict(frame)
            self.mean = m.quality if self.mean is None else 0.5 * (self.mean + m.quality)
            return replace(m, quality=self.mean)
        """,
        by="kit",
    ),
    "tires": _detector(
        "same frame, same map",
        """
        episodes = 0

        def reset(self, truth):
            self.episodes += 1

        def predict(self, frame):
            m = super().predict(frame)
            return replace(m, quality=m.quality * 0.99**self.episodes)
        """,
        by="kit",
    ),
    "differs-from-its-like": _detector(
        "a new one sees the same: .*--workers",
        """
        made = 0

        def __init__(self):
            Bad.made += 1
            self.share = 0.9**Bad.made

        def predict(self, frame):
            m = super().predict(frame)
            return replace(m, quality=m.quality * self.share)
        """,
        by="kit",
    ),
    "writes-into-the-frame": _detector(
        "frame left as it is: .*writes into frame.depth",
        """
        def predict(self, frame):
            m = super().predict(frame)
            frame.depth[:10] = 0.4
            return m
        """,
        by="kit",
    ),
    "takes-no-holes": _detector(
        "frame with holes: it raises ValueError: NaN in the image",
        """
        def predict(self, frame):
            if np.isnan(frame.depth).any():
                raise ValueError("NaN in the image")
            return super().predict(frame)
        """,
        by="kit",
    ),
    "exits-later": _detector(
        "ends the program: sys.exit.3.", "def predict(self, frame): raise SystemExit(3)", by="kit"
    ),
    "hangs-later": _detector(
        "the check .* takes longer than",
        "def predict(self, frame): time.sleep(3600)",
        by="kit",
        before="import time",
    ),
    # controllers
    "dice": _command(
        "same seed, same reach: .*default_rng",
        "twist=c.twist + 0.01 * np.random.standard_normal(6)",
        by="kit",
    ),
    "never-forgets": _controller(
        "reset forgets: .*final_grasp returns a grasp of the last|reset forgets: after another",
        """
        best, failures = None, ()

        def reset(self, seed):
            pass
        """,
        by="kit",
    ),
    "controllers-differ": _controller(
        "a new one reaches alike: .*--workers",
        """
        made = 0

        def __init__(self):
            Bad.made += 1
            self.speed = 0.001 * Bad.made

        def update(self, observation):
            c = super().update(observation)
            return replace(c, twist=c.twist + [self.speed, 0, 0, 0, 0, 0])
        """,
        by="kit",
    ),
    "never-done": _command("comes to an end: .*timeout", "done=False, twist=0 * c.twist", by="kit"),
    "into-the-table": _command(
        "stays above the table: .*finger tips", "done=False, twist=np.array([0, 0, -0.05, 0, 0, 0])", by="kit"
    ),
    "too-fast": _command("within the robot's speeds: .*3.00 m/s", "twist=60 * c.twist", by="kit"),
    "spins": _command(
        "within the robot's speeds: .*3.00 rad/s", "twist=c.twist + np.array([0, 0, 0, 0, 0, 3.0])", by="kit"
    ),
    "angle-of-the-image": _controller(
        "takes a lone peak: .*degrees off its direction",
        """
        def update(self, observation):
            c, view = super().update(observation), observation.grasp_map
            row, col = best_pixel(view.quality)
            if view.quality[row, col] > 0.1:
                self.best = replace(self.best, angle=float(view.angle[row, col]))
            return c
        """,
        by="kit",
    ),
    "position-in-the-camera": _grasp(
        "takes a lone peak: .*mm beside it", "position=g.position - [0.5, 0, 0]", by="kit"
    ),
    "opens-too-far": _grasp("takes a lone peak: .*opens 80 mm", "width=2 * g.width", by="kit"),
    "never-grasps": _controller(
        "takes a lone peak: .*returns None", "def final_grasp(self): return None", by="kit"
    ),
    "writes-into-the-view": _controller(
        "view left as it is: update writes into the observation's quality",
        """
        def update(self, observation):
            c = super().update(observation)
            observation.grasp_map.quality[:20] = 1
            return c
        """,
        by="kit",
    ),
}
"""Plug-ins that return what could be, and are wrong all the same."""

BAD_PLUG_INS: Mapping[str, BadPlugIn] = {**GUARDED, **LOADED, **KIT}
"""All of them, by name."""
