"""Benchmark suites: what is on the table in each episode, as declared in benchmarks/*.toml.

A declaration has a `title`, a `[scene]` table with fields of `SceneConfig` that all episodes share,
optionally `[[turns]]` (episode k takes turn k modulo their number, on top of `[scene]`), optionally
`trial` ("grasp", or "clear" where the table is to be cleared into a basket) and `trials` (episodes that are
played unless a number is given), and optionally an `[episode]` table with fields of `EpisodeConfig` or
`ClearingConfig`. Anything else is an error. benchmarks/README.md explains the format to users.
"""

from __future__ import annotations

import dataclasses
import tomllib
import zlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mpgrasp.exceptions import ConfigError
from mpgrasp.paths import BENCHMARKS

if TYPE_CHECKING:
    from mpgrasp.episode.config import EpisodeConfig
    from mpgrasp.scene.config import SceneConfig

_KEYS = ("title", "trial", "trials", "scene", "turns", "episode")
TRIALS = ("grasp", "clear")
"""What an episode can be: one grasp, or a table to be cleared."""
BOX_DENSITY = 1000.0
"""Of a box that is declared by its size [kg/m3]."""
_ACCEPTED: Mapping[str, tuple[type, ...]] = {
    "bool": (bool,), "int": (int,), "float": (int, float), "str": (str,)
}  # fmt: skip
"""Types of value that a setting takes, by its annotation; configs check the others themselves."""


@dataclass(frozen=True, kw_only=True)
class Suite:
    """A named set of episodes."""

    name: str
    title: str
    scenes: tuple[SceneConfig, ...]
    """One per turn; episode k takes scene k modulo their number."""
    trial: str = "grasp"
    """One of `TRIALS`."""
    trials: int = 10
    """Episodes of each combination that are played unless a number is given."""
    episode: Mapping[str, Any] = field(default_factory=dict)
    """Fields of `EpisodeConfig`, or of `ClearingConfig`, in which this suite departs from the defaults."""

    def __post_init__(self) -> None:
        where = f"suite {self.name!r}"
        if not self.scenes:
            raise ConfigError(f"{where} has no scene", allowed="one scene or more")
        if self.trial not in TRIALS:
            raise ConfigError(f"{where}: unknown trial", got=self.trial, allowed=TRIALS)
        if type(self.trials) is not int or self.trials < 1:  # true is an int to isinstance
            raise ConfigError(f"{where}: trials out of range", got=self.trials, allowed="1 or more")
        if self.trial == "clear" and not all(scene.basket for scene in self.scenes):
            raise ConfigError(f"{where}: clearing needs a basket", got="basket = false", allowed="true")

    @property
    def scene(self) -> SceneConfig:
        """The scene of episode 0."""
        return self.scene_config(0)

    def scene_config(self, episode: int) -> SceneConfig:
        """What is on the table in an episode, counted from 0."""
        return self.scenes[episode % len(self.scenes)]

    def episode_config(self, *, camera: str = "auto", noise: bool = True) -> EpisodeConfig:
        """How an episode runs: the suite's settings with the caller's camera backend and noise switch.

        Raises:
            ConfigError: a setting that the trial's config does not have, or refuses.
        """
        from mpgrasp.episode.config import ClearingConfig, EpisodeConfig

        kind = ClearingConfig if self.trial == "clear" else EpisodeConfig
        settings = {**self.episode, "camera_backend": camera, "noise": noise}
        config: EpisodeConfig = _construct(kind, settings, f"suite {self.name!r}, [episode]")
        return config


def suite_names() -> tuple[str, ...]:
    """Names of the suites that ship with mpgrasp, in alphabetical order."""
    return tuple(sorted(path.stem for path in BENCHMARKS.glob("*.toml")))


