"""Writes a file as a whole: whatever happens, its name leads to the old content or to the new one."""

from __future__ import annotations

import os
import secrets
from contextlib import suppress
from pathlib import Path


def replace_file(file: Path, content: str | bytes) -> None:
    """Write a file, or put new content in the place of what is there; it is on the disk on return.

    Several processes may write the same file at a time: the last one's content stays, and no reader ever
    sees half of one.

    Args:
        file: in a folder that exists.
        content: all of it; text is written as UTF-8.

    Raises:
        OSError: it cannot be written. What was there before is still there, and nothing else is.
    """
    data = content.encode() if isinstance(content, str) else content
    temporary = file.with_name(f".{file.name}.{secrets.token_hex(4)}.tmp")
    try:
        with temporary.open("xb") as stream:
            stream.write(data)
            stream.flush()
            os.fsync(stream.fileno())
        os.replace(temporary, file)
    except BaseException:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)
        raise
