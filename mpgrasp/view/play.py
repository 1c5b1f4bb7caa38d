"""Plays one episode of the benchmark to a recorder."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from mpgrasp.suite import episode_seed, load_suite

if TYPE_CHECKING:
    from mpgrasp.episode.result import ClearingResult, EpisodeResult
    from mpgrasp.recording.recorder import Recorder


def play(
    suite: str,
    detector: str,
    controller: str,
    recorder: Recorder,
    *,
    seed: int = 0,
    episode: int = 0,
    settings: Sequence[str] = (),
    camera: str = "auto",
) -> EpisodeResult | ClearingResult:
    """Play an episode as a run of the benchmark would, and return its result.

    Args:
        suite: name, or a path to a declaration that ends in `.toml`.
        detector: name.
        controller: name.
        recorder: is shown every tick.
        seed: of the run.
        episode: its number in the run.
        settings: assignments `GROUP.KEY=VALUE`.
        camera: backend: "auto", "gl" or "ray".

    Raises:
        ConfigError, WeightsError: input that cannot be used.
        PlugInError: what the detector or the controller returned cannot be used.
    """
    from mpgrasp.episode.clearing import run_clearing
    from mpgrasp.episode.episode import run_episode
    from mpgrasp.plugin_names import canonical, detectors_of
    from mpgrasp.plugins import load_controller, load_detector
    from mpgrasp.settings.changes import with_assignments
    from mpgrasp.settings.sharing import MethodSettings

    (of,) = with_assignments((load_suite(suite),), settings, noise=True)
    (seeing,), weights = detectors_of(detector)
    steering = canonical("controller", controller)
    own = MethodSettings.of(of, [seeing], [steering])
    run: Any = run_clearing if of.trial == "clear" else run_episode
    result: EpisodeResult | ClearingResult = run(
        of.scene_config(episode),
        episode_seed(of.name, seed, episode),
        detector=load_detector(seeing, weights.get(seeing), settings=own.detectors.get(seeing)),
        controller=load_controller(steering, own.controllers.get(steering)),
        config=of.episode_config(camera=camera),
        recorder=recorder,
    )
    return result
