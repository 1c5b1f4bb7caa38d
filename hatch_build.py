"""Build hook: the data folders of the checkout go into the wheel as mpgrasp/_data.

An editable install gets none of it, since `mpgrasp/paths.py` then finds the folders in the checkout.
"""

from __future__ import annotations

from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

DATA_FOLDERS = ("assets", "scenes", "benchmarks")


class DataFolders(BuildHookInterface):
    """Adds the data folders to a standard wheel."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        if version == "standard":
            build_data["force_include"] |= {name: f"mpgrasp/_data/{name}" for name in DATA_FOLDERS}
