"""Detectors and controllers that are handed over as objects, for as long as a block lasts.

They play under a name of their own, like those of the registry, in the process that made them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

_BROUGHT: dict[str, dict[str, Any]] = {"detector": {}, "controller": {}}


@contextmanager
def brought(detectors: Mapping[str, Any], controllers: Mapping[str, Any]) -> Iterator[None]:
    """Let objects be known by these names inside of the block."""
    for kind, objects in (("detector", detectors), ("controller", controllers)):
        _BROUGHT[kind].update(objects)
    try:
        yield
    finally:
        for kind, objects in (("detector", detectors), ("controller", controllers)):
            for name in objects:
                _BROUGHT[kind].pop(name, None)


def brought_names(kind: str) -> tuple[str, ...]:
    """Return the names of the objects of a kind, "detector" or "controller"."""
    return tuple(_BROUGHT[kind])


def brought_object(kind: str, name: str) -> Any:
    """Return the object of that name; None where there is none."""
    return _BROUGHT[kind].get(name)
