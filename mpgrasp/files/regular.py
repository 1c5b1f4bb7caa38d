"""Reading of files that anybody may name: pipes and devices, which may never end, are refused."""

from __future__ import annotations

import errno
import stat
from pathlib import Path

_MEGABYTE = 1_000_000


def read_regular(path: Path, limit: float) -> bytes:
    """Return the content of a file.

    Args:
        path: of the file.
        limit: its greatest size [MB].

    Raises:
        OSError: it cannot be read, is no regular file, or is larger; `strerror` says why.
    """
    require_regular(path, limit)
    return path.read_bytes()


def require_regular(path: Path, limit: float) -> None:
    """Raise OSError, whose `strerror` says why, unless a file can be read whole: see `read_regular`."""
    try:
        found = path.stat()
    except ValueError as error:  # a name with a null byte
        raise OSError(errno.EINVAL, str(error)) from None
    if stat.S_ISDIR(found.st_mode):
        raise OSError(errno.EISDIR, "it is a directory")
    if not stat.S_ISREG(found.st_mode):
        raise OSError(errno.EINVAL, "it is a pipe or a device, no regular file")
    if found.st_size > limit * _MEGABYTE:
        raise OSError(errno.EFBIG, f"{found.st_size / _MEGABYTE:.0f} MB, more than {limit:g} MB")
