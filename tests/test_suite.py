from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any

import pytest

from mpgrasp.episode.config import ClearingConfig, EpisodeConfig
from mpgrasp.exceptions import ConfigError
from mpgrasp.scene.objects.catalogue import load_object
from mpgrasp.suite import TRIALS, Suite, episode_seed, load_suite, parse_suite, suite_names

MINIMAL = {"title": "t", "scene": {"objects": ["usb_stick"]}}


@pytest.mark.parametrize("name", suite_names())
def test_every_shipped_suite_loads_and_names_objects_that_exist(name: str) -> None:
    suite = load_suite(name)
    assert suite.name == name
    for scene in suite.scenes:
        for item in scene.objects:
            assert not isinstance(item, str) or load_object(item).name


def test_thin_is_a_camouflaged_usb_stick_on_cloth_uneven_by_six_tenths_of_a_millimetre() -> None:
    suite = load_suite("thin")
    assert suite.scene.objects == ("usb_stick",)
    assert suite.scene.cloth_unevenness == 0.0006
    assert suite.scene.half_extent == 0.15
    assert suite.scene.camouflage
    assert suite.episode_config().start_jitter == 0.05


def test_unseen_takes_its_four_toys_in_turn() -> None:
    suite = load_suite("unseen")
    names = [suite.scene_config(episode).objects for episode in range(8)]
    assert len(set(names[:4])) == 4
    assert names[4:] == names[:4]


def test_callers_decide_camera_and_noise() -> None:
    config = load_suite("thin").episode_config(camera="ray", noise=False)
    assert (config.camera_backend, config.noise) == ("ray", False)


def test_unknown_suite_lists_the_known_ones() -> None:
    with pytest.raises(ConfigError, match=r"unknown suite.*'thick'.*thin, .*unseen"):
        load_suite("thick")


