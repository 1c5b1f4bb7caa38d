"""Demonstrations as a LeRobotDataset, version 3: Parquet for the ticks, and what tells of them beside it.

Every episode has a data file of its own. Depth and quality are arrays of float32, not pictures: a picture's
eight bits would round depth to millimetres.

References:
    Cadene et al., "LeRobot: State-of-the-art Machine Learning for Real-World Robotics in Pytorch",
    https://github.com/huggingface/lerobot, whose release 0.4 reads what is written here.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mpgrasp.exceptions import OutputError
from mpgrasp.extras import check_installed
from mpgrasp.files.atomic import replace_file, replacing
from mpgrasp.recording.demonstration import Demonstration

VERSION = "v3.0"
FILES = 1000
"""Files in a folder at most."""
STATE = ("x", "y", "z", "yaw", *(f"q{joint}" for joint in range(1, 8)))
"""Components of `observation.state`: the tool point [m], its heading and the joints [rad]."""
ACTION = ("v_x", "v_y", "v_z", "yaw_rate")
"""Components of `action`, in units of `mpgrasp.env.ACTION_SCALE`."""

_PLACE = "chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
_QUANTILES = (0.01, 0.10, 0.50, 0.90, 0.99)

Columns = dict[str, NDArray[Any]]
"""Values (T, ...) of a demonstration by feature."""
Figures = dict[str, NDArray[Any]]
"""Minimum, maximum, mean, deviation, quantiles and count of a feature by name."""


class LeRobotWriter:
    """Writes a LeRobotDataset.

    Args:
        folder: where it goes; made if need be.
        about: facts of the run; `fps` and `task` are used.

    Raises:
        ConfigError: pyarrow is not installed.
    """

    def __init__(self, folder: Path, about: Mapping[str, Any]) -> None:
        check_installed("pyarrow", "--format lerobot")
        self._folder, self._fps, self._task = folder, int(about["fps"]), str(about["task"])
        self._episodes: list[dict[str, Any]] = []
        self._figures: list[dict[str, Figures]] = []  # of every episode by feature
        self._features: dict[str, dict[str, Any]] = {}
        self._frames = 0

    def add(self, demonstration: Demonstration) -> None:
        number, start = len(self._episodes), self._frames
        columns = self._as_columns(demonstration)
        chunk, file = divmod(number, FILES)
        self._features = self._features or {name: _feature(name, values) for name, values in columns.items()}
        _write_table(self._folder / "data" / _PLACE.format(chunk_index=chunk, file_index=file), columns)
        figures = {name: _figures(values) for name, values in columns.items()}
        self._frames += len(demonstration)
        self._figures.append(figures)
        self._episodes.append(
            {
                "episode_index": number,
                "tasks": [self._task],
                "length": len(demonstration),
                "data/chunk_index": chunk,
                "data/file_index": file,
                "dataset_from_index": start,
                "dataset_to_index": self._frames,
                "meta/episodes/chunk_index": 0,
                "meta/episodes/file_index": 0,
                **{
                    f"stats/{name}/{key}": values.ravel().tolist()
                    for name, found in figures.items()
                    for key, values in found.items()
                },
            }
        )

    def close(self) -> None:
        import pyarrow as pa

        meta = self._folder / "meta"
        episodes = meta / "episodes" / _PLACE.format(chunk_index=0, file_index=0)
        _put_table(episodes, pa.Table.from_pylist(self._episodes))
        _put_table(meta / "tasks.parquet", _tasks(self._task))
        _put_json(meta / "stats.json", self._all_figures())
        _put_json(meta / "info.json", self._info())

    def _as_columns(self, demonstration: Demonstration) -> Columns:
        seen, n = demonstration.observations, len(demonstration)
        ticks = np.arange(n)
        return {
            "observation.depth": seen["depth"],
            "observation.quality": seen["quality"],
            "observation.state": np.concatenate([seen["tcp"], seen["yaw"], seen["q"]], axis=1),
            "action": demonstration.actions,
            "next.reward": demonstration.rewards,
            "next.done": demonstration.dones,
            "next.success": demonstration.dones & demonstration.success,
            "timestamp": (ticks / self._fps).astype(np.float32),
            "frame_index": ticks,
            "episode_index": np.full(n, len(self._episodes)),
            "index": self._frames + ticks,
            "task_index": np.zeros(n, np.int64),
        }

    def _info(self) -> dict[str, Any]:
        return {
            "codebase_version": VERSION,
            "robot_type": "panda",
            "total_episodes": len(self._episodes),
            "total_frames": self._frames,
            "total_tasks": 1,
            "chunks_size": FILES,
            "data_files_size_in_mb": 100,
            "video_files_size_in_mb": 200,
            "fps": self._fps,
            "splits": {"train": f"0:{len(self._episodes)}"},
            "data_path": f"data/{_PLACE}",
            "video_path": None,
            "features": self._features,
        }

    def _all_figures(self) -> dict[str, dict[str, list[Any]]]:
        """Figures of all episodes together by feature."""
        weights = np.array([row["length"] for row in self._episodes], float) / max(self._frames, 1)
        found = {name: _together([f[name] for f in self._figures], weights) for name in self._features}
        return {name: {key: v.tolist() for key, v in values.items()} for name, values in found.items()}


def _together(rows: list[Figures], weights: NDArray[np.float64]) -> Figures:
    """Figures of several episodes; of quantiles their mean."""

    def mean_of(key: str) -> NDArray[Any]:
        return np.asarray(sum(w * row[key] for w, row in zip(weights, rows, strict=True)))

    mean = mean_of("mean")
    spread = sum(w * (r["std"] ** 2 + (r["mean"] - mean) ** 2) for w, r in zip(weights, rows, strict=True))
    return {
        "min": np.min([row["min"] for row in rows], axis=0),
        "max": np.max([row["max"] for row in rows], axis=0),
        "mean": mean,
        "std": np.sqrt(spread),
        **{key: mean_of(key) for key in rows[0] if key.startswith("q")},
        "count": np.sum([row["count"] for row in rows], axis=0),
    }


def _figures(values: NDArray[Any]) -> Figures:
    """Figures of a feature: of each component of a vector, of all pixels of an image together."""
    rows = values.astype(float).reshape(-1, 1 if values.ndim != 2 else values.shape[1])
    found = {
        "min": rows.min(axis=0),
        "max": rows.max(axis=0),
        "mean": rows.mean(axis=0),
        "std": rows.std(axis=0),
        **{f"q{round(100 * q):02d}": np.asarray(np.quantile(rows, q, axis=0)) for q in _QUANTILES},
    }
    if values.ndim > 2:  # as many axes as the image has
        found = {key: value.reshape(1, 1) for key, value in found.items()}
    return {**found, "count": np.array([len(values)])}


def _feature(name: str, values: NDArray[Any]) -> dict[str, Any]:
    shape = list(values.shape[1:]) or [1]
    names = {"observation.state": STATE, "action": ACTION}.get(name)
    if len(shape) == 2:
        names = ("height", "width")
    return {"dtype": str(values.dtype), "shape": shape, "names": None if names is None else list(names)}


def _write_table(path: Path, columns: Columns) -> None:
    import pyarrow as pa

    arrays = {}
    for name, values in columns.items():
        array = pa.array(values.reshape(-1))
        for size in reversed(values.shape[1:]):
            array = pa.FixedSizeListArray.from_arrays(array, size)
        # images as lists of lists, whose type `datasets` knows for its arrays
        arrays[name] = array.cast(pa.list_(pa.list_(pa.float32()))) if values.ndim == 3 else array
    _put_table(path, pa.table(arrays))


def _tasks(task: str) -> Any:
    """Table with the task's number, which pandas finds by the task's words."""
    import pyarrow as pa

    index = "__index_level_0__"
    kinds = (("task_index", "task_index", "int64"), (None, index, "unicode"))
    told = {
        "index_columns": [index],
        "column_indexes": [],
        "columns": [
            {"name": name, "field_name": field, "pandas_type": kind, "numpy_type": "object", "metadata": None}
            for name, field, kind in kinds
        ],
        "pandas_version": "2.2.0",
    }
    table = pa.table({"task_index": pa.array([0], pa.int64()), index: pa.array([task])})
    return table.replace_schema_metadata({"pandas": json.dumps(told)})


def _put_table(path: Path, table: Any) -> None:
    import pyarrow.parquet as pq

    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as temporary:
            pq.write_table(table, temporary, compression="zstd")
    except OSError as error:
        raise OutputError(f"demonstrations cannot be written: {error}", got=str(path)) from error


def _put_json(path: Path, content: Mapping[str, Any]) -> None:
    try:
        replace_file(path, json.dumps(content, indent=4) + "\n")
    except OSError as error:
        raise OutputError(f"demonstrations cannot be written: {error}", got=str(path)) from error
