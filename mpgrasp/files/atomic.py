"""Files that are written as a whole: whatever happens, a name leads to the old content or to the new one."""

from __future__ import annotations

import os
import secrets
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


def replace_file(file: Path, content: str | bytes | Iterable[str]) -> None:
    """Write a file, or put new content in the place of what is there; it is on the disk on return.

    Args:
        file: in a folder that exists.
        content: all of it, or pieces of it; text is written as UTF-8, parts of file names that have no form
            in it escaped.

    Raises:
        OSError: it cannot be written. What was there before is still there, and nothing else is.
    """
    with replacing(file) as temporary, temporary.open("xb") as stream:
        for piece in (content,) if isinstance(content, str | bytes) else content:
            stream.write(piece if isinstance(piece, bytes) else piece.encode("utf-8", "backslashreplace"))


@contextmanager
def replacing(file: Path) -> Iterator[Path]:
    """Give a name beside a file to write to; what is there takes the file's place if the block ends well.

    Several processes may write the same file at a time: the last one's content stays, and no reader ever
    sees half of one.

    Args:
        file: in a folder that exists. The name given out has its suffix.

    Raises:
        OSError: it cannot be put on the disk. What was there before is still there, and nothing else is.
    """
    temporary = file.with_name(f".{secrets.token_hex(4)}.{file.name}")
    try:
        yield temporary
        with temporary.open("rb") as stream:
            os.fsync(stream.fileno())
        os.replace(temporary, file)
    except BaseException:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)
        raise
