"""Laws of ladders as declared: every rung is a suite, harder by one scalar, and nothing else is accepted."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from mpgrasp.bench.ladders.declaration import ladder_names, load_ladder, parse_ladder
from mpgrasp.exceptions import ConfigError
from mpgrasp.suite import base_name, episode_seed

GOOD: dict[str, Any] = {
    "title": "T", "suite": "thin", "scalar": "latency", "unit": "s", "rungs": [0.1, 0.2, 0.4],
    "harder": "higher", "logarithmic": True, "set": {"camera.latency": "{x}"},
}  # fmt: skip


@pytest.mark.parametrize("name", ladder_names())
def test_a_ladder_has_rungs_of_its_own_over_the_same_worlds(name: str) -> None:
    ladder = load_ladder(name)
    suites = [ladder.at(rung) for rung in ladder.scale.levels]
    assert len({suite.name for suite in suites}) == len(suites) >= 5
    assert {base_name(suite.name) for suite in suites} == {name}
    assert len({episode_seed(suite.name, 0, 3) for suite in suites}) == 1
    configs = [(suite.scenes, repr(suite.episode_config())) for suite in suites]
    assert all(a != b for k, a in enumerate(configs) for b in configs[:k])


def test_six_ladders_and_more_ship() -> None:
    assert {
        "thickness", "cloth", "calibration", "noise", "latency", "search", "clutter", "size", "transfer",
    } <= set(ladder_names())  # fmt: skip


def test_a_rung_has_what_the_ladder_sets_there() -> None:
    ladder = parse_ladder("late", GOOD)
    assert [ladder.at(rung).episode_config().camera.latency for rung in (0.1, 0.4)] == [0.1, 0.4]
    assert ladder.at(0.1, ("sensor.subpixel=0.2",)).episode_config().sensor.subpixel == 0.2
    sticks = load_ladder("thickness")
    (stick,) = sticks.at(1.4).scenes[0].objects
    assert stick.parts[0].size[2] == pytest.approx(0.0007)  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"suite": "thick"}, "unknown suite; got 'thick'"),
        ({"rungs": [0.2, 0.1, 0.4]}, "unusable levels"),
        ({"rungs": [0.1, 0.2]}, "unusable levels"),
        ({"rungs": [0.1, 0.2, 9.0]}, "rung 9: .*latency of the camera"),
        ({"rungs": [float(k) for k in range(1, 60)]}, "too many rungs"),
        ({"rungs": ["a", "b", "c"]}, "rungs"),
        ({"harder": "sideways"}, "unknown direction"),
        ({"set": {"camera.latency": "0.1"}}, "nothing depends on the rung"),
        ({"set": {"camera.latency": 0.1}}, "camera.latency is no text"),
        ({"set": {"camera.lateness": "{x}"}}, "unknown key"),
        ({"step": 2}, "unknown key"),
    ],
)
def test_what_is_no_ladder_is_refused(change: dict[str, Any], said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        parse_ladder("late", {**GOOD, **change})


def test_a_ladder_of_ones_own_is_read_from_its_file(tmp_path: Path) -> None:
    text = (
        'title = "T"\nsuite = "thin"\nscalar = "latency"\nunit = "s"\n'
        'rungs = [0.1, 0.2, 0.4]\nharder = "higher"\n'
        '[set]\n"camera.latency" = "{x}"\n'
    )
    (tmp_path / "mine.toml").write_text(text)
    assert load_ladder(str(tmp_path / "mine.toml")).point(0.2) == "mine[s=0.2]"
    (tmp_path / "bad.toml").write_text("title = ")
    with pytest.raises(ConfigError, match="not valid TOML"):
        load_ladder(str(tmp_path / "bad.toml"))
    with pytest.raises(ConfigError, match="unreadable ladder"):
        load_ladder(str(tmp_path / "missing.toml"))
    with pytest.raises(ConfigError, match="unknown ladder; got 'thickens'; allowed: "):
        load_ladder("thickens")
