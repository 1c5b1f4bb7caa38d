"""The READMEs are true: their commands parse, its links lead somewhere, its code runs, its numbers are so."""

from __future__ import annotations

import argparse
import importlib.util
import json
import re
import runpy
import shlex
import warnings
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import pytest

from mpgrasp.bench.__main__ import SUBCOMMANDS
from mpgrasp.bench.analysis.summary import paired_tests, summarise
from mpgrasp.bench.playing.plan import CAMERA_BACKENDS
from mpgrasp.bench.playing.programme import PROGRAMMES
from mpgrasp.camera.wrist_camera import D435_INTRINSICS
from mpgrasp.depth import DepthFrame
from mpgrasp.detectors.networks.registry import NETWORKS
from mpgrasp.detectors.runtimes import RUNTIMES
from mpgrasp.exceptions import ConfigError
from mpgrasp.files.json_values import plain
from mpgrasp.geometry import looking_down
from mpgrasp.plugins import controller_names, detector_names
from mpgrasp.suite import suite_names

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
RESULTS = ROOT / "benchmarks" / "results"
STUDIES_README = (ROOT / "benchmarks" / "README.md").read_text(encoding="utf-8")
NUMBERS = {"K": "0", "N": "1", "S": "0", "W": "5", "Z": "0.5"}
"""What may stand in the place of a number, and a number."""


def commands(text: str) -> list[list[str]]:
    """Every indented or quoted `python ...` command, without its comment."""
    found = re.findall(r"^    (?:\$ )?(python .+)$|`(python\s(?:-m\s|benchmarks/)[^`]+)`", text, re.MULTILINE)
    return [shlex.split(a or b, comments=True) for a, b in found]


COMMANDS = commands(README) + commands(STUDIES_README)


class Parsed(BaseException):
    """Ends a program as soon as its command line has been read."""

    def __init__(self, arguments: argparse.Namespace) -> None:
        self.arguments = arguments


class Refused(BaseException):
    """Ends a program that cannot read its command line."""


