"""The rule of the house: imports go one way, from room to room and inside a room."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

import mpgrasp

PACKAGE = Path(mpgrasp.__file__).parent

ORDER = (
    "exceptions", "extras", "names", "forking", "processes", "foreign_code",
    "linear_algebra", "geometry", "paths", "outcome", "workspace",
    "files", "command_line", "statistics", "anytime", "thresholds", "threshold_difference",
    "readings", "depth", "height_map", "grasp",
    "robot", "camera",
    "scene.objects", "scene",
    "detectors.antipodal", "detectors.networks", "detectors.runtimes", "detectors",
    "controllers", "guards", "motion", "recording", "episode",
    "suite", "brought", "plugin_names", "policies", "plugins", "settings",
    "env_ids", "env_spaces", "env", "clear_env", "inspection", "check", "offline", "view",
    "training.data", "training", "datasets",
    "bench.ladders",
    "bench.record", "bench.stored_lines", "bench.analysis", "bench.results", "bench.report", "bench.meshes",
    "bench.playing", "bench.profiling", "bench.commands", "bench", "evaluate", "api", "__main__",
)  # fmt: skip
"""Rooms of the house from the ground up: each may import what stands before it."""

NO_MUJOCO = ("detectors", "controllers")
NO_TORCH = ("robot", "camera", "scene", "motion", "controllers", "recording")
SOURCES = sorted(PACKAGE.rglob("*.py"))


class Import(NamedTuple):
    """One import of a module of this project."""

    line: int
    module: str
    runs_on_import: bool
    """Not inside of a function."""


def name_of(path: Path) -> str:
    parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {name_of(path) for path in SOURCES}


def room(module: str) -> str:
    """The longest name of `ORDER` that a module lies in; empty for `mpgrasp` itself."""
    words = module.split(".")[1:]
    names = (".".join(words[:k]) for k in range(len(words), 0, -1))
    return next((name for name in names if name in ORDER), "")


def is_command(module: str) -> bool:
    """Whether a module is what `python -m` runs: the door of a room, which nobody comes in by."""
    return module.endswith(".__main__")


def imports(path: Path) -> Iterator[Import]:
    """Every import, those of `if __name__ == "__main__"` blocks too, those for type checkers left out."""

    def walk(node: ast.AST, at_import: bool) -> Iterator[Import]:
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test):
            for otherwise in node.orelse:
                yield from walk(otherwise, at_import)
            return
        if isinstance(node, ast.Import):
            yield from (Import(node.lineno, alias.name, at_import) for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            for alias in node.names:  # `from mpgrasp.scene import export` names a module in its alias
                inner = f"{node.module}.{alias.name}"
                yield Import(node.lineno, inner if inner in MODULES else node.module, at_import)
        inside = at_import and not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda)
        for child in ast.iter_child_nodes(node):
            yield from walk(child, inside)

    yield from walk(ast.parse(path.read_text()), True)


def ours(path: Path) -> list[Import]:
    return [found for found in imports(path) if found.module.split(".")[0] == "mpgrasp"]


EVERY_MODULE = pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(PACKAGE)))


@EVERY_MODULE
def test_every_module_has_a_room(path: Path) -> None:
    assert name_of(path) == "mpgrasp" or room(name_of(path)), "give it a place in ORDER and in the design"


@EVERY_MODULE
def test_imports_go_to_the_same_or_an_earlier_room(path: Path) -> None:
    if is_command(name_of(path)):
        return  # a door stands at the top of the house; nobody may import it, as the next test says
    here = room(name_of(path))
    for line, module, _ in ours(path):
        there = room(module)
        if there:
            assert ORDER.index(there) <= ORDER.index(here), f"line {line}: {here} imports {there}"


@EVERY_MODULE
def test_nobody_imports_a_command(path: Path) -> None:
    doors = [(line, module) for line, module, _ in ours(path) if is_command(module)]
    assert not doors


@EVERY_MODULE
def test_nothing_below_the_benchmark_imports_it(path: Path) -> None:
    if room(name_of(path)).startswith(("bench", "evaluate", "api")):
        return
    assert not [found for found in ours(path) if found.module.startswith("mpgrasp.bench")]


def circle(graph: dict[str, set[str]]) -> list[str]:
    """Some circle of a graph, in order; empty if there is none."""
    done: set[str] = set()

    def visit(node: str, way: list[str]) -> list[str]:
        if node in way:
            return [*way[way.index(node) :], node]
        if node in done:
            return []
        for target in sorted(graph.get(node, ())):
            if found := visit(target, [*way, node]):
                return found
        done.add(node)
        return []

    return next((found for node in sorted(graph) if (found := visit(node, []))), [])


def test_no_module_imports_itself_by_a_way_around() -> None:
    """Imports inside of functions count: a circle that is put off is a circle."""
    graph = {name_of(path): {found.module for found in ours(path)} & MODULES for path in SOURCES}
    # the package itself hands on names lazily; what imports it for them stands in no circle of work
    assert circle({name: targets - {"mpgrasp"} for name, targets in graph.items()}) == []


def test_a_circle_would_be_found() -> None:
    assert circle({"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}}) == ["a", "b", "c", "a"]
    assert circle({"a": {"b", "c"}, "b": {"c"}, "c": set()}) == []


def used(path: Path) -> set[str]:
    return {found.module.split(".")[0] for found in imports(path)}


@EVERY_MODULE
def test_perception_knows_no_mujoco_the_world_no_torch_and_controllers_neither(path: Path) -> None:
    if is_command(name_of(path)):
        return
    here = room(name_of(path)).split(".")[0]
    banned = {"mujoco", "mink"} if here in NO_MUJOCO else set()
    banned |= {"torch"} if here in NO_TORCH else set()
    assert not used(path) & banned


@EVERY_MODULE
def test_imports_are_absolute(path: Path) -> None:
    relative = [n for n in ast.walk(ast.parse(path.read_text())) if isinstance(n, ast.ImportFrom) and n.level]
    assert not relative


HEAVY = ("torch", "mujoco", "rerun", "OpenGL")


def loaded(code: str, *arguments: str) -> list[str]:
    """Which of `HEAVY` some code has loaded at its end."""
    report = f"import atexit, sys; atexit.register(lambda: print([m for m in {HEAVY} if m in sys.modules]))"
    environment = {**os.environ, "PYTHONPATH": str(PACKAGE.parent)}
    command = [sys.executable, "-c", f"{report}\n{code}", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stderr
    names: list[str] = ast.literal_eval(done.stdout.splitlines()[-1])
    return names


@pytest.mark.parametrize(
    "module",
    ["mpgrasp", "mpgrasp.detectors", "mpgrasp.controllers", "mpgrasp.controllers.mppc", "mpgrasp.scene",
     "mpgrasp.scene.config", "mpgrasp.scene.objects.from_mesh", "mpgrasp.camera", "mpgrasp.camera.backends",
     "mpgrasp.robot.hand", "mpgrasp.motion", "mpgrasp.episode", "mpgrasp.episode.config",
     "mpgrasp.episode.result", "mpgrasp.episode.stages", "mpgrasp.suite", "mpgrasp.plugins", "mpgrasp.bench"],
)  # fmt: skip
def test_importing_a_room_loads_nothing_heavy(module: str) -> None:
    assert loaded(f"import {module}") == []


def test_importing_the_environment_loads_no_torch() -> None:
    assert "torch" not in loaded("import mpgrasp.env")


@pytest.mark.parametrize(
    "words",
    [("bench", "--help"), ("bench", "compare", "--help"), ("bench", "replay", "--help"),
     ("bench", "report", "--help"), ("bench", "settings", "--help"),
     ("detectors", "--help"), ("scene", "--help"), ("check", "--help"), ("check", "detector", "--help"),
     ("training", "--help"), ("training", "generate", "--help"), ("training", "train", "--help")],
)  # fmt: skip
def test_the_help_of_a_command_loads_nothing_heavy(words: tuple[str, ...]) -> None:
    assert loaded(command(words)) == []


def test_settings_are_printed_without_anything_heavy() -> None:
    assert loaded(command(("bench", "settings", "stacked", "--detector", "dhrnet,oracle"))) == []


def command(words: tuple[str, ...]) -> str:
    """Code that runs a command line."""
    module = f"mpgrasp.{words[0]}"
    return f"import runpy, sys; sys.argv = {list(words)}; runpy.run_module({module!r}, run_name='__main__')"


@pytest.mark.parametrize("package", sorted(path.parent for path in PACKAGE.rglob("__init__.pyi")))
def test_every_name_that_a_package_hands_on_is_there(package: Path) -> None:
    name = ".".join(package.relative_to(PACKAGE.parent).parts)
    module = __import__(name, fromlist=["*"])
    assert module.__all__
    for attribute in module.__all__:
        assert getattr(module, attribute) is not None


@pytest.mark.skipif(not (PACKAGE.parent / ".git").exists(), reason="no checkout")
def test_the_ignore_rules_hide_no_module() -> None:
    """A wheel leaves out what git ignores, even where it is tracked."""
    command = ["git", "check-ignore", "--no-index", *(str(path) for path in SOURCES)]
    assert subprocess.run(command, capture_output=True, text=True, cwd=PACKAGE.parent).stdout == ""
