"""Demonstrations as files that others learn from: plain numpy, and HDF5 as robomimic lays it out.

References:
    Mandlekar et al., "What Matters in Learning from Offline Human Demonstrations for Robot Manipulation",
    CoRL 2021, whose code (robomimic) reads `data/demo_0/obs/...`, `actions`, `rewards` and `dones`.
"""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from mpgrasp.exceptions import OutputError
from mpgrasp.extras import check_installed
from mpgrasp.files.atomic import replace_file
from mpgrasp.recording.demonstration import Demonstration
from mpgrasp.recording.policy_view import ACTION_SCALE


class DemonstrationWriter(Protocol):
    """Writes demonstrations one after the other."""

    def add(self, demonstration: Demonstration) -> None:
        """Write one.

        Raises:
            OutputError: it cannot be written.
        """
        ...

    def close(self) -> None:
        """Write what tells of all of them.

        Raises:
            OutputError: it cannot be written.
        """
        ...


class NumpyWriter:
    """A file `demo_000000.npz` for each demonstration, and `index.json`.

    Args:
        folder: where they go; made if need be.
        about: facts of the run, for the index.
    """

    def __init__(self, folder: Path, about: Mapping[str, Any]) -> None:
        self._folder, self._about = folder, about
        self._rows: list[dict[str, Any]] = []
        folder.mkdir(parents=True, exist_ok=True)

    def add(self, demonstration: Demonstration) -> None:
        name = f"demo_{len(self._rows):06d}.npz"
        content = io.BytesIO()
        arrays: dict[str, Any] = {f"obs/{key}": seen for key, seen in demonstration.observations.items()}
        np.savez_compressed(
            content,
            actions=demonstration.actions,
            rewards=demonstration.rewards,
            dones=demonstration.dones,
            **arrays,
        )
        _write(self._folder / name, content.getvalue())
        row = {"file": name, "length": len(demonstration), "success": demonstration.success}
        self._rows.append({**row, "episode": demonstration.about})

    def close(self) -> None:
        index = {**self._about, "action_scale": ACTION_SCALE, "demonstrations": self._rows}
        _write(self._folder / "index.json", json.dumps(index, indent=1) + "\n")


class Hdf5Writer:
    """One file `demonstrations.hdf5`: a group `data/demo_0` and so on for each demonstration.

    Args:
        folder: where it goes; made if need be.
        about: facts of the run, as an attribute of `data`.

    Raises:
        ConfigError: h5py is not installed.
        OutputError: the file cannot be written.
    """

    def __init__(self, folder: Path, about: Mapping[str, Any]) -> None:
        check_installed("h5py", "--format hdf5")
        import h5py

        folder.mkdir(parents=True, exist_ok=True)
        self._path, self._count, self._total = folder / "demonstrations.hdf5", 0, 0
        try:
            self._file = h5py.File(self._path, "w")
        except OSError as error:
            raise OutputError(f"demonstrations cannot be written: {error}", got=str(self._path)) from error
        self._data = self._file.create_group("data")
        env = {
            "env_name": f"mpgrasp, {about.get('suite', '')}",
            "type": "mpgrasp.env:GraspEnv",
            "env_kwargs": {},
        }
        self._data.attrs["env_args"] = json.dumps(env)
        self._data.attrs["about"] = json.dumps({**about, "action_scale": ACTION_SCALE})

    def add(self, demonstration: Demonstration) -> None:
        try:
            group = self._data.create_group(f"demo_{self._count}")
            group.attrs["num_samples"] = len(demonstration)
            group.attrs["success"] = demonstration.success
            group.attrs["episode"] = json.dumps(demonstration.about)
            for key in ("actions", "rewards", "dones"):
                group.create_dataset(key, data=getattr(demonstration, key))
            for key, values in demonstration.observations.items():
                group.create_dataset(f"obs/{key}", data=values, compression="gzip", compression_opts=1)
            self._file.flush()
        except OSError as error:
            raise OutputError(f"a demonstration cannot be written: {error}", got=str(self._path)) from error
        self._count, self._total = self._count + 1, self._total + len(demonstration)

    def close(self) -> None:
        try:
            self._data.attrs["total"] = self._total
            self._file.close()
        except OSError as error:
            raise OutputError(f"demonstrations cannot be written: {error}", got=str(self._path)) from error


def _write(path: Path, content: str | bytes) -> None:
    try:
        replace_file(path, content)
    except OSError as error:
        raise OutputError(
            f"demonstrations cannot be written: {error.strerror or error}",
            got=str(path),
            allowed="a directory one may write to",
        ) from error
