"""`python -m mpgrasp.scene SUITE --seed S --out FILE`: the scene of a benchmark episode as a file."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from mpgrasp.command_line import EPISODE, SEED, Parser, run_command


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line: write the scene of one benchmark episode; returns the exit code."""
    return run_command(lambda: _run(arguments))


def _run(arguments: Sequence[str] | None) -> int:
    parser = Parser(
        prog="python -m mpgrasp.scene",
        description="Write the scene of a benchmark episode as XML for the plain MuJoCo viewer.",
    )
    parser.add_argument("suite", metavar="SUITE", help="name of a suite in benchmarks/")
    parser.add_argument("--seed", type=SEED, default=0, help="seed of the benchmark run (default 0)")
    parser.add_argument(
        "--episode", type=EPISODE, default=0, help="number of the episode in that run (default 0)"
    )
    parser.add_argument(
        "--out", type=Path, default=Path("scene.xml"), help="file to write (default scene.xml)"
    )
    options = parser.parse_args(arguments)
    # after the arguments: help needs no MuJoCo
    from mpgrasp.scene.export import save_scene
    from mpgrasp.scene.scene import build_scene
    from mpgrasp.suite import episode_seed, load_suite

    suite = load_suite(options.suite)
    seed = episode_seed(suite.name, options.seed, options.episode)
    scene = build_scene(suite.scene_config(options.episode), seed)
    files = save_scene(scene, options.out)
    print(f"{options.out}: {', '.join(scene.objects)}; {len(files) - 1} meshes in {options.out.stem}_assets")
    return 0


if __name__ == "__main__":
    sys.exit(main())
