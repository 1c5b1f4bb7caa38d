"""Every script of benchmarks/ can be asked for its help, and does nothing else then."""

from __future__ import annotations

import re
import runpy
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SCRIPTS = sorted((ROOT / "benchmarks").glob("*.py"))
COMMANDS = [path for path in SCRIPTS if 'if __name__ == "__main__":' in path.read_text(encoding="utf-8")]


def published() -> dict[Path, tuple[int, int]]:
    """Size and time of the last change of all files that scripts write."""
    folders = (ROOT / "docs", ROOT / "benchmarks", ROOT / "assets" / "weights")
    files = [ROOT / "README.md", *(path for folder in folders for path in folder.rglob("*"))]
    return {
        path: (path.stat().st_size, path.stat().st_mtime_ns)
        for path in files
        if path.is_file() and path.suffix != ".pyc"
    }


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_help_touches_nothing(
    script: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("OMP_NUM_THREADS", "1")  # as the studies would set it, for longer than this test
    monkeypatch.setattr(sys, "argv", [str(script), "--help"])
    before = published()
    if script in COMMANDS:
        with pytest.raises(SystemExit) as end:
            runpy.run_path(str(script), run_name="__main__")
        assert not end.value.code
        assert re.match(rf"usage: {script.name}", capsys.readouterr().out)
    else:  # a part of others
        runpy.run_path(str(script), run_name="__main__")
        assert capsys.readouterr().out == ""
    assert published() == before
    assert not list(tmp_path.iterdir())


def test_the_scripts_that_make_published_files_are_commands() -> None:
    named = {
        "ablation", "across", "controller_factors", "held_out", "picture", "run_time", "same_bits",
        "singular_film", "table", "thickness", "before", "environments", "scaling",
        "generated_splits",
    }  # fmt: skip
    assert named <= {path.stem for path in COMMANDS}


def test_the_picture_goes_where_it_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import picture

    class Made(Exception):
        pass

    def stop(*_: object, **settings: object) -> None:
        raise Made

    monkeypatch.setattr("mpgrasp.make_detector", lambda name: None)
    monkeypatch.setattr("mpgrasp.run_episode", stop)
    before = picture.PICTURE.read_bytes()
    with pytest.raises(Made):
        picture.main(["--out", str(tmp_path / "x" / "episode.png")])
    assert (tmp_path / "x").is_dir()
    assert picture.PICTURE.read_bytes() == before
