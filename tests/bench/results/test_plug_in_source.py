"""Laws of the hash of a plug-in's source."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from mpgrasp.bench.results.plug_in_source import source_hash

NET = "import numpy as np\nfrom my_plug.layers import width\nimport side\n\nclass Net:\n    pass\n"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Folder with the package my_plug, the module side that it uses, and one that it does not."""
    before = set(sys.modules)
    (tmp_path / "my_plug").mkdir()
    (tmp_path / "my_plug/__init__.py").write_text("")
    (tmp_path / "my_plug/net.py").write_text(NET)
    (tmp_path / "my_plug/layers.py").write_text("from my_plug import deep\ndef width():\n    return 1\n")
    (tmp_path / "my_plug/deep.py").write_text("depth = 3\n")
    (tmp_path / "side.py").write_text("from mpgrasp.grasp import Grasp\nfactor = 2\n")
    (tmp_path / "other.py").write_text("unrelated = True\n")
    monkeypatch.syspath_prepend(tmp_path)
    yield tmp_path
    for name in set(sys.modules) - before:
        if name.split(".")[0] in ("my_plug", "side", "other"):
            del sys.modules[name]


def hash_of(path: str = "my_plug.net:Net") -> str | None:
    return source_hash("detector", path)


@pytest.mark.parametrize("file", ["my_plug/net.py", "my_plug/layers.py", "my_plug/deep.py", "side.py"])
def test_a_change_of_any_module_that_a_plug_in_uses_changes_the_hash(folder: Path, file: str) -> None:
    before = hash_of()
    assert before is not None
    with (folder / file).open("a") as stream:
        stream.write("# changed\n")
    assert hash_of() != before


def test_a_change_of_what_it_does_not_use_changes_nothing(folder: Path) -> None:
    importlib.import_module("other")
    before = hash_of()
    (folder / "other.py").write_text("unrelated = False\n")
    assert hash_of() == before


def test_the_hash_is_the_same_wherever_the_folder_lies(
    folder: Path, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = hash_of("my_plug.net:Net")
    for name in [name for name in sys.modules if name.split(".")[0] in ("my_plug", "side")]:
        del sys.modules[name]
    moved = tmp_path_factory.mktemp("elsewhere") / "moved"
    folder.rename(moved)
    monkeypatch.syspath_prepend(moved)
    importlib.invalidate_caches()
    assert hash_of("my_plug.net:Net") == before
    moved.rename(folder)


def test_what_is_in_the_registry_has_no_source_of_its_own() -> None:
    assert source_hash("detector", "oracle") is None
    assert source_hash("controller", "mppc") is None
