"""The house rule: imports go one way."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

import mpgrasp

PACKAGE = Path(mpgrasp.__file__).parent

PERCEPTION, WORLD = "perception", "world"
ROWS: dict[str, tuple[int, str]] = {
    **dict.fromkeys(
        ["exceptions", "paths", "geometry", "plain", "replace_file", "result_cache", "command_line"], (1, "")
    ),
    **dict.fromkeys(["depth", "sensor_noise", "height_map", "grasp", "false_colour"], (2, "")),
    **dict.fromkeys(["detectors", "grid_map", "entropy"], (3, PERCEPTION)),
    **dict.fromkeys(
        ["object_model", "objects", "mesh_objects", "mesh_surface", "terrain", "settling", "scene"],
        (3, WORLD),
    ),
    **dict.fromkeys(
        [
            "panda",
            "contacts",
            "gripper_drive",
            "free_gripper",
            "simulation",
            "rasteriser",
            "ray_caster",
            "height_field_rays",
            "convex_rays",
            "camera",
            "ik",
            "reflex",
            "motion",
            "pacing",
            "trajectory",
        ],
        (3, WORLD),
    ),
    "controllers": (4, ""),
    **dict.fromkeys(["film", "rerun_model", "rerun_recorder"], (5, "")),
    **dict.fromkeys(
        [
            "driver",
            "execution",
            "execution_config",
            "lift_trial",
            "clearing",
            "episode",
            "episode_config",
            "episode_metrics",
            "episode_result",
            "recording",
        ],
        (5, ""),
    ),
    **dict.fromkeys(["scene_file", "env", "bench", "training", "show", "runtime_check"], (6, "")),
}
FORBIDDEN = {
    PERCEPTION: {"mujoco", "mink"},
    WORLD: {"torch"},
    "controllers": {"mujoco", "mink", "torch"},
}
SOURCES = sorted(PACKAGE.rglob("*.py"))


def unit(module: str) -> str:
    """`mpgrasp.detectors.oracle` belongs to `detectors`; `mpgrasp` itself to the empty name."""
    return [*module.split("."), ""][1]


def module_name(path: Path) -> str:
    parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imports(path: Path) -> list[tuple[str, bool]]:
    """(module, runs when the file is imported) of every import, those for type checkers left out."""
    found: list[tuple[str, bool]] = []

    def walk(node: ast.AST, at_import: bool) -> None:
        if isinstance(node, ast.If) and "__main__" in ast.dump(node.test):
            return  # a command at a module's foot may use whatever it likes
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test):
            for otherwise in node.orelse:
                walk(otherwise, at_import)
            return
        if isinstance(node, ast.Import):
            found.extend((alias.name, at_import) for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            # `from mpgrasp import episode` names the module in its aliases
            names = [f"mpgrasp.{a.name}" for a in node.names] if node.module == "mpgrasp" else [node.module]
            found.extend((name, at_import) for name in names)
        inside = at_import and not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda)
        for child in ast.iter_child_nodes(node):
            walk(child, inside)

    walk(ast.parse(path.read_text()), True)
    return found


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_imports_go_to_the_same_or_an_earlier_row(path: Path) -> None:
    here = unit(module_name(path))
    if not here:
        return
    assert here in ROWS, f"{here} has no row: give it one here and in the design"
    row, half = ROWS[here]
    for target, _ in imports(path):
        there = unit(target) if target.split(".")[0] == "mpgrasp" else ""
        if not there or there not in ROWS:
            continue
        their_row, their_half = ROWS[there]
        assert their_row <= row, f"{here} (row {row}) imports {there} (row {their_row})"
        blind = row == their_row == 3 and half != their_half
        assert not blind, f"{here} and {there} are in the two halves that do not know each other"


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_perception_knows_no_mujoco_the_world_no_torch_and_controllers_neither(path: Path) -> None:
    here = unit(module_name(path))
    banned = FORBIDDEN.get(here) or FORBIDDEN.get(ROWS.get(here, (0, ""))[1], set())
    used = {target.split(".")[0] for target, _ in imports(path)}
    assert not used & banned, f"{here} must not import {used & banned}"


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_imports_are_absolute(path: Path) -> None:
    relative = [n for n in ast.walk(ast.parse(path.read_text())) if isinstance(n, ast.ImportFrom) and n.level]
    assert not relative


@pytest.mark.parametrize(
    ("module", "heavy"),
    [
        ("mpgrasp", ("torch", "mujoco", "rerun", "OpenGL")),
        ("mpgrasp.detectors", ("torch", "mujoco", "rerun", "OpenGL")),
        ("mpgrasp.controllers", ("torch", "mujoco", "rerun", "OpenGL")),
        ("mpgrasp.controllers.mppc", ("torch", "mujoco", "rerun", "OpenGL")),
        ("mpgrasp.bench", ("torch", "OpenGL")),
        ("mpgrasp.env", ("torch", "rerun", "OpenGL")),
    ],
)
def test_importing_a_registry_loads_nothing_heavy(module: str, heavy: tuple[str, ...]) -> None:
    code = f"import sys, {module}; print([m for m in {heavy} if m in sys.modules])"
    environment = {**os.environ, "PYTHONPATH": str(PACKAGE.parent)}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "[]"
