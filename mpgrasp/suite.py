"""Benchmark suites: what is on the table in each episode, as declared in benchmarks/*.toml.

A declaration has a `title`, a `[scene]` table with fields of `SceneConfig` that all episodes share,
optionally `[[turns]]` (episode k takes turn k modulo their number, on top of `[scene]`), optionally
`trial` ("grasp", or "clear" where the table is to be cleared into a basket) and `trials` (episodes that are
played unless a number is given), and optionally an `[episode]` table with fields of `EpisodeConfig` or
`ClearingConfig`, and tables for the other groups of settings (`GROUPS`). Anything else is an error.
benchmarks/README.md explains the format to users.
"""

from __future__ import annotations

import re
import tomllib
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from mpgrasp.command_line import MOST_EPISODES
from mpgrasp.episode.config import ClearingConfig, EpisodeConfig
from mpgrasp.exceptions import AssetError, ConfigError
from mpgrasp.files.regular import read_regular
from mpgrasp.files.settings import from_table, merged, refuse_unknown
from mpgrasp.names import check_name, printable
from mpgrasp.paths import BENCHMARKS

if TYPE_CHECKING:
    from mpgrasp.scene.config import SceneConfig
    from mpgrasp.scene.objects.model import ObjectModel

Trial = Literal["grasp", "clear"]
"""Kind of an episode: one grasp, or a table to be cleared."""
TRIALS: tuple[Trial, ...] = get_args(Trial)
BOX_DENSITY = 1000.0
"""Density of a box that is declared by its size [kg/m3]."""

_EPISODE_CONFIGS: Mapping[Trial, type[EpisodeConfig]] = {"grasp": EpisodeConfig, "clear": ClearingConfig}
EPISODE_GROUPS = ("sensor", "camera", "execution", "motion", "ik", "reflex")
"""Groups of settings that are configs within that of an episode."""
METHOD_GROUPS = ("controller", "detector")
"""Groups of settings that belong to what plays."""
GROUPS = ("scene", "episode", *EPISODE_GROUPS, *METHOD_GROUPS)
"""Groups of settings, each a table of a suite."""
_LARGEST = 1.0  # MB of a declaration
MOST_TURNS = 500
"""Most scenes that a declaration may have."""
_POINT = re.compile(r"(.+?)\[.+=.+\]")
CALLERS = {"camera_backend": "the option --camera", "noise": "the option --no-noise"}
"""Settings of an episode that no suite decides, and what decides them."""


