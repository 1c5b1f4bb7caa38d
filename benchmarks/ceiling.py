"""Can anything grasp it? Random grasps by the hundred, tried in the true scenes of a suite.

    python benchmarks/ceiling.py single --episodes 59,69,99

The proof behind the oracle's failures. In each world a free-flying hand tries grasps that no detector chose:
a surface cell of an object, closing direction, opening and height over the surface from a scrambled Sobol
sequence, which covers all of them evenly. One that lifts shows that the world can be done; where none of n
does, less than 3/n of all grasps lift (95 %). The arm is left out: what it cannot reach counts as reachable.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.stats import qmc
from study import (
    RESULTS,
    Parser,
    about,
    figure,
    not_negative,
    positive,
    prepare,
    publish,
    rate,
    run_command,
    track,
)

from mpgrasp.command_line import COUNT, SEED
from mpgrasp.exceptions import ConfigError
from mpgrasp.grasp import Grasp
from mpgrasp.height_map import HeightMap
from mpgrasp.motion.lift_trial import LiftRig
from mpgrasp.robot import hand
from mpgrasp.scene.scene import build_scene
from mpgrasp.settings.assignment import parse_assignments
from mpgrasp.suite import Suite, episode_seed, load_suite

if TYPE_CHECKING:
    from matplotlib.figure import Figure

OUT = RESULTS / "ceiling"
HIGHEST = 0.045
"""Greatest height of a grasp over the surface [m]; the palm's depth then keeps the tips above it."""


@dataclass(frozen=True, kw_only=True)
class Search:
    """Worlds of a suite, and the number of grasps that are tried in each."""

    suite: str
    settings: tuple[str, ...] = ()
    """Changes to the suite, as the benchmark's --set takes them."""
    episodes: tuple[int, ...] = ()
    """Numbers of the episodes whose worlds are searched, from 0."""
    seed: int = 0
    """Seed of the run that the episodes belong to."""
    grasps: int = 512
    """Grasps that are tried in each world; a power of two covers the space evenly."""
    until_lifted: bool = True
    """True if a world is left at the first grasp that lifts, False if all are tried."""

    def __post_init__(self) -> None:
        not_negative("seed", self.seed)
        positive("number of grasps", self.grasps)
        if not self.episodes or min(self.episodes) < 0:
            raise ConfigError("unusable episodes", got=self.episodes, allowed="one or more, from 0")


@dataclass(frozen=True, kw_only=True)
class Found:
    """Result of the search in one world."""

    episode: int
    scene_seed: int
    objects: str
    """Names of what is on the table."""
    tried: int
    """Grasps that were tried."""
    lifted: int
    """Those that lifted an object."""
    first: int | None = None
    """Number of the first one that lifted, from 1; None where none did."""


def run(search: Search) -> list[Found]:
    """Return what the search found in each world."""
    changes = parse_assignments(search.settings)
    suite = load_suite(search.suite).with_settings(changes, "--set {}")
    return [look(suite, search, k) for k in track(search.episodes, "worlds", len(search.episodes))]


def look(suite: Suite, search: Search, episode: int) -> Found:
    """Return what the search found in the world of an episode."""
    seed = episode_seed(suite.name, search.seed, episode)
    scene = build_scene(suite.scene_config(episode), seed, robot=False)
    rig, first, lifted, tried = LiftRig(scene), None, 0, 0
    for grasp in cover(scene.height_map(), search.grasps, seed):
        tried += 1
        if rig.attempt(grasp).lifted is not None:
            lifted, first = lifted + 1, first or tried
            if search.until_lifted:
                break
    names = ", ".join(scene.objects)
    return Found(episode=episode, scene_seed=seed, objects=names, tried=tried, lifted=lifted, first=first)


