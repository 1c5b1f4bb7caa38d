"""Laws of data generation: the seed alone decides, and finished shards stay."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest
from height_maps import Solid, height_map

from mpgrasp.exceptions import ConfigError, OutputError
from mpgrasp.training import generate as module
from mpgrasp.training.generate import CAMERA_HEIGHT, META_COLUMNS, GenerateConfig, camera_pose, generate

CONFIG = GenerateConfig(scenes=2, seed=0, views=2, camera="ray")


def digests(paths: list[Path]) -> list[str]:
    return [hashlib.sha256(path.read_bytes()).hexdigest() for path in paths]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "SHARD_SCENES", 1)
        return generate(CONFIG, tmp_path_factory.mktemp("one"), progress=False)


def test_shards_hold_what_meta_json_says(made: list[Path]) -> None:
    description = json.loads((made[0].parent / "meta.json").read_text())
    assert len(made) == 2
    assert (made[0].parent / "sheet.png").stat().st_size > 1000
    for path in made:
        with np.load(path) as arrays:
            shapes = {name: (arrays[name].dtype.name, arrays[name].shape) for name in arrays.files}
            assert arrays["meta"][:, META_COLUMNS.index("scene")].tolist() == [made.index(path)] * 2
        image = (2, description["size"], description["size"])
        assert shapes == {
            "depth": ("uint16", image),
            **{name: ("uint8", image) for name in ("quality", "angle", "width", "object_mask")},
            "meta": ("float32", (2, len(description["meta_columns"]))),
        }


def test_the_number_of_workers_changes_no_byte(
    made: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "SHARD_SCENES", 1)
    assert digests(generate(CONFIG, tmp_path, workers=2, progress=False)) == digests(made)


def test_finished_shards_are_kept_and_missing_ones_made_again(
    made: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "SHARD_SCENES", 1)
    before, stamp = digests(made), made[0].stat().st_mtime_ns
    made[1].unlink()
    generate(CONFIG, made[0].parent, progress=False)
    assert digests(made) == before
    assert made[0].stat().st_mtime_ns == stamp


def test_a_directory_with_other_data_is_refused(made: list[Path]) -> None:
    other = GenerateConfig(scenes=2, seed=5, views=2, camera="ray")
    with pytest.raises(ConfigError, match="other data"):
        generate(other, made[0].parent, progress=False)


def test_a_file_in_the_way_is_one_clear_error(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match="cannot write"):
        generate(CONFIG, tmp_path / "file", progress=False)


@pytest.mark.parametrize("bad", [{"scenes": 0}, {"views": 0}, {"seed": -1}, {"camera": "xray"}])
def test_unusable_settings_are_refused(bad: dict[str, object]) -> None:
    with pytest.raises(ConfigError):
        GenerateConfig(**{"scenes": 1, **bad})  # type: ignore[arg-type]


def test_cameras_are_between_z_min_and_z_max_and_look_down() -> None:
    truth = height_map(Solid(x=0.5, y=0.0, yaw=0.0, length=0.06, breadth=0.02, height=0.02))
    rng = np.random.default_rng(0)
    poses = np.array([camera_pose(truth, rng) for _ in range(300)])
    assert np.all((poses[:, 2, 3] >= CAMERA_HEIGHT[0]) & (poses[:, 2, 3] <= CAMERA_HEIGHT[1]))
    assert np.all(np.arccos(-poses[:, 2, 2]) < np.deg2rad(4.5))
    assert np.allclose(poses[:, :3, :3] @ poses[:, :3, :3].transpose(0, 2, 1), np.eye(3))
    # most views hold the object, some do not
    half_view = poses[:, 2, 3] * 175 / 385
    seen = np.hypot(poses[:, 0, 3] - 0.5, poses[:, 1, 3]) < half_view
    assert 0.75 < seen.mean() < 0.99
