"""Film MVP on its way into a singular posture, beside MP-PC in the same world, and draw both ways from above.

    python benchmarks/singular_film.py

Writes `OUT.webp`, both episodes side by side on one clock, and `OUT.png`: the ways of the camera seen from
above, coloured by the smallest singular value of the tool Jacobian, and that value against time.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from study import Parser, figure, not_negative, prepare, run_command, style

from mpgrasp import command_line
from mpgrasp.exceptions import ConfigError, OutputError
from mpgrasp.files.atomic import replacing
from mpgrasp.geometry import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from mpgrasp.recording.false_colour import Picture
    from mpgrasp.recording.recorder import TickRecord
    from mpgrasp.scene.simulation import Simulation

SUITE, EPISODE = "thin_2mm", 95
CONTROLLERS = ("mvp", "mppc")
OUT = Path(__file__).resolve().parent.parent / "docs" / "singular"
MAX_BYTES = 1_400_000
"""A film that gets larger is written again with fewer pictures a second."""
WARNING = 0.05
"""Smallest singular value below which a posture is called singular."""
_RATES = (8, 5, 4, 3, 2, 1)  # pictures a second, the first that is small enough is taken [Hz]
_LAST = 2.0  # for which the end stands still [s]
_CROP = 496  # width of a film's picture that is shown: the scene and the first column of maps [px]


@dataclass(eq=False)
class Way:
    """Recorder of where the camera goes, and of how close to a singularity the arm comes."""

    times: list[float] = field(default_factory=list)
    camera: list[FloatArray] = field(default_factory=list)
    """World (x, y) of the wrist camera [m]."""
    singular_values: list[float] = field(default_factory=list)
    stick: FloatArray | None = None
    """World (x, y) of the stick at the start [m]."""
    event: str = ""
    """Outcome in words."""

    def start(self, simulation: Simulation) -> None:
        self.stick = simulation.object_pose(simulation.scene.objects[0])[:2, 3].copy()

    def tick(self, record: TickRecord) -> None:
        from mpgrasp.camera.wrist_camera import WRIST

        self.times.append(record.simulation.time)
        self.camera.append(record.simulation.data.camera(WRIST).xpos[:2].copy())
        self.singular_values.append(record.min_singular_value)

    def finish(self, event: str) -> None:
        self.event = event


def titled(picture: Picture, name: str) -> Picture:
    """Return a picture with a name in its corner."""
    from PIL import Image, ImageDraw, ImageFont

    image = Image.fromarray(picture)
    ImageDraw.Draw(image).text((10, 8), name, fill=(255, 255, 255), font=ImageFont.load_default(22))
    return np.asarray(image)


def side_by_side(films: Sequence[tuple[Sequence[float], Sequence[Picture]]], rate: float) -> list[Picture]:
    """Return pictures on one clock from films of (times [s], pictures), each of which stays at its end.

    Args:
        films: whose pictures are equally high.
        rate: pictures a second [Hz].
    """
    ends = max(times[-1] for times, _ in films)
    starts = min(times[0] for times, _ in films)
    clock = np.append(np.arange(starts, ends, 1 / rate), ends)
    shown = [np.searchsorted(times, clock + 1e-9, side="right") - 1 for times, _ in films]
    return [
        np.hstack([pictures[max(0, int(k))] for k, (_, pictures) in zip(now, films, strict=True)])
        for now in zip(*shown, strict=True)
    ]


def write_film(path: Path, films: Sequence[tuple[Sequence[float], Sequence[Picture]]]) -> None:
    """Write films side by side as one file of at most `MAX_BYTES`, if few enough pictures make it so.

    Raises:
        OutputError: the disk does not take it.
    """
    from mpgrasp.recording.film_files import write_animation

    try:
        with replacing(path) as file:
            for rate in _RATES:
                pictures = side_by_side(films, rate)
                shown = np.full(len(pictures), 1 / rate)
                shown[-1] = _LAST
                write_animation(file, pictures, shown)
                if file.stat().st_size <= MAX_BYTES:
                    break
    except OSError as error:
        raise OutputError(f"a film cannot be written: {error}", got=str(path)) from error


def draw(ways: dict[str, Way]) -> Figure:
    """Both ways seen from above, and the smallest singular value against time."""
    from matplotlib.collections import LineCollection
    from matplotlib.colors import LogNorm

    picture, panels = figure(len(ways) + 1, width=4.6, height=4.8)
    norm = LogNorm(0.01, 0.2, clip=True)
    points = np.vstack([np.array(way.camera) for way in ways.values()])
    low, high = points.min(axis=0) - 0.06, points.max(axis=0) + 0.06
    for axes, (name, way) in zip(panels, ways.items(), strict=False):
        at = np.array(way.camera)
        values = np.clip(np.array(way.singular_values), norm.vmin, norm.vmax)
        lines = LineCollection(
            np.stack([at[:-1], at[1:]], axis=1).tolist(), cmap="turbo_r", norm=norm, linewidths=4
        )
        lines.set_array(values[1:])
        axes.add_collection(lines)
        axes.plot(*at[0], "o", color="black", markersize=8, label="start")
        worst = int(np.argmin(way.singular_values))
        axes.scatter(
            at[worst, 0], at[worst, 1], c=[values[worst]], cmap="turbo_r", norm=norm, s=170, marker="X",
            edgecolors="black", zorder=3, label="smallest value",
        )  # fmt: skip
        if way.stick is not None:
            axes.plot(*way.stick, "s", color="#888888", markersize=9, label="stick")
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal", xlabel="x [m]")
        axes.set_title(f"{name}: {way.event.split(':')[0]}")
    panels[0].set_ylabel("y [m], camera from above")
    panels[len(ways) - 1].legend(loc="lower right")
    label = "smallest singular value (0.01 and less: darkest red)"
    picture.colorbar(lines, ax=panels[: len(ways)], label=label, location="bottom", aspect=50)
    _against_time(panels[-1], ways)
    return picture


def _against_time(axes: Axes, ways: dict[str, Way]) -> None:
    for k, (name, way) in enumerate(ways.items()):
        axes.semilogy(way.times, way.singular_values, color=style(k)["color"], label=name, linewidth=2)
        axes.plot(way.times[-1], way.singular_values[-1], "X", color=style(k)["color"], markersize=9)
    axes.axhline(WARNING, color="black", linestyle=":", label=f"warning at {WARNING:g}")
    axes.set(xlabel="time [s]", title="smallest singular value")
    axes.legend()


def _study(command: Sequence[str]) -> None:
    parser = Parser(description=__doc__)
    add = parser.add_argument
    add(
        "--episode",
        metavar="K",
        type=command_line.EPISODE,
        default=EPISODE,
        help=f"of {SUITE} (default: %(default)s)",
    )
    add("--seed", metavar="S", type=command_line.SEED, default=0, help="0, 1, 2, ... (default: 0)")
    add("--detector", metavar="D", default="dhrnet", help="default: %(default)s")
    add("--out", metavar="STEM", type=Path, default=OUT, help="files without ending (default: docs/singular)")
    options = parser.parse_args(command)
    not_negative("episode", options.episode)
    not_negative("seed", options.seed)
    if options.out.suffix:
        raise ConfigError("a stem with an ending", got=str(options.out), allowed=str(options.out.stem))
    from mpgrasp import make_controller, run_episode
    from mpgrasp.plugins import load_detector
    from mpgrasp.recording.film import FilmRecorder
    from mpgrasp.recording.recorder import TeeRecorder
    from mpgrasp.suite import episode_seed, load_suite

    suite, detector = load_suite(SUITE), load_detector(options.detector)
    prepare(options.out.parent)
    ways, films = {name: Way() for name in CONTROLLERS}, []
    for name, way in ways.items():
        film = FilmRecorder()
        result = run_episode(
            suite.scene_config(options.episode),
            episode_seed(suite.name, options.seed, options.episode),
            detector=detector,
            controller=make_controller(name),
            config=suite.episode_config(),
            recorder=TeeRecorder(way, film),
        )
        films.append((film.times, [titled(picture[:, :_CROP], name) for picture in film.pictures]))
        print(f"{name}: {way.event}, smallest singular value {result.min_singular_value:.3f}")
    write_film(options.out.with_suffix(".webp"), films)
    try:
        draw(ways).savefig(options.out.with_suffix(".png"), metadata={"Software": None})
    except OSError as error:
        raise OutputError(f"the picture cannot be written: {error}", got=str(options.out)) from error


def main(command: Sequence[str] | None = None) -> int:
    """Run the command line (`sys.argv` if not given) and return the exit code; 2 for unusable input."""
    return run_command(_study, command)


if __name__ == "__main__":
    sys.exit(main())
