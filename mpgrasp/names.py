"""Names that may come from anywhere: what an object may be called, and text that no terminal obeys."""

from __future__ import annotations

import re

from mpgrasp.exceptions import AssetError

MAX_NAME = 64
"""Characters of the longest name."""
RESERVED = ("world", "basket")
"""Names of bodies that every scene may have beside its objects."""


def printable(text: str) -> str:
    r"""Return a text with everything escaped that is no visible character: ESC as \x1b, a line end as \n.

    Terminals obey control characters, and bytes of a file name that are no UTF-8 cannot be encoded.
    """
    return "".join(
        c if c.isprintable() else c.encode("unicode_escape", "surrogatepass").decode("ascii") for c in text
    )


def check_name(name: str) -> None:
    """Raise AssetError unless an object may have this name: it stands in files, tables and models.

    Raises:
        AssetError: empty, too long, reserved, with a slash, or with what cannot be printed.
    """
    if name in RESERVED:
        raise AssetError("reserved name of an object", got=name, allowed=f"any but {', '.join(RESERVED)}")
    if not name.strip() or "/" in name or not name.isprintable() or len(name) > MAX_NAME:
        raise AssetError(
            "unusable name of an object",
            got=printable(name)[: MAX_NAME + 20],
            allowed=f"1 to {MAX_NAME} visible characters, without '/'",
        )


def safe_name(name: str) -> str:
    """Return the nearest name that an object may have, such as one of a file's."""
    name = re.sub(r"[/\s]+", "_", "".join(c if c.isprintable() else "_" for c in name.strip()))[:MAX_NAME]
    if not name or name in RESERVED:
        name = f"{name}_object" if name else "object"
    return name
