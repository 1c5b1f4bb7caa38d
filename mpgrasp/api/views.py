"""`mpgrasp.scene` and `mpgrasp.episode`: what a notebook shows as a picture and as a film."""

from __future__ import annotations

import base64
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mpgrasp.api.evaluation import assignments
from mpgrasp.exceptions import ConfigError
from mpgrasp.recording.false_colour import Picture
from mpgrasp.suite import Suite, episode_seed, load_suite

if TYPE_CHECKING:
    from mpgrasp.episode.result import ClearingResult, EpisodeResult
    from mpgrasp.scene.scene import Scene


@dataclass(frozen=True, kw_only=True, eq=False)
class SceneView:
    """The scene of an episode of the benchmark, settled."""

    scene: Scene
    """Model, state and objects."""
    suite: str
    seed: int
    """Of the scene itself."""

    def picture(self) -> Picture:
        """Return the scene as a camera beside the table sees it, RGB (H, W, 3)."""
        from mpgrasp.recording.watcher import Watcher

        watcher = Watcher(self.scene.model)
        try:
            return watcher.picture(self.scene.data())
        finally:
            watcher.close()

    def _repr_png_(self) -> bytes:
        from mpgrasp.evaluate.sheets import png

        return png(self.picture())

    def __repr__(self) -> str:
        return f"scene of {self.suite}, seed {self.seed}: {', '.join(self.scene.objects)}"


@dataclass(frozen=True, kw_only=True, eq=False)
class EpisodeView:
    """One episode that was played, with its film where one was wanted."""

    result: EpisodeResult | ClearingResult
    """Outcome, times, path, protective stop, the grasp."""
    film: Path | None
    """GIF of it; None without."""
    kept: Any = None
    """What removes the film when the view goes."""

    @property
    def outcome(self) -> str:
        """The verdict of physics."""
        return str(self.result.outcome)

    def last_frame(self) -> Picture:
        """Return the film's last picture, RGB (H, W, 3).

        Raises:
            ConfigError: there is no film.
        """
        import imageio.v3 as iio

        if self.film is None:
            raise ConfigError("an episode without a film", allowed="episode(..., film=True)")
        *_, last = iio.imiter(self.film)
        return last[..., :3]

    def _repr_html_(self) -> str:
        if self.film is None:
            return f"<pre>{self!r}</pre>"
        data = base64.b64encode(self.film.read_bytes()).decode()
        said = repr(self)
        return (
            f'<figure><img alt="{said}" src="data:image/gif;base64,{data}">'
            f"<figcaption>{said}</figcaption></figure>"
        )

    def __repr__(self) -> str:
        what = getattr(self.result, "object", "the table")
        return f"{self.result.outcome}: {what}, {self.result.sim_time_s:.1f} s"


def scene(suite: str = "thin", *, seed: int = 0, episode: int = 0) -> SceneView:
    """Build the scene of an episode of the benchmark, with the robot, and let it settle.

    Args:
        suite: name, or a path to a declaration that ends in `.toml`.
        seed: of the run.
        episode: its number in the run, from 0.

    Raises:
        ConfigError: an unknown suite, or numbers that cannot be used.
    """
    from mpgrasp.scene.scene import build_scene

    of = _suite(suite, seed, episode)
    own = episode_seed(of.name, seed, episode)
    return SceneView(scene=build_scene(of.scene_config(episode), own), suite=of.name, seed=own)


def episode(
    detector: Any = "dhrnet",
    controller: Any = "mppc",
    suite: str = "thin",
    *,
    seed: int = 0,
    episode: int = 0,
    settings: Mapping[str, Any] | None = None,
    film: bool = True,
    camera: str = "auto",
) -> EpisodeView:
    """Play one episode of the benchmark: the same, bit for bit, as in a run of it.

    Args:
        detector: name, or an object with `reset` and `predict`.
        controller: name, or an object.
        suite: name, or a path to a declaration that ends in `.toml`.
        seed: of the run.
        episode: its number in the run, from 0.
        settings: settings by name, such as `{"controller.gamma": 4 / 3}`.
        film: True for a film of it, which a notebook shows.
        camera: "auto", "gl" or "ray".

    Raises:
        ConfigError, WeightsError: input that cannot be used.
    """
    from mpgrasp.episode.clearing import run_clearing
    from mpgrasp.episode.episode import run_episode
    from mpgrasp.plugins import load_controller, load_detector
    from mpgrasp.recording.film import FilmConfig, FilmRecorder
    from mpgrasp.settings.changes import with_assignments
    from mpgrasp.settings.sharing import controller_settings, detector_settings

    of = _suite(suite, seed, episode)
    (of,) = with_assignments((of,), assignments(settings), noise=True)
    if isinstance(detector, str):
        detector = load_detector(detector, settings=detector_settings((detector,), of.detector)[detector])
    if isinstance(controller, str):
        own = controller_settings((controller,), of.controller)[controller]
        controller = load_controller(controller, own)
    kept = tempfile.TemporaryDirectory(prefix="mpgrasp-") if film else None
    file = None if kept is None else Path(kept.name) / "episode.gif"
    recorder = None if file is None else FilmRecorder(file, config=FilmConfig(backend=camera))
    play: Any = run_clearing if of.trial == "clear" else run_episode
    result = play(
        of.scene_config(episode),
        episode_seed(of.name, seed, episode),
        detector=detector,
        controller=controller,
        config=of.episode_config(camera=camera),
        recorder=recorder,
    )
    return EpisodeView(result=result, film=file, kept=kept)


def _suite(name: str, seed: int, episode: int) -> Suite:
    for what, value in (("seed", seed), ("episode", episode)):
        if isinstance(value, bool) or not isinstance(value, int) or value < 0:
            raise ConfigError(f"unusable {what}", got=value, allowed="0, 1, 2, ...")
    return load_suite(name)