@dataclass(frozen=True, kw_only=True)
class Suite:
    """A named set of episodes."""

    name: str
    title: str
    scenes: tuple[SceneConfig, ...]
    """One per turn; episode k takes scene k modulo their number."""
    trial: Trial = "grasp"
    """One of `TRIALS`."""
    trials: int = 10
    """Episodes of each combination that are played unless a number is given."""
    episode: Mapping[str, Any] = field(default_factory=dict)
    """Fields of `EpisodeConfig`, or of `ClearingConfig`, in which this suite departs from the defaults."""
    controller: Mapping[str, Any] = field(default_factory=dict)
    """Settings for the controllers that play."""
    detector: Mapping[str, Any] = field(default_factory=dict)
    """Settings for the detectors that play."""

    def __post_init__(self) -> None:
        where = f"suite {self.name!r}"
        if not self.scenes:
            raise ConfigError(f"{where} has no scene", allowed="one scene or more")
        if self.trial not in TRIALS:
            raise ConfigError(f"{where}: unknown trial", got=self.trial, allowed=TRIALS)
        if not 1 <= self.trials <= MOST_EPISODES:
            allowed = f"1 to {MOST_EPISODES}"
            raise ConfigError(f"{where}: trials out of range", got=self.trials, allowed=allowed)
        if self.trial == "clear" and not all(scene.basket for scene in self.scenes):
            raise ConfigError(f"{where}: clearing needs a basket", got="basket = false", allowed="true")
        self._check_episode(self.episode, f"{where}, [episode]")

    def _check_episode(
        self, table: Mapping[str, Any], where: str, defaults: EpisodeConfig | None = None
    ) -> None:
        for key, whose in CALLERS.items():
            if key in table:
                raise ConfigError(f"{where}: no suite decides {key}", got=table[key], allowed=whose)
        refuse_unknown(table, self.episode_keys, where)
        from_table(_EPISODE_CONFIGS[self.trial], table, where, defaults)

    @property
    def episode_keys(self) -> tuple[str, ...]:
        """Names of the settings that its episodes have, without those that the caller decides."""
        return tuple(f.name for f in fields(_EPISODE_CONFIGS[self.trial]) if f.name not in CALLERS)

    def with_settings(self, tables: Mapping[str, Mapping[str, Any]], where: str) -> Suite:
        """Return the suite with settings changed, every scene alike.

        Args:
            tables: settings by group, one of `GROUPS`; those of detectors and controllers are checked where
                it is known who plays.
            where: place of a group, for error messages, with `{}` for its name.

        Raises:
            ConfigError: a setting that is unknown, or a value that cannot be used.
        """
        from mpgrasp.scene.config import SceneConfig

        scenes = self.scenes
        if tables.get("scene"):
            place = where.format("scene")
            table = _with_objects(tables["scene"], place)
            scenes = tuple(from_table(SceneConfig, table, place, scene) for scene in scenes)
        config, episode = self.episode_config(), merged(self.episode, tables.get("episode", {}))
        for group in (group for group in EPISODE_GROUPS if tables.get(group)):
            before = getattr(config, group)
            from_table(type(before), tables[group], where.format(group), before)
            episode = merged(episode, {group: tables[group]})
        if tables.get("episode"):
            self._check_episode(tables["episode"], where.format("episode"), config)
        return replace(
            self,
            scenes=scenes,
            episode=episode,
            controller=merged(self.controller, tables.get("controller", {})),
            detector=merged(self.detector, tables.get("detector", {})),
        )

    @property
    def scene(self) -> SceneConfig:
        """The scene of episode 0."""
        return self.scene_config(0)

    def scene_config(self, episode: int) -> SceneConfig:
        """Return what is on the table in an episode, counted from 0."""
        return self.scenes[episode % len(self.scenes)]

    def episode_config(self, *, camera: str = "auto", noise: bool = True) -> EpisodeConfig:
        """Return how an episode runs: the suite's settings with the caller's camera backend and noise switch.

        Raises:
            ConfigError: an unknown camera backend.
        """
        settings = {**self.episode, "camera_backend": camera, "noise": noise}
        return from_table(_EPISODE_CONFIGS[self.trial], settings, f"suite {self.name!r}, [episode]")


def suite_names() -> tuple[str, ...]:
    """Return the names of the suites that ship with mpgrasp, in alphabetical order."""
    return tuple(sorted(path.stem for path in BENCHMARKS.glob("*.toml")))


def load_suite(name: str) -> Suite:
    """Return the suite of a name in benchmarks/, or of a path to a declaration that ends in `.toml`.

    Raises:
        ConfigError: no such suite, or a declaration that cannot be used.
    """
    if name.endswith(".toml"):
        path = Path(name)
    elif name in suite_names():
        path = BENCHMARKS / f"{name}.toml"
    else:
        raise ConfigError("unknown suite", got=name, allowed=[*suite_names(), "a path that ends in .toml"])
    try:
        declared = tomllib.loads(read_regular(path, _LARGEST).decode("utf-8"))
    except OSError as error:
        raise ConfigError(
            "unreadable suite", got=name, allowed=f"a readable file ({error.strerror})"
        ) from error
    except ValueError as error:  # TOMLDecodeError, UnicodeDecodeError
        raise ConfigError("suite is not valid TOML", got=name, allowed=f"TOML 1.0 ({error})") from error
    try:
        check_name(path.stem)
    except AssetError as error:
        raise ConfigError("unusable name of a suite", got=printable(name), allowed=str(error)) from None
    return parse_suite(path.stem, declared)


