"""The README is short, shows what mpgrasp is on its first screen, and its code runs as it says."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
FIRST_SCREEN = 25
"""Lines."""


def test_it_is_short() -> None:
    assert len(README.encode()) <= 9216


def test_picture_commands_and_code_are_on_the_first_screen() -> None:
    screen = "\n".join(README.splitlines()[:FIRST_SCREEN])
    for sight in ("docs/episode.png", "    make demo", "    make test", "mpgrasp.run_episode("):
        assert sight in screen


def test_it_has_a_table_of_ladders_and_below_it_one_of_the_saturated_suites() -> None:
    ladders, trials = re.findall(r"((?:^\|.*\n)+)", README, re.MULTILINE)
    assert "thickness" in ladders
    assert "unseen" in trials
    assert all(len(table.splitlines()) - 2 <= 10 for table in (ladders, trials))


def test_its_ten_lines_of_python_print_what_it_says(tmp_path: Path) -> None:
    (code,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    assert len(code.splitlines()) <= 10
    printed = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=120, cwd=tmp_path
    ).stdout
    assert f"It prints `{printed.strip()}`." in README


def test_no_link_breaks_on_a_page_without_the_repository() -> None:
    """An index of packages shows the README alone: a picture has its text there, a link leads nowhere."""
    links = re.findall(r"(!?)\[[^]]*\]\(([^)]+)\)", README)
    assert links
    assert [target for picture, target in links if not picture and not target.startswith("http")] == []


def test_it_is_the_page_of_the_package() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["readme"] == "README.md"


def test_the_citation_is_of_this_version_and_names_the_paper() -> None:
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    version = re.search(r'^__version__ = "(.+)"', (ROOT / "mpgrasp/__init__.py").read_text(), re.MULTILINE)
    assert version
    assert f"\nversion: {version[1]}\n" in citation
    assert "\ncff-version: 1.2.0\n" in "\n" + citation
    title = "A Novel Framework for Improved Grasping of Thin and Stacked Objects"
    assert title in citation
    assert title in README
