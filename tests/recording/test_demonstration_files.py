"""Laws of files of demonstrations: what is read back, by whoever reads such files, is what was written."""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import numpy as np
import pyarrow.parquet as pq
import pytest

from mpgrasp.exceptions import OutputError
from mpgrasp.recording.demonstration import Demonstration
from mpgrasp.recording.demonstration_files import DemonstrationWriter, Hdf5Writer, NumpyWriter
from mpgrasp.recording.lerobot_files import LeRobotWriter

ABOUT = {"suite": "thin", "fps": 10, "task": "a stick: lift it"}
LENGTHS = (5, 3)


def demonstration(length: int, *, success: bool) -> Demonstration:
    rng = np.random.default_rng(length)
    shapes = {"depth": (8, 6), "quality": (8, 6), "tcp": (3,), "yaw": (1,), "time": (1,), "q": (7,)}
    return Demonstration(
        observations={
            name: rng.random((length, *shape)).astype(np.float32) for name, shape in shapes.items()
        },
        actions=rng.uniform(-1, 1, (length, 4)).astype(np.float32),
        success=success,
        about={"episode": length},
    )


MADE = [demonstration(n, success=n > 3) for n in LENGTHS]


def written(writer: DemonstrationWriter) -> None:
    for made in MADE:
        writer.add(made)
    writer.close()


def test_numpy_files_come_back(tmp_path: Path) -> None:
    written(NumpyWriter(tmp_path / "new", ABOUT))
    index = json.loads((tmp_path / "new" / "index.json").read_text())
    assert [row["length"] for row in index["demonstrations"]] == list(LENGTHS)
    assert [row["success"] for row in index["demonstrations"]] == [True, False]
    assert index["task"] == ABOUT["task"]
    for row, made in zip(index["demonstrations"], MADE, strict=True):
        assert row["episode"] == made.about
        with np.load(tmp_path / "new" / row["file"]) as content:
            np.testing.assert_array_equal(content["actions"], made.actions)
            np.testing.assert_array_equal(content["rewards"], made.rewards)
            for name, values in made.observations.items():
                np.testing.assert_array_equal(content[f"obs/{name}"], values)


def test_hdf5_is_laid_out_as_robomimic_reads_it(tmp_path: Path) -> None:
    written(Hdf5Writer(tmp_path, ABOUT))
    with h5py.File(tmp_path / "demonstrations.hdf5") as file:
        assert file["data"].attrs["total"] == sum(LENGTHS)
        assert json.loads(file["data"].attrs["env_args"])["env_name"] == "mpgrasp, thin"
        assert list(file["data"]) == ["demo_0", "demo_1"]
        for k, made in enumerate(MADE):
            group = file[f"data/demo_{k}"]
            assert group.attrs["num_samples"] == len(made)
            np.testing.assert_array_equal(group["actions"][:], made.actions)
            np.testing.assert_array_equal(group["dones"][:], made.dones)
            for name, values in made.observations.items():
                np.testing.assert_array_equal(group[f"obs/{name}"][:], values)


@pytest.fixture
def lerobot(tmp_path: Path) -> Path:
    written(LeRobotWriter(tmp_path, ABOUT))
    return tmp_path


def test_a_lerobot_dataset_tells_where_everything_is(lerobot: Path) -> None:
    info = json.loads((lerobot / "meta" / "info.json").read_text())
    assert (info["codebase_version"], info["fps"]) == ("v3.0", 10)
    assert (info["total_episodes"], info["total_frames"]) == (2, sum(LENGTHS))
    episodes = pq.read_table(lerobot / "meta" / "episodes" / "chunk-000" / "file-000.parquet").to_pylist()
    assert [row["length"] for row in episodes] == list(LENGTHS)
    assert [row["dataset_from_index"] for row in episodes] == [0, LENGTHS[0]]
    for row, made in zip(episodes, MADE, strict=True):
        place = {key: row[f"data/{key}"] for key in ("chunk_index", "file_index")}
        table = pq.read_table(lerobot / info["data_path"].format(**place))
        assert set(table.column_names) == set(info["features"])
        columns = {name: np.array(table[name].to_pylist()) for name in table.column_names}
        np.testing.assert_allclose(columns["observation.depth"], made.observations["depth"])
        np.testing.assert_allclose(columns["observation.state"][:, :3], made.observations["tcp"])
        np.testing.assert_allclose(columns["observation.state"][:, 4:], made.observations["q"])
        np.testing.assert_allclose(columns["action"], made.actions)
        np.testing.assert_array_equal(columns["index"], row["dataset_from_index"] + np.arange(len(made)))
        assert columns["next.success"].any() == made.success
        assert columns["timestamp"][-1] == pytest.approx((len(made) - 1) / 10)


def test_figures_of_a_lerobot_dataset_are_those_of_all_its_ticks(lerobot: Path) -> None:
    stats = json.loads((lerobot / "meta" / "stats.json").read_text())
    actions = np.concatenate([made.actions for made in MADE]).astype(float)
    depth = np.concatenate([made.observations["depth"].reshape(-1) for made in MADE]).astype(float)
    for name in ("min", "max", "mean", "std"):
        np.testing.assert_allclose(stats["action"][name], getattr(actions, name)(axis=0), rtol=1e-6)
        np.testing.assert_allclose(stats["observation.depth"][name], [[getattr(depth, name)()]], rtol=1e-6)
    assert stats["action"]["count"] == [sum(LENGTHS)]


def test_the_task_is_found_by_its_words(lerobot: Path) -> None:
    table = pq.read_table(lerobot / "meta" / "tasks.parquet")
    told = json.loads(table.schema.metadata[b"pandas"])
    (index,) = told["index_columns"]
    assert dict(zip(table[index].to_pylist(), table["task_index"].to_pylist(), strict=True)) == {
        ABOUT["task"]: 0
    }


@pytest.mark.parametrize("make", [NumpyWriter, LeRobotWriter])
def test_a_place_that_cannot_be_written_is_said(make: type[NumpyWriter], tmp_path: Path) -> None:
    writer = make(tmp_path, ABOUT)
    blocked = {NumpyWriter: "demo_000000.npz", LeRobotWriter: "data"}[make]
    if make is NumpyWriter:
        (tmp_path / blocked).mkdir()
    else:
        (tmp_path / blocked).write_text("in the way")
    with pytest.raises(OutputError, match="cannot be written"):
        writer.add(MADE[0])
