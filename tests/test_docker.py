"""Laws of the container: it installs what the checkout's own commands install, and nothing else."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

import mpgrasp
from mpgrasp.__main__ import main

ROOT = Path(mpgrasp.__file__).parents[1]
DOCKERFILE = (ROOT / "Dockerfile").read_text()


def packages(text: str) -> set[str]:
    """The Debian packages of an apt-get line."""
    (line,) = re.findall(r"apt-get install ((?:[\w.-]+ ?)+)", text.replace("\\\n", " "))
    return {word for word in line.split() if not word.startswith("-")}


def test_the_container_has_the_opengl_of_make_gl() -> None:
    recipe = (ROOT / "Makefile").read_text().partition("\ngl:")[2].partition("\ndemo:")[0]
    (line,) = re.findall(r"--no-install-recommends ([\w.-]+(?: [\w.-]+)*) >", recipe)
    assert packages(DOCKERFILE) == set(line.split())


def test_its_extras_are_declared() -> None:
    declared = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    named = re.findall(r"EXTRAS=([\w,]+)", DOCKERFILE)
    assert len(named) == 2
    assert {extra for names in named for extra in names.split(",")} <= set(declared)


def test_its_python_is_the_oldest_that_mpgrasp_takes_which_is_the_one_that_it_is_checked_for() -> None:
    (version,) = re.findall(r"^FROM python:([\d.]+)-slim$", DOCKERFILE, re.MULTILINE)
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    assert project["project"]["requires-python"] == f">={version}"
    assert project["tool"]["mypy"]["python_version"] == version


def test_the_command_that_it_runs_exists(capsys: pytest.CaptureFixture[str]) -> None:
    (entry,) = re.findall(r"^ENTRYPOINT \[\"(\w+)\"\]$", DOCKERFILE, re.MULTILINE)
    scripts = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["scripts"]
    assert entry in scripts
    assert main(["bench", "--help"]) == 0
    assert "usage" in capsys.readouterr().out


def test_nothing_that_the_wheel_needs_is_left_out_of_it() -> None:
    ignored = {line.strip("*/").partition("/")[0] for line in (ROOT / ".dockerignore").read_text().split()}
    needed = {"mpgrasp", "assets", "scenes", "benchmarks", "pyproject.toml", "hatch_build.py", "README.md"}
    assert not ignored & needed
