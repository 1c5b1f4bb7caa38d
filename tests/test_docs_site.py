"""The documentation as pages: every document has its place, and the reference names what is there."""

from __future__ import annotations

import importlib
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
CONFIG = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
REFERENCE = (ROOT / "docs" / "reference.md").read_text(encoding="utf-8")
NAMES = re.findall(r"^::: ([\w.]+)$", REFERENCE, re.MULTILINE)


def test_every_document_is_in_the_navigation_once() -> None:
    named = re.findall(r"^ +- [^:]+: ([\w-]+\.md)$", CONFIG, re.MULTILINE)
    assert sorted(named) == sorted(path.name for path in (ROOT / "docs").glob("*.md"))


@pytest.mark.parametrize("name", NAMES)
def test_the_reference_names_what_is_there_and_documented(name: str) -> None:
    module, _, attribute = name.rpartition(".")
    found = getattr(importlib.import_module(module), attribute)
    assert (found.__doc__ or "").strip()


def test_the_reference_has_what_the_package_hands_on_for_users() -> None:
    assert {name.rpartition(".")[2] for name in NAMES} >= {
        "evaluate", "Results", "DepthFrame", "GraspMap", "GraspDetector", "Controller", "GraspEnv",
    }  # fmt: skip


@pytest.mark.skipif(shutil.which("mkdocs", path=str(Path(sys.executable).parent)) is None, reason="no mkdocs")
def test_the_pages_are_built_without_a_warning(tmp_path: Path) -> None:
    command = [
        sys.executable,
        "-m",
        "mkdocs",
        "build",
        "--strict",
        "--quiet",
        "--site-dir",
        str(tmp_path / "site"),
    ]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 0, done.stderr
    page = (tmp_path / "site" / "reference.html").read_text(encoding="utf-8")
    assert "Play a suite and return the results" in page
