"""Grids of settings: `--set` with several values, of which a sweep plays every combination."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from math import prod
from typing import Any

from mpgrasp.exceptions import ConfigError
from mpgrasp.files.json_values import json_value
from mpgrasp.settings.assignment import parse_value, split_assignment
from mpgrasp.suite import EPISODE_GROUPS

LIMIT = 1024
"""Largest number of points in a grid: ten settings with two values each."""

_FORM = "--set GROUP.KEY=A,B at least once, such as --set controller.gamma=0,4/3,8"
_OPENING, _CLOSING, _QUOTES = "([{", ")]}", "\"'"


@dataclass(frozen=True, kw_only=True)
class Axis:
    """A setting with its values in a grid."""

    setting: str
    """Its group and its keys, with dots between them."""
    name: str
    """The last of these keys, as many as tell it from the other axes."""
    texts: tuple[str, ...]
    """Its values as they were written."""
    values: tuple[Any, ...]


@dataclass(frozen=True, kw_only=True)
class GridPoint:
    """One combination of values."""

    texts: tuple[str, ...]
    """One value of each axis, as it was written."""
    label: str
    """Names and values, such as "gamma=4/3,alpha=1"."""
    assignments: tuple[str, ...]
    """All that `--set` takes to play it, settings with one value included."""


@dataclass(frozen=True, kw_only=True)
class Grid:
    """The values of several settings, every one with every other."""

    axes: tuple[Axis, ...]
    fixed: tuple[str, ...]
    """Assignments of settings with one value."""

    def points(self) -> Iterator[GridPoint]:
        """Return every point, the last axis changing first."""
        for texts in product(*(axis.texts for axis in self.axes)):
            values = list(zip(self.axes, texts, strict=True))
            changes = (f"{axis.setting}={text}" for axis, text in values)
            yield GridPoint(
                texts=texts,
                label=",".join(f"{axis.name}={text}" for axis, text in values),
                assignments=(*self.fixed, *changes),
            )


def parse_grid(texts: Sequence[str]) -> Grid:
    """Return the grid of assignments whose values may be several, with commas between them.

    Raises:
        ConfigError: a text that is no assignment, a setting or a value that is given twice, an empty value,
            no setting with several values, or more than `LIMIT` points.
    """
    found: dict[str, tuple[str, ...]] = {}
    for text in texts:
        setting, value = canonical_assignment(text)
        items = tuple(split_values(value))
        if setting in found:
            raise ConfigError(f"--set {setting} is given twice", got=text, allowed="all values in one --set")
        if not all(items):
            raise ConfigError(f"--set {setting} has an empty value", got=value, allowed=_FORM)
        found[setting] = items
    for setting in found:
        whole = next((other for other in found if setting.startswith(f"{other}.")), None)
        if whole is not None:
            key = whole.rpartition(".")[2]
            raise ConfigError(f"--set {setting}: {key} has a value already", got=list(texts), allowed=_FORM)
    several = [setting for setting, items in found.items() if len(items) > 1]
    if not several:
        raise ConfigError("a sweep has no setting with several values", got=list(texts), allowed=_FORM)
    names = {setting: _short(setting, several) for setting in several}
    axes = tuple(_axis(setting, names[setting], found[setting]) for setting in several)
    size = prod(len(axis.texts) for axis in axes)
    if size > LIMIT:
        raise ConfigError("too many points in the grid of a sweep", got=size, allowed=f"up to {LIMIT}")
    fixed = tuple(f"{setting}={items[0]}" for setting, items in found.items() if len(items) == 1)
    return Grid(axes=axes, fixed=fixed)


def canonical_assignment(text: str) -> tuple[str, str]:
    """Return the setting and the value of an assignment, with one name for each setting.

    `episode.execution.lift` means `execution.lift`, as in a suite.

    Raises:
        ConfigError: a text that is no assignment.
    """
    setting, value = split_assignment(text)
    inner = setting.removeprefix("episode.")
    return inner if inner.partition(".")[0] in EPISODE_GROUPS and "." in inner else setting, value


def split_values(text: str) -> Iterator[str]:
    """Return what stands between the commas of a text; those in brackets or quotes do not count."""
    depth, quote, start = 0, "", 0
    for place, letter in enumerate(text):
        if quote:
            quote = "" if letter == quote else quote
        elif letter in _QUOTES:
            quote = letter
        elif letter in _OPENING:
            depth += 1
        elif letter in _CLOSING:
            depth -= 1
        elif letter == "," and depth == 0:
            yield text[start:place].strip()
            start = place + 1
    yield text[start:].strip()


def _axis(setting: str, name: str, texts: tuple[str, ...]) -> Axis:
    values: list[Any] = []
    for text in texts:
        value = parse_value(text, f"--set {setting}")
        # as in run.json: 0.2/0.15 and 4/3 are one value; true is no number
        if any(_is_same(value, known) for known in values):
            raise ConfigError(f"--set {setting} has a value twice", got=text, allowed="different values")
        values.append(value)
    return Axis(setting=setting, name=name, texts=texts, values=tuple(values))


def _is_same(a: Any, b: Any) -> bool:
    """True for values between which run.json makes no difference."""
    return isinstance(a, bool) is isinstance(b, bool) and bool(json_value(a) == json_value(b))


def _short(setting: str, others: Sequence[str]) -> str:
    """Return the last keys of a setting, as few as tell it from the others."""
    keys = setting.split(".")
    endings = (".".join(keys[-count:]) for count in range(1, len(keys)))
    alone = (name for name in endings if sum(f".{other}".endswith(f".{name}") for other in others) == 1)
    return next(alone, setting)
