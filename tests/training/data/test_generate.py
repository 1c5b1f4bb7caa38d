"""Laws of data generation: the seed alone decides, and finished shards stay."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
import shutil
import signal
import time
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from height_maps import Solid, height_map

from mpgrasp.camera import rasteriser
from mpgrasp.detectors.antipodal.analysis import WorldGrasps
from mpgrasp.exceptions import CameraError, ConfigError, MpgraspError, OutputError
from mpgrasp.geometry import invert, transform_points
from mpgrasp.training.__main__ import main
from mpgrasp.training.data import generation, shards, views
from mpgrasp.training.data.generate_config import GenerateConfig
from mpgrasp.training.data.generation import Job, generate
from mpgrasp.training.data.verification import GOOD, TRIAL_COLUMNS, Verified
from mpgrasp.training.data.views import (
    CAMERA_HEIGHT,
    META_COLUMNS,
    TILT,
    camera_pose,
    make_scene,
    make_views,
    stored_intrinsics,
    stored_pose,
)

CONFIG = GenerateConfig(scenes=2, seed=0, views=2, camera="ray", colour=False)
try:
    rasteriser.require_gl()
    HAS_GL = True
except CameraError:
    HAS_GL = False


def digests(paths: list[Path]) -> list[str]:
    return [hashlib.sha256(path.read_bytes()).hexdigest() for path in paths]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(shards, "SHARD_SCENES", 1)
        return generate(CONFIG, tmp_path_factory.mktemp("one"), progress=False)


def test_shards_hold_what_meta_json_says(made: list[Path]) -> None:
    description = json.loads((made[0].parent / "meta.json").read_text())
    assert len(made) == 2
    assert (made[0].parent / "sheet.png").stat().st_size > 1000
    for path in made:
        with np.load(path) as arrays:
            shapes = {name: (arrays[name].dtype.name, arrays[name].shape) for name in arrays.files}
            assert arrays["meta"][:, META_COLUMNS.index("scene")].tolist() == [made.index(path)] * 2
            n_trials = len(arrays["trials"])
        image = (2, description["size"], description["size"])
        assert shapes == {
            "depth": ("uint16", image),
            **{name: ("uint8", image) for name in ("quality", "angle", "width", "object_mask")},
            "meta": ("float32", (2, len(description["meta_columns"]))),
            "trials": ("float32", (n_trials, len(description["trial_columns"]))),
        }
        assert n_trials >= 2


def test_the_number_of_workers_changes_no_byte(
    made: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(shards, "SHARD_SCENES", 1)
    assert digests(generate(CONFIG, tmp_path, workers=2, progress=False)) == digests(made)


def test_the_card_counts_the_lifts_that_the_shards_record(made: list[Path]) -> None:
    card = (made[0].parent / "README.md").read_text()
    trials = []
    for path in made:
        with np.load(path) as arrays:
            trials.append(arrays["trials"])
    told = dict(zip(TRIAL_COLUMNS, np.concatenate(trials).T, strict=True))
    audit = told["audit"] > 0
    n, lifted = int(audit.sum()), int(told["lifted"][audit].sum())
    assert f"| shipped positives ({GOOD} or better) | {lifted}/{n} = " in card
    assert np.all(told["shipped"][audit] >= GOOD)
    assert np.all(told["quality"][told["positive"] == 0] == 0)
    assert "--scenes 2 --seed 0 --views 2 --out DIR --camera ray --no-colour" in card


def test_a_stored_view_leads_back_to_the_grasps_that_were_lifted(made: list[Path]) -> None:
    # the depth under a grasp's point, seen from the stored pose, is that point's
    near = []
    for path in made:
        with np.load(path) as arrays:
            for meta, depth in zip(arrays["meta"], arrays["depth"], strict=True):
                points = arrays["trials"][:, [TRIAL_COLUMNS.index(c) for c in "xyz"]].astype(float)
                camera = transform_points(invert(stored_pose(meta)), points)
                u, v = np.rint(stored_intrinsics().project(camera)).astype(int).T
                seen = (u >= 0) & (u < 224) & (v >= 0) & (v < 224)
                measured = depth[v[seen], u[seen]] * 5e-5
                near += (np.abs(measured - camera[seen, 2])[measured > 0] < 0.006).tolist()
    assert len(near) >= 4
    assert np.mean(near) > 0.7


def test_a_scene_made_again_is_the_same_to_the_colour() -> None:
    first, second = (make_scene(3, 0)[0] for _ in range(2))
    assert np.array_equal(first.state, second.state)
    assert np.array_equal(first.model.geom_rgba, second.model.geom_rgba)
    assert np.array_equal(first.model.light_dir, second.model.light_dir)


@pytest.mark.skipif(not HAS_GL, reason="no OpenGL on this machine")
def test_colour_changes_nothing_but_adds_an_image(monkeypatch: pytest.MonkeyPatch) -> None:
    def unverified(scene: object, grasps: WorldGrasps, rng: object, *, index: int) -> Verified:
        return Verified(grasps=grasps, trials=np.zeros((0, len(TRIAL_COLUMNS)), np.float32))

    monkeypatch.setattr(views, "verify", unverified)
    plain, coloured = (
        make_views(GenerateConfig(scenes=1, seed=0, views=1, camera="gl", colour=colour), 0)
        for colour in (False, True)
    )
    assert set(coloured) - set(plain) == {"rgb"}
    assert coloured["rgb"].shape == (1, 224, 224, 3)
    assert coloured["rgb"].dtype == np.uint8
    assert all(np.array_equal(plain[name], coloured[name]) for name in plain)
    assert coloured["rgb"].std() > 1


def test_without_gl_colour_is_one_clear_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(rasteriser, "_gl_error", lambda: CameraError("broken"))
    out = tmp_path / "set"
    assert main(["generate", "--scenes", "1", "--out", str(out)]) == 2
    assert "--no-colour" in capsys.readouterr().err
    assert not out.exists()
    with pytest.raises(ConfigError, match="no colour"):
        GenerateConfig(scenes=1, camera="ray")


def test_finished_shards_are_kept_and_missing_ones_made_again(
    made: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(shards, "SHARD_SCENES", 1)
    before, stamp = digests(made), made[0].stat().st_mtime_ns
    made[1].unlink()
    generate(CONFIG, made[0].parent, progress=False)
    assert digests(made) == before
    assert made[0].stat().st_mtime_ns == stamp


def stored(config: GenerateConfig, out: Path) -> None:
    """Shards with nothing but the scene of each row, and their description."""
    shards.prepare(config, out)
    for path, scenes in shards.planned(config, out).items():
        meta = np.zeros((len(scenes) * config.views, len(META_COLUMNS)), np.float32)
        meta[:, META_COLUMNS.index("scene")] = np.repeat(scenes, config.views)
        shards.write_shard(path, {"meta": meta})


def scenes(count: int) -> GenerateConfig:
    return dataclasses.replace(CONFIG, scenes=count)


def test_a_set_that_grows_writes_its_short_last_shard_again(tmp_path: Path) -> None:
    stored(scenes(30), tmp_path)
    assert shards.unfinished(scenes(30), tmp_path) == {}
    assert shards.unfinished(scenes(60), tmp_path) == {
        tmp_path / "shard_00001.npz": range(20, 40),
        tmp_path / "shard_00002.npz": range(40, 60),
    }


@pytest.mark.parametrize("count", [59, 40, 30, 1])
def test_scenes_beyond_the_last_are_refused_and_left_alone(count: int, tmp_path: Path) -> None:
    stored(scenes(60), tmp_path)
    before = digests(sorted(tmp_path.iterdir()))
    with pytest.raises(ConfigError, match=f"beyond the last one.*shard_00002.npz.*more than {count} scenes"):
        generate(scenes(count), tmp_path, progress=False)
    assert digests(sorted(tmp_path.iterdir())) == before


@pytest.mark.parametrize("content", [b"", b"junk", b"PK\x03\x04 junk"])
def test_a_shard_that_cannot_be_read_is_written_again(content: bytes, tmp_path: Path) -> None:
    stored(scenes(40), tmp_path)
    broken = tmp_path / "shard_00001.npz"
    broken.write_bytes(content)
    assert shards.unfinished(scenes(40), tmp_path) == {broken: range(20, 40)}


def copied(made: list[Path], job: Job) -> None:
    _, scenes, path = job
    shutil.copyfile(made[scenes[0]], path)


def copied_until_killed(made: list[Path], job: Job) -> None:
    """Copies the first shard; the worker of the second is killed once that is done."""
    _, scenes, path = job
    while scenes[0] == 1 and not (path.parent / made[0].name).is_file():
        time.sleep(0.01)
    if scenes[0] == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    copied(made, job)


def test_a_killed_worker_is_one_clear_error_and_the_same_command_goes_on(
    made: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(shards, "SHARD_SCENES", 1)
    monkeypatch.setattr(generation, "_write_shard", partial(copied_until_killed, made))
    with pytest.raises(MpgraspError, match=r"worker process was killed.*finished shards are kept"):
        generate(CONFIG, tmp_path, workers=2, progress=False)
    assert [path.name for path in tmp_path.glob("shard_*")] == ["shard_00000.npz"]
    monkeypatch.setattr(generation, "_write_shard", partial(copied, made))
    assert digests(generate(CONFIG, tmp_path, workers=2, progress=False)) == digests(made)


def test_a_description_is_there_whole_or_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError("No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OutputError, match="No space left"):
        shards.prepare(CONFIG, tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_directory_with_other_data_is_refused(made: list[Path]) -> None:
    other = GenerateConfig(scenes=2, seed=5, views=2, camera="ray", colour=False)
    with pytest.raises(ConfigError, match=r"other data \(seed: 0 there, 5 here\)"):
        generate(other, made[0].parent, progress=False)


def test_data_of_another_format_is_not_added_to(tmp_path: Path) -> None:
    (tmp_path / "meta.json").write_text(json.dumps(shards.describe(CONFIG) | {"format": 2}))
    with pytest.raises(ConfigError, match=r"other data \(format: 2 there, \d+ here\)"):
        generate(CONFIG, tmp_path, progress=False)


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
    tilt = np.arccos(-poses[:, 2, 2])
    assert np.all(tilt < np.sqrt(2) * 2 * TILT + 1e-3)
    assert np.mean(tilt) > TILT  # of both axes together
    assert np.allclose(poses[:, :3, :3] @ poses[:, :3, :3].transpose(0, 2, 1), np.eye(3))
    # most views hold the object, some do not
    half_view = poses[:, 2, 3] * 175 / 385
    seen = np.hypot(poses[:, 0, 3] - 0.5, poses[:, 1, 3]) < half_view
    assert 0.75 < seen.mean() < 0.99
