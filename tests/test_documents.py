"""The documents are true: commands parse, files and modules that they name exist, their code runs."""

from __future__ import annotations

import argparse
import importlib.util
import re
import runpy
import shlex
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import pytest

from mpgrasp.camera.backends import BACKENDS
from mpgrasp.camera.config import D435_INTRINSICS
from mpgrasp.depth import DepthFrame
from mpgrasp.detectors import make_detector
from mpgrasp.detectors.networks.registry import NETWORKS
from mpgrasp.detectors.runtimes import RUNTIMES
from mpgrasp.episode.episode import run_episode
from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import looking_down
from mpgrasp.outcome import Outcome
from mpgrasp.plugins import controller_names, detector_names
from mpgrasp.scene.config import SceneConfig
from mpgrasp.suite import suite_names

ROOT = Path(__file__).resolve().parent.parent
DOCUMENTS = {
    path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8")
    for path in (
        *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "benchmarks/README.md")),
        *sorted((ROOT / "docs").glob("*.md")),
    )
}
PRESENT = {name: text for name, text in DOCUMENTS.items() if name != "CHANGELOG.md"}
"""Documents of what is so now; the changelog tells what was."""
EVERY_DOCUMENT = pytest.mark.parametrize("name", DOCUMENTS)
EVERY_PRESENT_DOCUMENT = pytest.mark.parametrize("name", PRESENT)
NUMBERS = {"K": "0", "N": "1", "S": "0", "W": "5", "Z": "0.5"}
"""Placeholders of numbers, each with a number to parse."""
FREE = re.compile(r"[A-Z]+|[\w/]+\.toml|\w+:\w+|sb3:[\w/]+\.zip|\./\w+\.py:\w+|\w+@[\w/]+\.safetensors")
"""Names of a reader's own: to be filled in, a file, a plug-in."""
OURS = re.compile(r"(benchmarks)\.(\w+):(\w+)")


def commands(text: str) -> list[list[str]]:
    """Return every indented or quoted `python ...` command of a text, without its comment."""
    quoted = r"`(python\s(?:-m\s(?!pytest)|benchmarks/)[^`|]+)`"
    found = re.findall(rf"^    (?:\$ )?(python .+)$|{quoted}", text, re.MULTILINE)
    return [shlex.split((a or b).partition(" > ")[0], comments=True) for a, b in found]


COMMANDS = [command for text in DOCUMENTS.values() for command in commands(text)]


class Parsed(BaseException):
    """Ends a program as soon as its command line has been read."""

    def __init__(self, arguments: argparse.Namespace) -> None:
        self.arguments = arguments


class Refused(BaseException):
    """Ends a program that cannot read its command line."""


def parsed(command: list[str], monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Return what a program takes the command's words for; it is started as they say and does no more."""
    real = argparse.ArgumentParser.parse_args

    def read_and_end(parser: Any, words: Any = None, namespace: Any = None) -> NoReturn:
        try:
            arguments = real(parser, words, namespace)
        except (ConfigError, SystemExit) as error:
            raise Refused(error) from None
        raise Parsed(arguments)

    words = [NUMBERS.get(word, word) for word in command[2:]]
    monkeypatch.setattr(argparse.ArgumentParser, "parse_args", read_and_end)
    monkeypatch.setattr("sys.argv", words if command[1] == "-m" else command[1:2] + words)
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))
    try:
        if command[1] == "-m":
            with warnings.catch_warnings(action="ignore"):  # of modules that the tests have loaded already
                runpy.run_module(command[2], run_name="__main__")
        else:
            runpy.run_path(str(ROOT / command[1]), run_name="__main__")
    except Parsed as found:
        return vars(found.arguments)
    raise AssertionError(f"{command} reads no command line")


