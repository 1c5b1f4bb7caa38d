from __future__ import annotations

import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from mpgrasp import paths

REPOSITORY = Path(__file__).parent.parent


@pytest.mark.parametrize("name", ["PANDA_ASSETS", "OBJECT_ASSETS", "WEIGHTS", "SCENES", "BENCHMARKS"])
def test_every_data_folder_is_there_and_not_empty(name: str) -> None:
    folder: Path = getattr(paths, name)
    assert folder.is_dir()
    assert any(folder.iterdir())


def test_a_wheel_carries_all_that_the_checkout_offers(tmp_path: Path) -> None:
    pytest.importorskip("hatchling")
    subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(tmp_path)],
        cwd=REPOSITORY,
        check=True,
        capture_output=True,
    )
    (wheel,) = tmp_path.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
        archive.extractall(tmp_path / "site")
    files = {f"mpgrasp/_data/benchmarks/{file.name}" for file in (REPOSITORY / "benchmarks").glob("*.toml")}
    files |= {"mpgrasp/_data/scenes/table.xml", "mpgrasp/_data/assets/objects/objects.toml"}
    package = (file for file in (REPOSITORY / "mpgrasp").rglob("*") if "__pycache__" not in file.parts)
    files |= {str(file.relative_to(REPOSITORY)) for file in package if file.is_file()}
    assert {"mpgrasp/py.typed", "mpgrasp/__init__.pyi"} <= files <= names
    assert not any("__pycache__" in name or name.startswith("tests/") for name in names)
    # the unpacked wheel finds its own data, far from the checkout
    listed = subprocess.run(
        [
            sys.executable,
            "-c",
            "from mpgrasp.suite import suite_names as s; from mpgrasp.paths import *;"
            "print(DATA_ROOT, *s(), sep='|')",
        ],
        cwd=tmp_path / "site",
        check=True,
        capture_output=True,
        text=True,
    ).stdout.strip()
    root, *suites = listed.split("|")
    assert Path(root) == tmp_path / "site" / "mpgrasp" / "_data"
    assert {"thin", "unseen"} <= set(suites)


def test_the_cache_is_where_the_environment_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    for name in ("MPGRASP_CACHE", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    assert paths.cache_folder() == tmp_path / "home" / ".cache" / "mpgrasp"
    monkeypatch.setenv("XDG_CACHE_HOME", "relative/paths/do/not/count")
    assert paths.cache_folder() == tmp_path / "home" / ".cache" / "mpgrasp"
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "shared"))
    assert paths.cache_folder() == tmp_path / "shared" / "mpgrasp"
    monkeypatch.setenv("MPGRASP_CACHE", str(tmp_path / "own"))
    assert paths.cache_folder() == tmp_path / "own"
    monkeypatch.setenv("MPGRASP_CACHE", "~/own")
    assert paths.cache_folder() == tmp_path / "home" / "own"
    assert not list(tmp_path.iterdir())


def test_there_is_no_cache_without_a_home(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("MPGRASP_CACHE", "XDG_CACHE_HOME", "HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("os.path.expanduser", lambda path: path)  # as where nobody knows who this is
    assert paths.cache_folder() is None