def load_suite(name: str) -> Suite:
    """The suite of a name in benchmarks/, or of a path to a declaration that ends in `.toml`.

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
        declared = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(
            "unreadable suite", got=name, allowed=f"a readable file ({error.strerror})"
        ) from error
    except ValueError as error:  # TOMLDecodeError, UnicodeDecodeError
        raise ConfigError("suite is not valid TOML", got=name, allowed=f"TOML 1.0 ({error})") from error
    return parse_suite(path.stem, declared)


def parse_suite(name: str, declared: Mapping[str, Any]) -> Suite:
    """The suite that a declaration, already read from TOML, describes.

    Raises:
        ConfigError: a key that is unknown, or a value that cannot be used.
    """
    from mpgrasp.scene.config import SceneConfig

    where = f"suite {name!r}"
    _refuse_unknown(declared, _KEYS, where)
    title = declared.get("title")
    if not isinstance(title, str) or not title:
        raise ConfigError(f"{where} has no title", got=title, allowed='title = "..."')
    shared, turns = declared.get("scene", {}), declared.get("turns", [{}])
    episode = declared.get("episode", {})
    for key, table in (("scene", shared), ("episode", episode)):
        if not isinstance(table, dict):
            raise ConfigError(f"{where}, {key} is not a table", got=table, allowed=f"[{key}]")
    if not isinstance(turns, list) or not all(isinstance(turn, dict) for turn in turns):
        raise ConfigError(f"{where}, turns is not a list of tables", got=turns, allowed="[[turns]]")
    scenes = tuple(
        _construct(SceneConfig, _with_objects({**shared, **turn}, where), f"{where}, [scene]")
        for turn in turns
    )
    settings = {key: declared[key] for key in ("trial", "trials") if key in declared}
    return Suite(name=name, title=title, scenes=scenes, episode=_as_tuples(episode), **settings)


def episode_seed(suite: str, seed: int, episode: int) -> int:
    """Seed of one episode: 32 bits that depend on the suite's name, the run's seed and the episode alone.

    Scene, sensor noise and start pose follow from it, so that every detector and every controller
    meets the same worlds, and two suites never share one. It is the first word of numpy's
    SeedSequence over (crc32 of the suite's name, seed, episode).
    """
    if seed < 0 or episode < 0:
        raise ConfigError("negative seed or episode", got=(seed, episode), allowed="0, 1, 2, ...")
    entropy = [zlib.crc32(suite.encode()), seed, episode]
    return int(np.random.SeedSequence(entropy).generate_state(1)[0])


def _construct(kind: Any, settings: Mapping[str, Any], where: str) -> Any:
    """An instance of a config dataclass from declared settings, with errors that name the place."""
    fields = {f.name: f for f in dataclasses.fields(kind)}
    _refuse_unknown(settings, fields, where)
    values = {key: _value(fields[key], value, f"{where}, {key}") for key, value in settings.items()}
    try:
        return kind(**values)
    except (TypeError, ValueError) as error:
        raise ConfigError(f"{where}: {error}") from error


def _value(declared: dataclasses.Field[Any], value: Any, where: str) -> Any:
    """What a setting is declared to be; of a config within the config, only what departs from its default."""
    make = declared.default_factory
    default: Any = declared.default if make is dataclasses.MISSING else make()
    nested = dataclasses.is_dataclass(default) and not isinstance(default, type)
    if isinstance(value, Mapping) is not nested:
        allowed = [f.name for f in dataclasses.fields(default)] if nested else f"a value such as {default!r}"
        raise ConfigError(f"{where} is {'not ' if nested else ''}a table", got=value, allowed=allowed)
    accepted = _ACCEPTED.get(str(declared.type).removesuffix(" | None"))
    if accepted and value is not None and type(value) not in accepted:  # true is an int to isinstance
        raise ConfigError(f"{where} is unusable", got=value, allowed=f"a value such as {default!r}")
    if not nested:
        return _as_tuples(value)
    rest = {f.name: getattr(default, f.name) for f in dataclasses.fields(default)}
    return _construct(type(default), {**rest, **value}, where)


def _with_objects(scene: Mapping[str, Any], where: str) -> dict[str, Any]:
    """The table of a scene with `{ box = [x, y, z] }` among its objects made into boxes."""
    objects = scene.get("objects")
    if not isinstance(objects, list):
        return dict(scene)
    return {**scene, "objects": [_box(o, where) if isinstance(o, dict) else o for o in objects]}


def _box(declared: Mapping[str, Any], where: str) -> Any:
    """A box of some size, such as a stick of a certain thickness."""
    from mpgrasp.scene.objects.model import ObjectModel, Part

    _refuse_unknown(declared, ("box", "name", "density"), f"{where}, objects")
    edges, density = declared.get("box"), declared.get("density", BOX_DENSITY)
    try:
        part = Part(shape="box", size=tuple(edge / 2 for edge in edges or ()))
        name = declared.get("name", "box")
        return ObjectModel(name=name, parts=(part,), mass=density * part.volume, provenance="its suite")
    except TypeError as error:
        raise ConfigError(f"{where}: unusable box", got=dict(declared), allowed="edges [m]") from error


def _refuse_unknown(table: Mapping[str, Any], allowed: Iterable[str], where: str) -> None:
    allowed = list(allowed)
    for key in table:
        if key not in allowed:
            raise ConfigError(f"{where}: unknown key", got=key, allowed=allowed)


def _as_tuples(value: Any) -> Any:
    """TOML arrays as tuples, which frozen configs can hold."""
    if isinstance(value, dict):
        return {key: _as_tuples(item) for key, item in value.items()}
    return tuple(_as_tuples(item) for item in value) if isinstance(value, list) else value