def unknown(arguments: Mapping[str, Any]) -> list[str]:
    """Return names in a command that are in no registry and no reader's own."""
    suites = (*suite_names(), "paper")
    known = {
        "suite": suites,
        "suites": suites,
        "detector": detector_names(),
        "controller": controller_names(),
        "network": tuple(NETWORKS),
        "name": tuple(NETWORKS),
        "camera": BACKENDS,
        "runtime": RUNTIMES,
    }
    names = [(kind, name) for kind in known for name in str(arguments.get(kind) or "").split(",") if name]
    return [
        f"{kind} {name}" for kind, name in names
        if name not in known[kind] and not FREE.fullmatch(name) and not is_ours(OURS.fullmatch(name))
    ]  # fmt: skip


def is_ours(plug_in: re.Match[str] | None) -> bool:
    """Return True if a plug-in of ours, folder.module:Class, is defined where its name says."""
    if plug_in is None:
        return False
    folder, module, name = plug_in.groups()
    file = ROOT / folder / f"{module}.py"
    return file.is_file() and f"class {name}(" in file.read_text(encoding="utf-8")


def reads_a_command_line(command: list[str]) -> bool:
    if command[1] == "-m":
        source = Path(*command[2].split(".")).with_suffix(".py")
        return not (ROOT / source).is_file() or "parse_args" in (ROOT / source).read_text(encoding="utf-8")
    return "parse_args" in (ROOT / command[1]).read_text(encoding="utf-8")


def named_files(text: str) -> set[str]:
    """Return the paths into the repository that a text quotes."""
    folders = "mpgrasp|assets|scenes|benchmarks|tests|docs"
    return set(re.findall(rf"`((?:{folders})/[\w./-]*|[A-Z]+\.(?:md|cff))`", text))