def cover(height_map: HeightMap, n: int, seed: int) -> Iterator[Grasp]:
    """Yield n grasps that cover an object's cells, directions, openings and heights evenly."""
    rows, cols = np.nonzero(height_map.label)
    points = qmc.Sobol(4, rng=np.random.default_rng(seed)).random(n) if len(rows) else ()
    for cell, turn, opening, rise in points:
        row, col = (int(axis[int(cell * len(rows))]) for axis in (rows, cols))
        z = float(height_map.height[row, col]) + rise * HIGHEST
        yield Grasp(
            position=np.array(
                [height_map.x0 + col * height_map.cell, height_map.y0 + row * height_map.cell, z]
            ),
            angle=np.pi * (turn - 0.5),
            width=opening * hand.GRIPPER_MAX_WIDTH,
            quality=1.0,
        )


def draw(found: Sequence[Found], grasps: int) -> Figure:
    """Share of the worlds in which some grasp has lifted, against the number of grasps tried."""
    picture, (axes,) = figure()
    firsts = sorted(world.first for world in found if world.first is not None)
    steps = 100 * np.arange(1, len(firsts) + 1) / len(found)
    axes.step([1, *firsts, grasps], [0, *steps, steps[-1] if firsts else 0], where="post", color="#0072b2")
    axes.set_xscale("log", base=2)
    axes.set(
        xlabel="random grasps tried in a world",
        ylabel=f"worlds lifted in [%]; n = {len(found)}",
        ylim=(-2, 102),
    )
    return picture


def table(found: Sequence[Found]) -> str:
    """A line for each world, and the share in which anything lifts."""
    lines = [f"{'episode':>8} {'tried':>6} {'lifted':>6} {'first':>6}  objects"]
    lines += [f"{w.episode:>8} {w.tried:>6} {w.lifted:>6} {w.first or '-':>6}  {w.objects}" for w in found]
    lines.append(f"Something lifts in {sum(w.lifted > 0 for w in found)} of {len(found)} worlds.")
    return "\n".join(lines)


def _study(command: Sequence[str]) -> None:
    parser = Parser(description=__doc__)
    add = parser.add_argument
    add("suite", metavar="SUITE", help="a suite, or a path to a declaration.toml")
    add(
        "--set",
        dest="settings",
        metavar="GROUP.KEY=VALUE",
        action="append",
        default=[],
        help="as the benchmark",
    )
    add("--episodes", metavar="K[,K]", required=True, help="numbers of episodes from 0, or FIRST:END")
    add("--seed", metavar="S", type=SEED, default=0, help="of the run they belong to (default: 0)")
    add("--grasps", metavar="N", type=COUNT, default=512, help="in each world (default: %(default)s)")
    add("--all", action="store_true", help="go on after the first that lifts")
    add("--out", metavar="DIR", type=Path, default=OUT, help="default: benchmarks/results/ceiling")
    options = parser.parse_args(command)
    search = Search(
        suite=options.suite, settings=tuple(options.settings), episodes=_numbers(options.episodes),
        seed=options.seed, grasps=options.grasps, until_lifted=not options.all,
    )  # fmt: skip
    prepare(options.out)
    found = run(search)
    rows: list[Mapping[str, Any]] = [asdict(world) for world in found]
    results = {"liftable": rate(sum(world.lifted > 0 for world in found), len(found)), "worlds": rows}
    told = about("ceiling", command, search=search)
    publish(options.out, "ceiling", told, results, rows, draw(found, search.grasps))
    print(f"{table(found)}\nResults: {options.out}")


def _numbers(text: str) -> tuple[int, ...]:
    """Episodes from "3,7" or "0:40"."""
    try:
        if ":" in text:
            return tuple(range(*(int(part) for part in text.split(":"))))
        return tuple(int(part) for part in text.split(","))
    except (TypeError, ValueError) as error:
        raise ConfigError("unusable episodes", got=text, allowed="such as 3,7 or 0:40") from error


def main(command: Sequence[str] | None = None) -> int:
    """Run the command line (`sys.argv` if not given) and return the exit code; 2 for unusable input."""
    return run_command(_study, command)


if __name__ == "__main__":
    sys.exit(main())
