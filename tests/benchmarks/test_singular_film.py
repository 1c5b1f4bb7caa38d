"""Laws of the film of a singular posture: one clock for both episodes, and files where they are wanted."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import singular_film
from PIL import Image


def plain(grey: int) -> np.ndarray:
    return np.full((8, 6, 3), grey, np.uint8)


def test_both_episodes_are_on_one_clock_and_whoever_has_ended_stays() -> None:
    short = [0.0, 0.5, 1.0], [plain(10), plain(11), plain(12)]
    long = [0.0, 1.0, 2.0, 3.0], [plain(20), plain(21), plain(22), plain(23)]
    pictures = singular_film.side_by_side([short, long], 2)
    assert {picture.shape for picture in pictures} == {(8, 12, 3)}
    seen = [(int(picture[0, 0, 0]), int(picture[0, -1, 0])) for picture in pictures]
    assert seen == [(10, 20), (11, 20), (12, 21), (12, 21), (12, 22), (12, 22), (12, 23)]


def test_a_film_that_is_too_large_is_written_with_fewer_pictures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(0)
    times = np.arange(0, 4, 0.1).tolist()
    noise = [rng.integers(0, 255, (64, 64, 3)).astype(np.uint8) for _ in times]
    films = [(times, noise), (times, noise[::-1])]
    singular_film.write_film(tmp_path / "all.webp", films)
    size = (tmp_path / "all.webp").stat().st_size
    monkeypatch.setattr(singular_film, "MAX_BYTES", size // 2)
    singular_film.write_film(tmp_path / "few.webp", films)
    assert 0 < (tmp_path / "few.webp").stat().st_size <= size // 2


def test_the_published_film_is_small_enough_for_a_page_and_has_its_picture() -> None:
    film = singular_film.OUT.with_suffix(".webp")
    assert film.stat().st_size < 1_500_000
    with Image.open(film) as opened:
        assert getattr(opened, "n_frames", 1) > 50
    assert singular_film.OUT.with_suffix(".png").is_file()


def test_ways_are_drawn_with_the_stick_and_where_the_value_is_smallest() -> None:
    ways = {}
    for name, end in (("mvp", 0.003), ("mppc", 0.15)):
        way = singular_film.Way(stick=np.array([0.5, 0.1]), event="reflex: joint 4")
        way.times = [0.0, 1.0, 2.0]
        way.camera = [np.array([0.5, 0.0]), np.array([0.6, -0.1]), np.array([0.7, -0.2])]
        way.singular_values = [0.2, 0.1, end]
        ways[name] = way
    picture = singular_film.draw(ways)
    titles = [axes.get_title() for axes in picture.axes]
    assert titles[:3] == ["mvp: reflex", "mppc: reflex", "smallest singular value"]


@pytest.mark.parametrize(
    ("command", "message"),
    [
        (["--episode", "-1"], "argument --episode: unusable number"),
        (["--detector", "resnet"], "unknown detector"),
        (["--out", "film.gif"], "a stem with an ending"),
    ],
)
def test_unusable_arguments_of_the_film_are_one_line_and_exit_code_2(
    command: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    where = [] if "--out" in command else ["--out", str(tmp_path / "x" / "film")]
    assert singular_film.main([*command, *where]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert message in error
    assert not (tmp_path / "x").exists()
