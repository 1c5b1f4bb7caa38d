"""Detectors and controllers as a caller gives them: names, objects, lists and tables of these."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from mpgrasp.exceptions import ConfigError

_NAME = re.compile(r"[A-Za-z_][\w.-]*")


@dataclass
class Players:
    """Who plays: names in their order, and the objects among them."""

    kind: str
    """detector or controller."""
    names: list[str] = field(default_factory=list)
    objects: dict[str, Any] = field(default_factory=dict)

    @classmethod
    def of(cls, kind: str, given: Any, registry: Iterable[str]) -> Players:
        """Return the players that are given.

        Args:
            kind: "detector" or "controller".
            given: a name as the command line takes it, an object, a list of such, or a table of objects by
                name.
            registry: names that are taken.

        Raises:
            ConfigError: nothing is given, or a name that cannot be used.
        """
        players, taken = cls(kind=kind), set(registry)
        items: list[tuple[str | None, Any]]
        if isinstance(given, Mapping):
            items = [(str(name), item) for name, item in given.items()]
        elif isinstance(given, list | tuple):
            items = [(None, item) for item in given]
        else:
            items = [(None, given)]
        if not items:
            raise ConfigError(f"no {kind}", got=given, allowed="a name, an object, or several")
        for name, item in items:
            if isinstance(item, str) and name is None:
                players.names.append(item)
            else:
                players._add(name, item, taken)
        return players

    def _add(self, name: str | None, item: Any, taken: set[str]) -> None:
        if isinstance(item, str | type):
            what = "a name" if isinstance(item, str) else "a class"
            raise ConfigError(
                f"{self.kind} {name or item!r} is {what}", got=item, allowed="an object, such as MyDetector()"
            )
        if name is None:
            own = getattr(item, "name", None)
            name = own if isinstance(own, str) and _NAME.fullmatch(own) else type(item).__name__
            plain, number = name, 2
            while name in taken | set(self.names):
                name, number = f"{plain}-{number}", number + 1
        elif not _NAME.fullmatch(name) or name in taken:
            raise ConfigError(
                f"unusable name of a {self.kind}", got=name, allowed="letters, digits, - and _, not taken"
            )
        self.names.append(name)
        self.objects[name] = item