def test_suite_can_be_a_file_of_ones_own(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text('title = "Mine"\n[scene]\nobjects = ["key"]\n')
    suite = load_suite(str(file))
    assert (suite.name, suite.title, suite.scene.objects) == ("mine", "Mine", ("key",))


def boxed(**changes: Any) -> dict[str, Any]:
    """A scene of one box."""
    return {"scene": {"objects": [{"name": "b", "box": [0.05, 0.02, 0.02], **changes}]}}


@pytest.mark.parametrize(
    ("declared", "message"),
    [
        ({"scene": {}}, "title is missing; allowed: a text"),
        (MINIMAL | {"title": ""}, "no title"),
        (MINIMAL | {"title": 1}, "title is unusable; got 1; allowed: a text"),
        (MINIMAL | {"objects": ["key"]}, "unknown key.*'objects'.*trial, trials, scene, turns, episode"),
        (MINIMAL | {"scene": {"cloth": 1}}, "unknown key.*'cloth'.*cloth_unevenness"),
        (MINIMAL | {"turns": [{"cloth": 1}]}, "unknown key.*'cloth'"),
        (MINIMAL | {"turns": []}, "no scene"),
        (MINIMAL | {"turns": {"objects": ["key"]}}, "turns is unusable; got .*; allowed: a list of tables"),
        (MINIMAL | {"scene": ["key"]}, "scene is unusable; got .*; allowed: a table"),
        (MINIMAL | {"scene": {"cloth_unevenness": -1.0}}, "unevenness"),
        (
            MINIMAL | {"scene": {"cloth_unevenness": "deep"}},
            "suite 's', .scene., cloth_unevenness is unusable",
        ),
        (MINIMAL | {"scene": {"camouflage": "no"}}, "camouflage is unusable; got 'no'; allowed: .*False"),
        (MINIMAL | {"trials": True}, "trials is unusable; got True; allowed: a value such as 10"),
        (MINIMAL | {"trials": 2.5}, "trials is unusable; got 2.5"),
        (MINIMAL | {"trials": 0}, "trials out of range; got 0"),
        (MINIMAL | {"trial": "throw"}, "trial is unusable; got 'throw'; allowed: grasp, clear"),
        (
            MINIMAL | {"scene": {"placing": "heap"}},
            "placing is unusable; got 'heap'; allowed: scatter, pile, stack",
        ),
        (
            MINIMAL | {"scene": {"objects": [{"box": [0.1, 0.1]}]}},
            "objects, box is unusable; got .0.1, 0.1.; allowed: a list of 3, each a number",
        ),
        (MINIMAL | {"scene": {"objects": [{"name": "b"}]}}, "objects, box is missing"),
        (MINIMAL | {"scene": {"objects": []}}, "a scene without objects"),
        (
            MINIMAL | {"scene": {"objects": ["key"] * 10_000}},
            "too many objects; got 10000",
        ),
        (MINIMAL | boxed(name="world"), "reserved name of an object; got 'world'"),
        (MINIMAL | boxed(name="a/b"), "unusable name of an object; got 'a/b'"),
        (MINIMAL | boxed(name="\x1b[31m"), r"unusable name of an object; got '\\\\x1b\[31m'"),
        (MINIMAL | boxed(density=1e-6), "density out of range"),
        (MINIMAL | boxed(box=[1e-9] * 3), "unusable mass"),
        (MINIMAL | boxed(box=[0.05, 0.05, 1e-4]), "too small"),
        (MINIMAL | boxed(box=[0.05, 0.05, -0.02]), "unusable size of a box"),
        (MINIMAL | boxed(box=[0.5, 0.02, 0.02]), "too large"),
        (
            MINIMAL | {"scene": {"objects": [{"edges": []}]}},
            "objects: unknown key; got 'edges'; allowed: box, name, density",
        ),
    ],
)
def test_faulty_declarations_are_refused(declared: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        parse_suite("s", declared)


@pytest.mark.parametrize(
    ("declared", "message"),
    [
        ({"speed": 1}, r"\[episode\]: unknown key; got 'speed'; allowed: control_dt, "),
        (
            {"execution": {"lift_height": 0.1}},
            r"execution: unknown key; got 'lift_height'.*, overtravel, .*lift,",
        ),
        ({"execution": 0.1}, "execution is not a table; got 0.1; allowed: .*overtravel"),
        ({"execution": {"lift": "high"}}, "execution, lift is unusable; got 'high'"),
        ({"execution": {"lift": -0.1}}, "execution: lift must be finite and not negative"),
        ({"start_jitter": {"x": 0.1}}, "start_jitter is unusable; got .*; allowed: a value such as 0.05"),
        (
            {"max_reach_time": math.inf},
            "max_reach_time is not finite; got inf; allowed: a value such as 20.0",
        ),
        ({"start_jitter": math.nan}, "start_jitter is not finite; got nan"),
        (
            {"camera_backend": "ray"},
            "no suite decides camera_backend; got 'ray'; allowed: the option --camera",
        ),
        ({"noise": False}, "no suite decides noise; got False; allowed: the option --no-noise"),
        ({"start_height": True}, "start_height is unusable; got True"),
        ({"camera": {"crop": "all"}}, "camera, crop is unusable; got 'all'"),
    ],
)
def test_episode_settings_that_cannot_be_used_are_refused_before_any_episode(
    declared: dict[str, Any], message: str
) -> None:
    with pytest.raises(ConfigError, match=message) as refused:
        parse_suite("s", MINIMAL | {"episode": declared})
    assert str(refused.value).count("suite 's'") == 1


@pytest.mark.parametrize("trial", TRIALS)
def test_a_table_within_the_episode_changes_what_it_names_and_nothing_else(trial: str) -> None:
    scene = {"objects": ["usb_stick"], "basket": True}
    declared = {"title": "t", "trial": trial, "scene": scene, "episode": {"execution": {"lift": 0.1}}}
    kind = ClearingConfig if trial == "clear" else EpisodeConfig
    expected = dataclasses.replace(kind().execution, lift=0.1)
    assert parse_suite("s", declared).episode_config().execution == expected
    assert expected.hold_time == (0.0 if trial == "clear" else 1.0)


def test_broken_toml_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "broken.toml"
    file.write_text("title = ")
    with pytest.raises(ConfigError, match="not valid TOML"):
        load_suite(str(file))
    with pytest.raises(ConfigError, match="unreadable suite"):
        load_suite(str(tmp_path / "absent.toml"))


def test_suites_are_frozen() -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        parse_suite("s", MINIMAL).name = "other"  # type: ignore[misc]


def test_a_suite_needs_a_scene() -> None:
    with pytest.raises(ConfigError, match="no scene"):
        Suite(name="s", title="t", scenes=())


def test_episode_seeds_differ_between_episodes_seeds_and_suites() -> None:
    seeds = {episode_seed(s, k, e) for s in ("thin", "unseen") for k in range(10) for e in range(100)}
    assert len(seeds) == 2 * 10 * 100


def test_episode_seed_is_the_same_on_every_machine() -> None:
    assert episode_seed("thin", 0, 0) == 1503079607
    assert episode_seed("thin", 0, 1) == 91544227


@pytest.mark.parametrize(("seed", "episode"), [(-1, 0), (0, -1)])
def test_negative_seeds_and_episodes_are_refused(seed: int, episode: int) -> None:
    with pytest.raises(ConfigError):
        episode_seed("thin", seed, episode)
