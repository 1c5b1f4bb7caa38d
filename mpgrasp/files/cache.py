"""Results that are slow to make, kept as JSON files under the hash of all that decides them."""

from __future__ import annotations

import json
from contextlib import suppress
from pathlib import Path
from typing import Any

from mpgrasp import paths
from mpgrasp.files.atomic import replace_file


def load_result(kind: str, key: str) -> dict[str, Any] | None:
    """Return what was stored; None where nothing was, or what is there cannot be read.

    Args:
        kind: folder in the cache folder.
        key: hash of all that decides the result.
    """
    file = _file(kind, key)
    if file is None:
        return None
    try:
        result = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return result if isinstance(result, dict) else None


def store_result(kind: str, key: str, result: dict[str, Any]) -> None:
    """Keep a result; floats come back as they were. Where nothing can be written it is made again."""
    file = _file(kind, key)
    if file is None:
        return
    with suppress(OSError):
        file.parent.mkdir(parents=True, exist_ok=True)
        replace_file(file, json.dumps(result))


def _file(kind: str, key: str) -> Path | None:
    folder = paths.cache_folder()
    return None if folder is None else folder / kind / f"{key}.json"
