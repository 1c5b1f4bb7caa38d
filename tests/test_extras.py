"""Laws of extras: what needs a library that is not there says which one, and how to get it."""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path

import pytest

import mpgrasp
from mpgrasp.bench.__main__ import main as bench
from mpgrasp.exceptions import ConfigError
from mpgrasp.extras import EXTRAS, check_installed, is_installed, missing_library
from mpgrasp.training.__main__ import main as training


def test_every_extra_is_declared_and_brings_its_library() -> None:
    project = Path(mpgrasp.__file__).parents[1] / "pyproject.toml"
    declared = tomllib.loads(project.read_text())["project"]["optional-dependencies"]
    packages = {"rerun": "rerun-sdk"}
    for library, extra in EXTRAS.items():
        package = packages.get(library, library.replace("_", "-"))
        assert any(need.startswith(package) for need in declared[extra]), library


def test_a_library_that_is_not_there_is_named_with_its_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    check_installed("torch", "training")
    monkeypatch.setitem(sys.modules, "torch", None)
    assert not is_installed("torch")
    with pytest.raises(ConfigError, match=r"training needs torch.*pip install 'mpgrasp\[torch\]'"):
        check_installed("torch", "training")


def test_an_import_that_fails_is_told_from_one_of_an_extra() -> None:
    assert missing_library(ModuleNotFoundError("no", name="rerun.blueprint")) == "rerun"
    assert missing_library(ModuleNotFoundError("no", name="numpy")) is None
    assert missing_library(ModuleNotFoundError("no")) is None


def test_a_command_without_its_library_is_one_line_and_exit_code_2(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "rerun", None)
    assert bench(["thin", "--episodes", "1", "--record", "1"]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "--record needs rerun, which is not installed; allowed: pip install 'mpgrasp[rerun]'" in said


def test_training_without_torch_is_one_line_and_exit_code_2(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    for name in [
        name for name in sys.modules if name.startswith(("mpgrasp.training.", "mpgrasp.detectors.net"))
    ]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "torch", None)
    assert (
        training(["train", "ggcnn2", "--data", str(tmp_path), "--out", str(tmp_path / "w.safetensors")]) == 2
    )
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "needs torch, which is not installed; allowed: pip install 'mpgrasp[torch]'" in said
