"""Build hook: the data folders of the checkout go into the wheel as mpgrasp/_data.

An editable install gets none of it, since `mpgrasp/paths.py` then finds the folders in the checkout.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

DATA = ("assets/*", "scenes/*", "benchmarks/*.toml", "benchmarks/ladders", "benchmarks/README.md")
"""Patterns of files and folders."""


class DataFolders(BuildHookInterface):
    """Adds the data folders to a standard wheel."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        if version == "standard":
            root = Path(self.root)
            for path in (path for pattern in DATA for path in sorted(root.glob(pattern))):
                if path.name != "__pycache__":
                    build_data["force_include"][str(path)] = f"mpgrasp/_data/{path.relative_to(root)}"