@pytest.mark.parametrize("command", sorted({shlex.join(command) for command in COMMANDS}))
def test_a_program_takes_its_command_and_knows_all_names_in_it(
    command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    words = shlex.split(command)
    if reads_a_command_line(words):
        assert not unknown(parsed(words, monkeypatch))
    else:
        assert len(words) == (3 if words[1] == "-m" else 2)


def test_commands_of_all_programs_are_among_these() -> None:
    programs = {(c[1], *c[2:3]) if c[1] == "-m" else (Path(c[1]).name,) for c in COMMANDS}
    modules = {f"mpgrasp.{name}" for name in ("bench", "detectors", "scene", "training")}
    studies = {"ablation.py", "held_out.py", "run_time.py", "table.py", "thickness.py"}
    assert programs >= {("-m", name) for name in modules} | {(name,) for name in studies}
    bench = {c[3] for c in COMMANDS if c[2:3] == ["mpgrasp.bench"]}
    assert bench >= {"compare", "replay", "report", "paper", *suite_names()} - {"unseen", "thin_variants"}
    assert {c[3] for c in COMMANDS if c[2:3] == ["mpgrasp.detectors"]} == {"show", "check", "card", "graph"}
    assert {c[3] for c in COMMANDS if c[2:3] == ["mpgrasp.training"]} == {"calibrate", "generate", "train"}


@pytest.mark.parametrize(
    ("command", "wrong"),
    [
        ("python -m mpgrasp.bench thin --detector dhrnet,resnet", "detector resnet"),
        ("python -m mpgrasp.bench thick --controller pid", "suite thick"),
        ("python -m mpgrasp.detectors card dhrnet2", "detector dhrnet2"),
        ("python -m mpgrasp.bench thin --camera stereo", "camera stereo"),
        ("python -m mpgrasp.training train hrnet --data DIR", "name hrnet"),
    ],
)
def test_a_name_that_is_in_no_registry_would_be_found(
    command: str, wrong: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert wrong in unknown(parsed(command.split(), monkeypatch))


@pytest.mark.parametrize(
    "command",
    [
        "python -m mpgrasp.bench thin --frobnicate",
        "python -m mpgrasp.bench replay RUN --episode three",
        "python -m mpgrasp.bench report",
        "python -m mpgrasp.training evaluate",
        "python -m mpgrasp.scene thin --height 3",
        "python benchmarks/ablation.py colour",
        "python benchmarks/table.py --read",
    ],
)
def test_an_option_that_is_not_there_would_be_found(command: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(Refused):
        parsed(command.split(), monkeypatch)


@EVERY_DOCUMENT
def test_every_make_target_exists(name: str) -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for target in re.findall(r"(?:^    |`)make (\w+)", DOCUMENTS[name], re.MULTILINE):
        assert re.search(rf"^{target}:", makefile, re.MULTILINE), target


@EVERY_DOCUMENT
def test_every_local_link_and_picture_exists(name: str) -> None:
    for target in re.findall(r"\]\(([^)]+)\)", DOCUMENTS[name]):
        if not target.startswith("http"):
            assert (ROOT / Path(name).parent / target).exists(), target


@EVERY_PRESENT_DOCUMENT
def test_every_file_that_is_named_exists(name: str) -> None:
    for file in named_files(PRESENT[name]):
        if not file.startswith("benchmarks/results/NAME"):
            assert (ROOT / file).exists(), file


@EVERY_PRESENT_DOCUMENT
def test_every_module_that_is_named_exists(name: str) -> None:
    for words in re.findall(r"`(mpgrasp(?:\.\w+)+)`", PRESENT[name]):
        module, _, attribute = words.rpartition(".")
        try:
            found = importlib.util.find_spec(words)
        except ModuleNotFoundError:  # the parent is a module, not a package
            found = None
        assert found or hasattr(importlib.import_module(module), attribute), words


def test_a_file_that_is_missing_would_be_found() -> None:
    assert named_files("see `mpgrasp/reflex.py`, `docs/results.md` and `pip`") == {
        "mpgrasp/reflex.py",
        "docs/results.md",
    }
    assert not (ROOT / "mpgrasp/reflex.py").exists()


def plug_in(name: str, **namespace: Any) -> Any:
    """Return the class of that name from the code of docs/extending.md."""
    for block in re.findall(r"```python\n(.*?)```", DOCUMENTS["docs/extending.md"], re.DOTALL):
        if f"class {name}:" in block:
            exec(block, namespace)
            return namespace[name]
    raise AssertionError(f"no class {name} in docs/extending.md")


def test_the_detector_of_the_documents_maps_a_frame() -> None:
    detector = plug_in("MyDetector", my_network=lambda depth: (np.zeros_like(depth),) * 3)()
    frame = DepthFrame(
        depth=np.full((480, 640), 0.5, np.float32),
        intrinsics=D435_INTRINSICS,
        T_world_camera=looking_down([0.5, 0.0, 0.5]),
    )
    assert detector.predict(frame).quality.shape == (224, 224)


def test_the_camera_s_frame_of_the_documents_can_be_made() -> None:
    (block,) = re.findall(r"```python\n([^`]*from_camera.*?)```", DOCUMENTS["docs/extending.md"], re.DOTALL)
    made: dict[str, Any] = {"z16": np.full((480, 640), 450, np.uint16), "T": looking_down([0.5, 0.0, 0.5])}
    exec(block, made)
    np.testing.assert_allclose(made["frame"].depth, 0.45, rtol=1e-6)


def test_the_evaluation_of_the_documents_gives_a_table(capsys: pytest.CaptureFixture[str]) -> None:
    (block,) = re.findall(
        r"```python\n([^`]*mpgrasp\.evaluate.*?)```", DOCUMENTS["docs/extending.md"], re.DOTALL
    )
    exec(block, {})
    assert "mine      straight_down  1" in capsys.readouterr().out


def test_the_controller_of_the_documents_grasps() -> None:
    result = run_episode(
        SceneConfig(objects=("usb_stick",), half_extent=0.03),
        seed=3,
        detector=make_detector("oracle"),
        controller=plug_in("StraightDown")(),
    )
    assert result.outcome is Outcome.SUCCESS
