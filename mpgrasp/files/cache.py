"""Results that are slow to make, kept as JSON files under the hash of all that decides them."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import TypeVar

import msgspec

from mpgrasp import paths
from mpgrasp.files.atomic import replace_file

Result = TypeVar("Result", bound=msgspec.Struct)


def load_result(kind: str, key: str, shape: type[Result]) -> Result | None:
    """Return what was stored; None where nothing was, or what is there is damaged or of another shape.

    Args:
        kind: folder in the cache folder.
        key: hash of all that decides the result.
        shape: record that the result is read into.
    """
    file = _file(kind, key)
    if file is None:
        return None
    try:
        return msgspec.json.decode(file.read_bytes(), type=shape)
    except (OSError, msgspec.MsgspecError, ValueError):
        return None


def store_result(kind: str, key: str, result: msgspec.Struct) -> None:
    """Keep a result; floats come back as they were. Where nothing can be written it is made again."""
    file = _file(kind, key)
    if file is None:
        return
    with suppress(OSError):
        file.parent.mkdir(parents=True, exist_ok=True)
        replace_file(file, msgspec.json.encode(result))


def _file(kind: str, key: str) -> Path | None:
    folder = paths.cache_folder()
    return None if folder is None else folder / kind / f"{key}.json"