def parsed(command: list[str], monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """What a program, started as the command says, takes the command's words for; it does nothing else."""
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
    """Names in a command that are in no registry, nor a file's, nor a plug-in's, nor to be filled in."""
    suites = (*suite_names(), *PROGRAMMES)
    known = {
        "suite": suites,
        "suites": suites,
        "detector": detector_names(),
        "controller": controller_names(),
        "network": tuple(NETWORKS),
        "name": tuple(NETWORKS),
        "camera": CAMERA_BACKENDS,
        "runtime": RUNTIMES,
    }
    names = [(kind, name) for kind in known for name in str(arguments.get(kind) or "").split(",") if name]
    free = re.compile(r"[A-Z]+|[\w/]+\.toml|\w+:\w+")
    ours = re.compile(r"(benchmarks)\.(\w+):(\w+)")
    return [
        f"{kind} {name}" for kind, name in names
        if name not in known[kind] and not free.fullmatch(name) and not there(ours.fullmatch(name))
    ]  # fmt: skip


def there(plug_in: re.Match[str] | None) -> bool:
    """Whether a plug-in of ours, folder.module:Class, is defined where its name says."""
    if plug_in is None:
        return False
    folder, module, name = plug_in.groups()
    file = ROOT / folder / f"{module}.py"
    return file.is_file() and f"class {name}(" in file.read_text(encoding="utf-8")


def load_table():
    spec = importlib.util.spec_from_file_location("table", ROOT / "benchmarks" / "table.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("command", sorted({shlex.join(command) for command in COMMANDS}))
def test_a_program_takes_its_command_and_knows_all_names_in_it(
    command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    words = shlex.split(command)
    if words[1:3] == ["-m", "mpgrasp.bench"] and len(words) == 4 and words[3] in SUBCOMMANDS:
        return  # the bare name of a subcommand, in running text
    if words[1] != "-m" and "parse_args" not in (ROOT / words[1]).read_text(encoding="utf-8"):
        assert words[2:] == []
        return
    assert not unknown(parsed(words, monkeypatch))


def test_commands_of_all_programs_are_among_these() -> None:
    programs = {(c[1], *c[2:3]) if c[1] == "-m" else (Path(c[1]).name,) for c in COMMANDS}
    modules = {f"mpgrasp.{name}" for name in ("bench", "detectors", "scene", "training")}
    assert programs >= {("-m", name) for name in modules} | {("ablation.py",), ("table.py",)}
    assert {c[3] for c in COMMANDS if c[2:3] == ["mpgrasp.bench"]} >= {"compare", "replay", "thin", "paper"}
    assert {c[3] for c in COMMANDS if c[2:3] == ["mpgrasp.detectors"]} == {"show", "check", "card"}
    assert {c[3] for c in COMMANDS if c[2:3] == ["mpgrasp.training"]} == {"generate", "train"}


@pytest.mark.parametrize(
    ("command", "wrong"),
    [
        ("python -m mpgrasp.bench thin --detector dhrnet,resnet", "detector resnet"),
        ("python -m mpgrasp.bench thick --controller pid", "suite thick"),
        ("python -m mpgrasp.detectors card dhrnet2", "detector dhrnet2"),
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


def test_every_command_names_a_module_or_a_file_that_exists() -> None:
    for command in COMMANDS:
        if command[1] == "-m":
            assert importlib.util.find_spec(command[2]) is not None, command
        else:
            assert (ROOT / command[1]).is_file(), command


def test_every_make_target_exists() -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = re.findall(r"^    make (\w+)", README, re.MULTILINE)
    assert "demo" in targets
    assert "test" in targets
    for target in targets:
        assert re.search(rf"^{target}:", makefile, re.MULTILINE), target


def test_every_local_link_and_picture_exists() -> None:
    for target in re.findall(r"\]\(([^)]+)\)", README):
        if not target.startswith("http"):
            assert (ROOT / target).exists(), target


def test_the_detector_of_the_readme_runs() -> None:
    blocks = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    namespace: dict = {"my_network": lambda depth: (np.zeros_like(depth),) * 3}
    exec(blocks[0], namespace)
    frame = DepthFrame(
        depth=np.full((480, 640), 0.5, np.float32),
        intrinsics=D435_INTRINSICS,
        T_world_camera=looking_down([0.5, 0.0, 0.5]),
    )
    detector = namespace["MyDetector"]()
    assert detector.predict(frame).quality.shape == (224, 224)


def test_nothing_is_left_to_fill_in() -> None:
    assert not re.findall(r"@[A-Z]+@", README)
    assert len(load_table().cells()) >= 4


def test_the_share_of_equal_outcomes_without_gl_is_the_published_runs() -> None:
    def outcomes(run: str) -> list[tuple[int, str]]:
        lines = map(json.loads, (RESULTS / run / "episodes.jsonl").read_text().splitlines())
        cell = "thin", "dhrnet", "mppc"
        return [
            (line["episode"], line["outcome"])
            for line in lines
            if (line["suite"], line["detector"], line["controller"]) == cell
        ]

    with_gl, without = outcomes("unseen-thin"), outcomes("without-gl/thin-dhrnet-mppc")
    same = sum(a == b for a, b in zip(with_gl, without, strict=True))
    assert f"the same in {same} of {len(without)} episodes" in README


def test_the_results_table_says_what_the_summaries_say() -> None:
    table = load_table()
    inside = README.split(table.BEGIN)[1].split(table.END)[0].strip()
    assert inside == table.table()


def test_a_cell_that_two_published_runs_have_played_is_refused(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    table = load_table()
    monkeypatch.setattr(table, "RESULTS", tmp_path)
    cell = {"suite": "thin", "detector": "oracle", "controller": "mppc", "n": 1}
    for run, found in (("a", [cell]), ("b", [{**cell, "controller": "mvp"}])):
        (tmp_path / run).mkdir()
        (tmp_path / run / "summary.json").write_text(json.dumps({"complete": True, "cells": found}))
    assert len(table.cells()) == 2
    (tmp_path / "b" / "summary.json").write_text(json.dumps({"complete": True, "cells": [{**cell, "n": 2}]}))
    with pytest.raises(ConfigError, match=r"two runs have played thin/oracle/mppc; got \['a', 'b'\]"):
        table.table()


def assert_alike(ours: Any, published: Any, where: str = "") -> None:
    """The same JSON but for the last bits of floats."""
    if isinstance(ours, dict) and isinstance(published, dict):
        assert list(ours) == list(published), where
        for key, value in ours.items():
            assert_alike(value, published[key], f"{where}.{key}")
    elif isinstance(ours, list) and isinstance(published, list):
        assert len(ours) == len(published), where
        for k, (one, other) in enumerate(zip(ours, published, strict=True)):
            assert_alike(one, other, f"{where}.{k}")
    elif isinstance(ours, float) and published is not None:
        assert published == pytest.approx(ours, rel=1e-6), where
    else:
        assert ours == published, where


@pytest.mark.parametrize("path", sorted(RESULTS.rglob("summary.json")), ids=lambda p: p.parent.name)
def test_a_published_summary_follows_from_its_episodes(path: Path) -> None:
    lines = [json.loads(line) for line in (path.parent / "episodes.jsonl").read_text().splitlines()]
    run = json.loads((path.parent / "run.json").read_text())
    assert run["command"].startswith("python -m mpgrasp.bench")
    assert re.fullmatch(r"[0-9a-f]{40}", run["made_with"]["git"]["commit"])
    summary = json.loads(path.read_text())
    for key, found in (("cells", summarise(lines)), ("paired_tests", paired_tests(lines))):
        assert_alike(plain(found), summary[key], key)
    which = ("suite", "detector", "controller")
    played = [line for line in lines if line["outcome"] != "error"]
    counts = Counter(tuple(line[key] for key in which) for line in played)
    successes = Counter(tuple(line[key] for key in which) for line in played if line["success"])
    worlds = {(*(line[key] for key in which), line["scene_seed"]) for line in played}
    assert len(worlds) == len(played)
    cells = {tuple(cell[key] for key in which): cell for cell in summary["cells"]}
    assert {key: cell["n"] for key, cell in cells.items() if cell["n"]} == counts
    assert {key: cell["successes"] for key, cell in cells.items() if cell["successes"]} == successes
