"""Laws of films: what they show, how long, and what happens where they cannot be written."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import imageio.v3 as iio
import numpy as np
import pytest
from full_disk import room_for
from PIL import Image
from toy_recordings import play, toy_simulation

from mpgrasp.exceptions import OutputError
from mpgrasp.recording.film import FilmConfig, FilmRecorder
from mpgrasp.recording.film_files import filmstrip, write_animation
from mpgrasp.recording.film_picture import SIZE
from mpgrasp.recording.recorder import TeeRecorder
from mpgrasp.recording.watcher import VIEW


@pytest.fixture
def simulation() -> Any:
    return toy_simulation()


def test_a_film_shows_the_episode_and_ends_with_its_outcome(simulation: Any, tmp_path: Path) -> None:
    film, strip = tmp_path / "film.gif", tmp_path / "strip.png"
    play(FilmRecorder(film, strip=strip, config=FilmConfig(backend="ray")), simulation)
    with Image.open(film) as animation:
        assert animation.size == SIZE
        assert 4 <= animation.n_frames <= 7  # type: ignore[attr-defined]
        durations = []
        for k in range(animation.n_frames):  # type: ignore[attr-defined]
            animation.seek(k)
            durations.append(animation.info["duration"])
        assert durations[-1] == 1500
        assert sum(durations[:-1]) == pytest.approx(600, abs=20)
    with Image.open(strip) as sheet:
        assert sheet.size == (3 * SIZE[0], 2 * SIZE[1])
    assert film.stat().st_size < 3_000_000


def test_a_film_too_large_keeps_fewer_pictures_of_the_same_time(simulation: Any, tmp_path: Path) -> None:
    recorders = [
        FilmRecorder(tmp_path / f"{size}.gif", config=FilmConfig(backend="ray", max_bytes=size))
        for size in (3_000_000, 60_000)
    ]
    play(TeeRecorder(*recorders), simulation, ticks=12)
    lengths = []
    for recorder in recorders:
        with Image.open(recorder.paths[0]) as animation:
            total = 0
            for k in range(animation.n_frames):  # type: ignore[attr-defined]
                animation.seek(k)
                total += animation.info["duration"]
            lengths.append((animation.n_frames, total))  # type: ignore[attr-defined]
    assert lengths[1][0] < lengths[0][0]
    assert lengths[1][1] == pytest.approx(lengths[0][1], abs=200)


def test_a_long_film_is_thinned_out_while_it_is_made(
    simulation: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("mpgrasp.recording.film._MOST", 5)
    recorder = FilmRecorder(tmp_path / "film.gif", config=FilmConfig(backend="ray"))
    start = simulation.time
    play(recorder, simulation, ticks=14)
    assert len(recorder.pictures) == len(recorder.times) <= 6  # and the outcome
    assert recorder.times[0] - start < 0.2
    assert recorder.times[-1] - start > 1.0
    steps = np.diff(recorder.times[:-2])  # the reflex of the last tick is shown at once
    assert steps == pytest.approx(steps[0], abs=0.02)
    assert steps[0] > 0.3


def test_webp_films_are_written_too(simulation: Any, tmp_path: Path) -> None:
    film = tmp_path / "film.webp"
    play(FilmRecorder(film, config=FilmConfig(backend="ray")), simulation)
    with Image.open(film) as animation:
        assert animation.format == "WEBP"


def test_a_film_of_an_episode_without_ticks_still_shows_the_outcome(simulation: Any, tmp_path: Path) -> None:
    film = FilmRecorder(tmp_path / "film.gif", config=FilmConfig(backend="ray"))
    film.start(simulation)
    film.finish("timeout")
    assert film.paths[0].stat().st_size > 0


def test_filmstrip_places_pictures_row_by_row(tmp_path: Path) -> None:
    pictures = [np.full((4, 6, 3), shade_, np.uint8) for shade_ in (0, 80, 160, 240)]
    filmstrip(tmp_path / "s.png", pictures)
    sheet = np.asarray(Image.open(tmp_path / "s.png").convert("RGB"))
    assert sheet.shape == (8, 18, 3)
    assert (sheet[5, 1] == 240).all()


def test_an_mp4_is_the_same_film_and_the_verdict_stands_on_its_last_picture(
    simulation: Any, tmp_path: Path
) -> None:
    gif, mp4 = tmp_path / "film.gif", tmp_path / "film.mp4"
    recorder = FilmRecorder(gif, mp4, config=FilmConfig(backend="ray"))
    play(recorder, simulation, ticks=8)
    about = iio.immeta(mp4, plugin="FFMPEG")
    assert about["codec"] == "h264"
    assert about["pix_fmt"].startswith("yuv420p")
    assert about["size"] == SIZE
    # 0.1 s for every picture, and the outcome stands for 1.5 s more
    assert about["duration"] == pytest.approx(0.1 * (len(recorder.pictures) - 1) + 1.5, abs=0.06)
    frames = iio.imread(mp4, plugin="FFMPEG")
    assert len(frames) == round(about["duration"] * about["fps"])
    last, before = frames[-1].astype(int), frames[-round(1.6 * about["fps"])].astype(int)
    text = np.s_[VIEW[1] :]
    for shown, own, other in ((last, -1, -2), (before, -2, -1)):
        apart = [np.abs(shown - recorder.pictures[k]) for k in (own, other)]
        assert apart[0].mean() < 6
        assert apart[0][text].mean() < apart[1][text].mean()
    assert sorted(tmp_path.iterdir()) == [gif, mp4]


def test_pictures_of_an_mp4_stand_as_long_as_they_should(tmp_path: Path) -> None:
    file = tmp_path / "a.mp4"
    shades = (40, 120, 200)
    pictures = [np.full((64, 64, 3), shade, np.uint8) for shade in shades]
    write_animation(file, pictures, np.array([0.5, 0.3, 1.0]))
    frames = iio.imread(file, plugin="FFMPEG").mean(axis=(1, 2, 3))
    nearest = np.abs(frames[:, None] - shades).argmin(axis=1)
    assert np.bincount(nearest).tolist() == [5, 3, 10]
    assert (np.diff(nearest) >= 0).all()


def test_a_film_that_cannot_be_encoded_is_one_error_and_leaves_what_was_there(
    simulation: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    encoder, film = tmp_path / "ffmpeg", tmp_path / "films" / "film.mp4"
    encoder.write_text(
        '#!/bin/sh\nfor file; do :; done\necho half >"$file"\necho "No space left" >&2\nexit 1\n'
    )
    encoder.chmod(0o755)
    recorder = FilmRecorder(film, config=FilmConfig(backend="ray"))
    monkeypatch.setattr("imageio_ffmpeg.get_ffmpeg_exe", lambda: str(encoder))
    with pytest.raises(
        OutputError, match=r"a film cannot be written: ffmpeg: No space left; got '.*film.mp4'"
    ):
        play(recorder, simulation)
    assert list(film.parent.iterdir()) == []


def test_without_an_encoder_an_mp4_is_refused_before_the_episode(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def missing() -> str:
        raise RuntimeError("No ffmpeg exe could be found.")

    monkeypatch.setattr("imageio_ffmpeg.get_ffmpeg_exe", missing)
    with pytest.raises(OutputError, match="no ffmpeg to write MP4; allowed: pip install"):
        FilmRecorder(tmp_path / "film.mp4")
    FilmRecorder(tmp_path / "film.gif")


def test_a_full_disk_is_one_error_and_leaves_no_half_of_a_film(
    simulation: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError("No space left on device")

    recorder = FilmRecorder(tmp_path / "film.gif", config=FilmConfig(backend="ray"))
    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(
        OutputError, match=r"a film cannot be written: No space left on device; got '.*film.gif'"
    ):
        play(recorder, simulation)
    assert list(tmp_path.iterdir()) == []


def test_a_film_that_finds_no_room_does_not_cost_the_smaller_one(simulation: Any, tmp_path: Path) -> None:
    gif, mp4 = tmp_path / "film.gif", tmp_path / "film.mp4"
    play(FilmRecorder(gif, mp4, config=FilmConfig(backend="ray")), simulation)
    small, large = mp4.stat().st_size, gif.stat().st_size
    assert small < large
    gif.unlink()
    mp4.unlink()
    recorder = FilmRecorder(gif, mp4, config=FilmConfig(backend="ray"))
    with room_for((small + large) // 2), pytest.raises(OutputError, match=r"cannot be written: .*film\.gif"):
        play(recorder, simulation)
    assert [file.name for file in tmp_path.iterdir()] == ["film.mp4"]
    assert len(iio.imread(mp4, plugin="FFMPEG")) > 1


def test_an_encoder_that_dies_without_a_word_is_told_by_its_exit_code(
    simulation: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    encoder = tmp_path / "ffmpeg"
    encoder.write_text("#!/bin/sh\nkill -XFSZ $$\n")
    encoder.chmod(0o755)
    recorder = FilmRecorder(tmp_path / "film.mp4", config=FilmConfig(backend="ray"))
    monkeypatch.setattr("imageio_ffmpeg.get_ffmpeg_exe", lambda: str(encoder))
    with pytest.raises(OutputError, match=r"ffmpeg: ended with exit code -25"):
        play(recorder, simulation)
