"""Draw the picture of the README, a filmstrip of the first `thin` episode: `python benchmarks/picture.py`."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import study

PICTURE = Path(__file__).resolve().parent.parent / "docs" / "episode.png"


def _study(command: Sequence[str]) -> None:
    parser = study.Parser(description=__doc__)
    parser.add_argument("--out", metavar="FILE", type=Path, default=PICTURE, help="default: docs/episode.png")
    out: Path = parser.parse_args(command).out
    from mpgrasp import make_controller, make_detector, run_episode
    from mpgrasp.recording.film import FilmRecorder
    from mpgrasp.suite import episode_seed, load_suite

    suite = load_suite("thin")
    study.prepare(out.parent)
    with TemporaryDirectory() as folder:
        result = run_episode(
            suite.scene_config(0),
            episode_seed(suite.name, 0, 0),
            detector=make_detector("dhrnet"),
            controller=make_controller("mppc"),
            config=suite.episode_config(),
            recorder=FilmRecorder(Path(folder) / "episode.gif", strip=out),
        )
    print(f"{out}: {result.outcome}")


def main(command: Sequence[str] | None = None) -> int:
    """Run the command line (`sys.argv` if not given) and return the exit code; 2 for unusable input."""
    return study.run_command(_study, command)


if __name__ == "__main__":
    sys.exit(main())
