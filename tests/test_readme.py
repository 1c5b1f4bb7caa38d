"""The README is true: its commands parse, its links lead somewhere, its code runs, its numbers are so."""

from __future__ import annotations

import importlib.util
import json
import re
import shlex
from pathlib import Path

import numpy as np
import pytest

from mpgrasp.bench.__main__ import make_parser
from mpgrasp.camera import D435_INTRINSICS
from mpgrasp.depth import DepthFrame
from mpgrasp.geometry import looking_down

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
RESULTS = ROOT / "benchmarks" / "results"


def commands(text: str) -> list[list[str]]:
    """Every indented or quoted `python ...` command, without its comment."""
    found = re.findall(r"^    (?:\$ )?(python .+)$|`(python -m [^`]+)`", text, re.MULTILINE)
    return [shlex.split(a or b, comments=True) for a, b in found]


def load_table():
    spec = importlib.util.spec_from_file_location("table", ROOT / "benchmarks" / "table.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_bench_command_parses() -> None:
    bench = [c for c in commands(README) if c[1:3] == ["-m", "mpgrasp.bench"]]
    assert len(bench) >= 4
    for command in bench:
        make_parser().parse_args(command[3:])


def test_every_command_names_a_module_or_a_file_that_exists() -> None:
    for command in commands(README):
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
        lines = (RESULTS / run / "episodes.jsonl").read_text().splitlines()
        of_dhrnet = [line for line in map(json.loads, lines) if line["detector"] == "dhrnet"]
        return [(line["episode"], line["outcome"]) for line in of_dhrnet]

    with_gl, without = outcomes("thin-mppc"), outcomes("without-gl/thin-dhrnet-mppc")
    same = sum(a == b for a, b in zip(with_gl, without, strict=True))
    assert f"the same in {same} of {len(without)} episodes" in README


def test_the_results_table_says_what_the_summaries_say() -> None:
    table = load_table()
    inside = README.split(table.BEGIN)[1].split(table.END)[0].strip()
    assert inside == table.table()


@pytest.mark.parametrize("path", sorted(RESULTS.rglob("summary.json")), ids=lambda p: p.parent.name)
def test_a_published_summary_follows_from_its_episodes(path: Path) -> None:
    lines = [json.loads(line) for line in (path.parent / "episodes.jsonl").read_text().splitlines()]
    run = json.loads((path.parent / "run.json").read_text())
    assert run["command"].startswith("python -m mpgrasp.bench")
    assert re.fullmatch(r"[0-9a-f]{40}", run["made_with"]["git"]["commit"])
    for cell in json.loads(path.read_text())["cells"]:
        mine = [
            x for x in lines if (x["detector"], x["controller"]) == (cell["detector"], cell["controller"])
        ]
        assert len(mine) == cell["n"]
        assert sum(x["success"] for x in mine) == cell["successes"]
        assert len({x["scene_seed"] for x in mine}) == cell["n"]
