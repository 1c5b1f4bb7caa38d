"""Training data: random scenes, their dense grasps put to the test, and noisy views from anywhere above.

`python -m mpgrasp.training generate --scenes 2000 --out DIR` writes shards `shard_00000.npz` of
`SHARD_SCENES` scenes each, `meta.json` and `README.md` that describe them, and `sheet.png` to look at. A
scene is a function of the seed, its index and the version of mpgrasp alone, so neither the number of workers
nor an interruption changes a byte; finished shards are kept. `shards.FORMAT` counts the versions that drop
other objects; between two of one format, physics may let a few scenes settle otherwise.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from mpgrasp.camera.backends import BACKENDS
from mpgrasp.command_line import SEED, WORKERS, whole
from mpgrasp.training.data.generate_config import GenerateConfig


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `python -m mpgrasp.training generate`."""
    parser.add_argument(
        "--scenes", type=whole(1, 10**7), default=1000, help="number of scenes (default: %(default)s)"
    )
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="where the shards go")
    parser.add_argument(
        "--workers", type=WORKERS, default=os.cpu_count() or 1, help="processes (default: all cores)"
    )
    parser.add_argument("--seed", type=SEED, default=1, help="of the whole set (default: %(default)s)")
    parser.add_argument(
        "--views", type=whole(1, 100), default=4, help="images of each scene (default: %(default)s)"
    )
    parser.add_argument(
        "--camera", choices=BACKENDS, default="auto", help="camera backend (default: %(default)s)"
    )
    parser.add_argument("--no-colour", action="store_true", help="depth alone, which takes no OpenGL")


def main(args: argparse.Namespace) -> int:
    """Run the command and return its exit code."""
    config = GenerateConfig(
        scenes=args.scenes, seed=args.seed, views=args.views, camera=args.camera, colour=not args.no_colour
    )
    from mpgrasp.training.data.generation import generate

    generate(config, args.out, workers=args.workers)
    print((args.out / "README.md").read_text(encoding="utf-8"))
    return 0
