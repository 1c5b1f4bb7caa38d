"""Ladders as declared in benchmarks/ladders/*.toml: one scalar, its rungs, and a suite in which it is set.

A declaration has a `title`, the `suite` that all rungs share, the `scalar` in words with its `unit`, the
`rungs` in rising order, which of them are `harder` ("higher" or "lower"), whether the scale is `logarithmic`,
and a table `[set]` of assignments as `--set` takes them, in which `{x}` stands for the rung. Anything else is
an error.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from mpgrasp.exceptions import ConfigError
from mpgrasp.files.regular import read_regular
from mpgrasp.files.settings import from_table
from mpgrasp.names import check_name
from mpgrasp.paths import BENCHMARKS
from mpgrasp.settings.changes import with_assignments
from mpgrasp.suite import Suite, load_suite, point_name
from mpgrasp.thresholds import Scale

_LARGEST = 1.0  # MB of a declaration
MOST_RUNGS = 40
"""Most rungs that a declaration may have."""


@dataclass(frozen=True, kw_only=True)
class Ladder:
    """One suite made harder by one scalar."""

    name: str
    title: str
    suite: str
    """Suite that all rungs share."""
    scalar: str
    """What is varied, in words."""
    unit: str
    scale: Scale
    """The rungs, and which are hard."""
    assignments: tuple[str, ...]
    """Settings as `--set` takes them, with `{x}` for the rung."""

    def point(self, rung: float) -> str:
        """Return the name of the suite that is played at a rung."""
        return point_name(self.name, f"{self.unit or 'x'}={rung:g}")

    def at(self, rung: float, more: tuple[str, ...] = (), *, noise: bool = True) -> Suite:
        """Return the suite of a rung, with further settings.

        Raises:
            ConfigError: a setting that is unknown, or a value that cannot be used.
        """
        texts = [text.replace("{x}", f"{rung:g}") for text in self.assignments]
        base = load_suite(self.suite)
        try:
            (suite,) = with_assignments((base,), [*texts, *more], noise=noise)
        except ConfigError as error:
            raise ConfigError(f"ladder {self.name!r}, rung {rung:g}: {error}") from error
        return replace(suite, name=self.point(rung))


@dataclass(frozen=True, kw_only=True)
class _Declaration:
    """A ladder's TOML file."""

    title: str
    suite: str
    scalar: str
    unit: str
    rungs: tuple[float, ...]
    harder: str
    logarithmic: bool = False
    set: dict[str, Any] = field(default_factory=dict)


def ladder_names() -> tuple[str, ...]:
    """Return the names of the ladders that ship with mpgrasp, in alphabetical order."""
    return tuple(sorted(path.stem for path in (BENCHMARKS / "ladders").glob("*.toml")))


def load_ladder(name: str) -> Ladder:
    """Return the ladder of a name in benchmarks/ladders/, or of a path to a declaration that ends in `.toml`.

    Raises:
        ConfigError: no such ladder, or a declaration that cannot be used.
    """
    known = ladder_names()
    if name not in known and not name.endswith(".toml"):
        raise ConfigError("unknown ladder", got=name, allowed=[*known, "a path that ends in .toml"])
    path = BENCHMARKS / "ladders" / f"{name}.toml" if name in known else Path(name)
    try:
        declared = tomllib.loads(read_regular(path, _LARGEST).decode("utf-8"))
    except OSError as error:
        said = f"a readable file ({error.strerror})"
        raise ConfigError("unreadable ladder", got=name, allowed=said) from error
    except ValueError as error:  # TOMLDecodeError, UnicodeDecodeError
        raise ConfigError("ladder is not valid TOML", got=name, allowed=f"TOML 1.0 ({error})") from error
    check_name(path.stem)
    return parse_ladder(path.stem, declared)


def parse_ladder(name: str, declared: dict[str, Any]) -> Ladder:
    """Return the ladder that a declaration, already read from TOML, describes.

    Raises:
        ConfigError: a key that is unknown, or a value that cannot be used, at whichever rung.
    """
    where = f"ladder {name!r}"
    found = from_table(_Declaration, declared, where)
    if len(found.rungs) > MOST_RUNGS:
        raise ConfigError(f"{where} has too many rungs", got=len(found.rungs), allowed=f"up to {MOST_RUNGS}")
    for key, text in found.set.items():
        if not isinstance(text, str):
            raise ConfigError(f"{where}, [set]: {key} is no text", got=text, allowed='such as "{x} / 1000"')
    assignments = tuple(f"{key}={text}" for key, text in found.set.items())
    if not any("{x}" in text for text in assignments):
        raise ConfigError(f"{where}: nothing depends on the rung", allowed="{x} in [set]")
    try:
        scale = Scale(levels=found.rungs, logarithmic=found.logarithmic, harder=found.harder)
    except ConfigError as error:
        raise ConfigError(f"{where}: {error}") from error
    ladder = Ladder(
        name=name,
        title=found.title,
        suite=found.suite,
        scalar=found.scalar,
        unit=found.unit,
        scale=scale,
        assignments=assignments,
    )
    for rung in scale.levels:
        ladder.at(rung)
    return ladder