def parse_suite(name: str, declared: Mapping[str, Any]) -> Suite:
    """Return the suite that a declaration, already read from TOML, describes.

    Raises:
        ConfigError: a key that is unknown, or a value that cannot be used.
    """
    from mpgrasp.scene.config import SceneConfig

    where = f"suite {name!r}"
    found = from_table(_Declaration, declared, where)
    if not found.title:
        raise ConfigError(f"{where} has no title", got=found.title, allowed='title = "..."')
    if len(found.turns) > MOST_TURNS:
        raise ConfigError(f"{where} has too many turns", got=len(found.turns), allowed=f"up to {MOST_TURNS}")
    scenes = tuple(
        from_table(
            SceneConfig, _with_objects({**found.scene, **turn}, f"{where}, [scene]"), f"{where}, [scene]"
        )
        for turn in found.turns
    )
    suite = Suite(
        name=name,
        title=found.title,
        scenes=scenes,
        trial=found.trial,
        trials=found.trials,
        episode=found.episode,
    )
    tables = {group: getattr(found, group) for group in (*EPISODE_GROUPS, *METHOD_GROUPS)}
    return suite.with_settings(tables, f"{where}, [{{}}]")


@dataclass(frozen=True, kw_only=True)
class _Declaration:
    """A suite's TOML file, before its tables are read."""

    title: str
    trial: Trial = "grasp"
    trials: int = 10
    scene: dict[str, Any] = field(default_factory=dict)
    turns: tuple[dict[str, Any], ...] = ({},)
    episode: dict[str, Any] = field(default_factory=dict)
    sensor: dict[str, Any] = field(default_factory=dict)
    camera: dict[str, Any] = field(default_factory=dict)
    execution: dict[str, Any] = field(default_factory=dict)
    motion: dict[str, Any] = field(default_factory=dict)
    ik: dict[str, Any] = field(default_factory=dict)
    reflex: dict[str, Any] = field(default_factory=dict)
    controller: dict[str, Any] = field(default_factory=dict)
    detector: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class _Box:
    """A box among a scene's objects, such as a stick of a certain thickness."""

    box: tuple[float, float, float]
    """Its edges [m]."""
    name: str = "box"
    density: float = BOX_DENSITY
    """[kg/m3]"""

    def as_object(self) -> ObjectModel:
        """Return the box as an object that a scene can hold."""
        from mpgrasp.scene.objects.model import ObjectModel, Part, check_density

        check_density(self.density)
        x, y, z = self.box
        try:
            part = Part(shape="box", size=(x / 2, y / 2, z / 2))
            mass = self.density * part.volume
            return ObjectModel(name=self.name, parts=(part,), mass=mass, provenance="its suite")
        except AssetError as error:
            raise ConfigError(error) from None


def _with_objects(scene: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Return the table of a scene with `{ box = [x, y, z] }` among its objects made into boxes."""
    objects = scene.get("objects")
    if not isinstance(objects, list):
        return dict(scene)
    made = [
        from_table(_Box, o, f"{where}, objects").as_object() if isinstance(o, dict) else o for o in objects
    ]
    return {**scene, "objects": made}


def point_name(suite: str, label: str) -> str:
    """Return the name of a suite at a point of a sweep: "thin[gamma=8]" for "thin" and "gamma=8"."""
    return f"{suite}[{label}]"


def base_name(suite: str) -> str:
    """Return the name of a suite without the point of a sweep: "thin" for "thin[gamma=8]" and for "thin"."""
    point = _POINT.fullmatch(suite)
    return point[1] if point else suite


def episode_seed(suite: str, seed: int, episode: int) -> int:
    """Return the seed of one episode.

    It depends on the suite's name, the run's seed and the episode alone; the points of a sweep have the
    worlds of their suite. Scene, sensor noise and start pose
    follow from it, so that every detector and every controller meets the same worlds, and two suites never
    share one. It is 32 bits, the first word of numpy's SeedSequence over (crc32 of the suite's name, seed,
    episode).
    """
    if seed < 0 or episode < 0:
        raise ConfigError("negative seed or episode", got=(seed, episode), allowed="0, 1, 2, ...")
    entropy = [zlib.crc32(base_name(suite).encode()), seed, episode]
    return int(np.random.SeedSequence(entropy).generate_state(1)[0])
