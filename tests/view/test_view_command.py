"""`mpgrasp view` plays the benchmark's own episode, as pictures where there is no display."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from mpgrasp.episode.result import EpisodeResult
from mpgrasp.exceptions import ConfigError
from mpgrasp.recording.film_picture import SIZE
from mpgrasp.recording.recorder import NullRecorder
from mpgrasp.view.__main__ import main
from mpgrasp.view.pictures import Pictures
from mpgrasp.view.play import play

QUICK = ["--detector", "heuristic", "--camera", "ray", "--set", "episode.start_height=0.2"]


def test_an_episode_that_is_watched_is_the_benchmark_s(tmp_path: Path) -> None:
    settings = ["episode.start_height=0.2"]
    results = [
        play("thin", "heuristic", "mppc", recorder, seed=2, episode=3, settings=settings, camera="ray")
        for recorder in (NullRecorder(), Pictures(tmp_path, camera="ray"))
    ]
    first, second = results
    assert isinstance(first, EpisodeResult)
    assert first.state_hash == second.state_hash
    other = play(
        "thin", "heuristic", "mppc", NullRecorder(), seed=2, episode=4, settings=settings, camera="ray"
    )
    assert other.state_hash != first.state_hash


def test_without_a_display_there_are_pictures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("mpgrasp.recording.window.has_display", lambda: False)
    assert main(["thin", *QUICK, "--every", "4"]) == 0
    said = capsys.readouterr().out
    files = sorted((tmp_path / "view").iterdir())
    assert f"no display here; Pictures: {len(files)} in view" in said
    assert 2 <= len(files) <= 4
    first, last = (np.asarray(Image.open(file)) for file in (files[0], files[-1]))
    assert first.shape == last.shape == (SIZE[1], SIZE[0], 3)
    assert np.abs(first.astype(float) - last).mean() > 1


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["nonsense"], "unknown suite"),
        (["thin", "--out", "a", "--live"], "not allowed with"),
        (["thin", "--out", "a", "--speed", "2"], "--speed without a window"),
        (["thin", "--out", "a", "--every", "0"], "unusable time between pictures"),
        (["thin", "--out", "a", "--detector", "nobody"], "unknown detector"),
        (["thin", "--out", "a", "--set", "controller.gama=1"], "no setting of mppc"),
    ],
    ids=str,
)
def test_bad_input_is_one_line(
    words: list[str],
    said: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(words) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_a_time_between_pictures_is_refused_in_a_window(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("mpgrasp.recording.window.has_display", lambda: True)
    assert main(["thin", "--every", "2"]) == 2
    assert "--every without pictures" in capsys.readouterr().err


def test_a_time_between_pictures_is_above_zero(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="unusable time"):
        Pictures(tmp_path, every=float("nan"))
