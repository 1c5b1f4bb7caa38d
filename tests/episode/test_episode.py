"""One episode: the same world for everybody, and an ending that says what happened."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from scripted import Blind, Scripted

from mpgrasp.camera.rasteriser import require_gl
from mpgrasp.controllers import make_controller
from mpgrasp.depth import DepthFrame
from mpgrasp.detectors import make_detector
from mpgrasp.detectors.detector import GraspDetector
from mpgrasp.episode.config import EpisodeConfig
from mpgrasp.episode.episode import Episode, run_episode
from mpgrasp.exceptions import CameraError, ConfigError
from mpgrasp.grasp import Grasp, GraspMap
from mpgrasp.outcome import Outcome
from mpgrasp.recording.recorder import NullRecorder
from mpgrasp.scene.config import SceneConfig
from mpgrasp.workspace import WORKSPACE_CENTRE

SCENE = SceneConfig(objects=("usb_stick",), half_extent=0.08)
QUICK = EpisodeConfig(start_height=0.30)


class LastWords(NullRecorder):
    """Keeps what a recording ends with."""

    heard = ""

    def finish(self, event: str) -> None:
        self.heard = event


def start(seed: int, **changes: object) -> Episode:
    return Episode(SCENE, seed, detector=Blind(), config=replace(EpisodeConfig(), **changes))  # type: ignore[arg-type]


def depth_of(episode: Episode) -> np.ndarray:
    episode.look()
    assert episode.frame is not None
    return episode.frame.depth


@pytest.fixture(scope="module")
def oracle() -> GraspDetector:
    return make_detector("oracle")


class SeesColour(Blind):
    """A detector that asks for colour, and keeps it."""

    name = "sees_colour"
    reads_colour = True
    rgb: np.ndarray | None = None

    def predict(self, frame: DepthFrame) -> GraspMap:
        self.rgb = frame.rgb
        return super().predict(frame)


def test_a_detector_that_reads_colour_gets_it_or_the_episode_does_not_start() -> None:
    detector = SeesColour()
    with pytest.raises(CameraError, match="colour"):
        Episode(SCENE, 0, detector=detector, config=replace(QUICK, camera_backend="ray"))
    assert detector.rgb is None
    try:
        require_gl()
    except CameraError:
        pytest.skip("no OpenGL here")
    episode = Episode(SCENE, 0, detector=detector)
    depth = depth_of(episode)
    episode.close()
    assert detector.rgb is not None
    assert detector.rgb.shape == (*depth.shape, 3)
    assert np.ptp(detector.rgb) > 20
    np.testing.assert_array_equal(depth_of(start(0)), depth)  # colour changes nothing about the depth


def test_the_same_seed_gives_the_same_record_but_for_timing(oracle: GraspDetector) -> None:
    records = []
    for _ in range(2):
        controller = make_controller("mppc_robust")
        result = run_episode(SCENE, 0, detector=oracle, controller=controller, config=QUICK)
        records.append({k: v for k, v in result.as_record().items() if k != "timing"})
    assert records[0] == records[1]
    assert records[0]["success"] is True


def test_a_record_survives_json_unchanged(oracle: GraspDetector) -> None:
    result = run_episode(SCENE, 1, detector=oracle, controller=make_controller("open_loop"))
    record = result.as_record()
    assert json.loads(json.dumps(record, allow_nan=False)) == record
    assert record["grasp"] is not None


def test_scene_start_and_noise_are_the_same_whatever_the_detector(oracle: GraspDetector) -> None:
    frames = []
    for detector in (Blind(), oracle):
        episode = Episode(SCENE, 5, detector=detector)
        episode.look()
        assert episode.frame is not None
        frames.append(episode.frame)
        episode.close()
    np.testing.assert_array_equal(frames[0].depth, frames[1].depth)
    np.testing.assert_array_equal(frames[0].T_world_camera, frames[1].T_world_camera)


def test_noise_changes_from_tick_to_tick_but_not_between_looks_of_one_tick() -> None:
    episode = start(3)
    first, again = depth_of(episode), depth_of(episode)
    episode.ticks += 1
    second = depth_of(episode)
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, second, equal_nan=True)
    episode.close()


def test_noise_of_one_episode_tells_nothing_of_that_of_another() -> None:
    errors = []
    for seed in (3, 4):
        noisy, plain = start(seed), start(seed, noise=False)
        errors.append(depth_of(noisy) - depth_of(plain))
        noisy.close()
        plain.close()
    known = np.isfinite(errors[0]) & np.isfinite(errors[1])
    one, other = (error[known] for error in errors)
    assert min(one.std(), other.std()) > 1e-4
    assert abs(np.corrcoef(one, other)[0, 1]) < 0.1


def test_without_noise_a_tick_repeats_itself() -> None:
    episode = start(3, noise=False)
    first = depth_of(episode)
    episode.ticks += 1
    np.testing.assert_array_equal(first, depth_of(episode))
    episode.close()


def test_the_truth_is_told_to_none_but_who_declares_to_read_it() -> None:
    blind = Blind()
    Episode(SCENE, 5, detector=blind).close()
    assert blind.truth is None
    blind.reads_truth = True  # type: ignore[attr-defined]
    Episode(SCENE, 5, detector=blind).close()
    assert blind.truth is not None
    assert (blind.truth.label > 0).any()


def test_the_camera_starts_above_the_jittered_centre_looking_straight_down() -> None:
    offsets = []
    for seed in range(12):
        episode = start(seed)
        T = episode.camera.pose(episode.simulation.data)
        np.testing.assert_allclose(T[:3, 2], [0, 0, -1], atol=1e-3)
        np.testing.assert_allclose(episode.simulation.T_world_tcp[2, 3], 0.50, atol=1e-3)
        offsets.append(T[:2, 3] - WORKSPACE_CENTRE)
        episode.close()
    assert np.abs(offsets).max() <= 0.1 + 1e-3
    jitter = EpisodeConfig().start_jitter
    assert 0.5 * jitter < np.std(offsets) < 1.5 * jitter  # each from a seed of its own
    # 24 draws of sigma 5 cm: the sample's deviation lies within 5 +- 2.5 cm
    assert 0.025 < np.std(offsets) < 0.075


def test_seeing_nothing_ends_without_a_grasp_and_without_touching_anything() -> None:
    result = run_episode(SCENE, 2, detector=Blind(), controller=make_controller("open_loop"), config=QUICK)
    assert result.outcome is Outcome.NO_GRASP
    assert result.grasp is None
    assert not result.success


def test_a_grasp_beside_the_object_misses() -> None:
    empty = Grasp(position=np.array([0.62, 0.2, 0.0]), angle=0.3, width=0.04, quality=1.0)
    controller = Scripted((0, 0, 0, 0, 0, 0), ticks=1, grasp=empty)
    words = LastWords()
    result = run_episode(SCENE, 2, detector=Blind(), controller=controller, config=QUICK, recorder=words)
    assert result.outcome is Outcome.MISSED
    assert words.heard == "missed: nothing stood between the closed fingers"


def test_driving_out_of_reach_ends_in_a_reflex_that_names_its_limit() -> None:
    controller = Scripted((0.1, 0, 0, 0, 0, 0))
    result = run_episode(SCENE, 2, detector=Blind(), controller=controller, config=QUICK)
    assert result.outcome is Outcome.REFLEX
    assert result.reflex is not None
    assert abs(result.reflex.value) > abs(result.reflex.bound)
    assert result.min_singular_value < 0.1
    assert str(result.reflex).startswith(result.reflex.limit)


def test_standing_still_for_ever_is_a_timeout_at_the_configured_time() -> None:
    config = replace(QUICK, max_reach_time=1.0)
    result = run_episode(SCENE, 2, detector=Blind(), controller=Scripted((0,) * 6), config=config)
    assert result.outcome is Outcome.TIMEOUT
    assert result.ticks == 10
    assert result.sim_time_s == pytest.approx(1.0, abs=1e-6)
    assert result.path_length_m < 0.005


@pytest.mark.parametrize(
    "wrong", [{"control_dt": 0.0}, {"start_jitter": -0.1}, {"camera_backend": "film"}, {"max_reach_time": -1}]
)
def test_unusable_settings_are_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(ConfigError):
        EpisodeConfig(**wrong)  # type: ignore[arg-type]
