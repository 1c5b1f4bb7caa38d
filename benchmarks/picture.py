"""`python benchmarks/picture.py`: the README picture, a filmstrip of the first `thin` episode."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

from mpgrasp import make_controller, make_detector, run_episode
from mpgrasp.recording.film import FilmRecorder
from mpgrasp.suite import episode_seed, load_suite

PICTURE = Path(__file__).resolve().parent.parent / "docs" / "episode.png"


def main() -> None:
    """Play the episode and write the picture."""
    suite = load_suite("thin")
    PICTURE.parent.mkdir(exist_ok=True)
    with TemporaryDirectory() as folder:
        result = run_episode(
            suite.scene_config(0),
            episode_seed(suite.name, 0, 0),
            detector=make_detector("dhrnet"),
            controller=make_controller("mppc"),
            config=suite.episode_config(),
            recorder=FilmRecorder(Path(folder) / "episode.gif", strip=PICTURE),
        )
    print(f"{PICTURE}: {result.outcome}")


if __name__ == "__main__":
    main()
