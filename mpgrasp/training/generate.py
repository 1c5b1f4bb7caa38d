"""Training data: random scenes, their dense grasps put to the test, and noisy views from anywhere above.

`python -m mpgrasp.training generate --scenes 2000 --out DIR` writes shards `shard_00000.npz` of
`SHARD_SCENES` scenes each, `meta.json` and `README.md` that describe them, and `sheet.png` to look at. A
scene is a function of the seed and its index alone, so neither the number of workers nor an interruption
changes a byte; finished shards are kept.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
from pathlib import Path

import cv2
import numpy as np

from mpgrasp.camera import BACKENDS
from mpgrasp.exceptions import CameraError, ConfigError
from mpgrasp.training import shards
from mpgrasp.training.generate_config import GenerateConfig
from mpgrasp.training.views import make_scene, make_views

__all__ = ["GenerateConfig", "add_arguments", "generate", "main", "make_scene", "make_views"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of `python -m mpgrasp.training generate`."""
    parser.add_argument("--scenes", type=int, default=1000, help="number of scenes (default: %(default)s)")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="where the shards go")
    parser.add_argument(
        "--workers", type=int, default=os.cpu_count() or 1, help="processes (default: all cores)"
    )
    parser.add_argument("--seed", type=int, default=1, help="of the whole set (default: %(default)s)")
    parser.add_argument("--views", type=int, default=4, help="images of each scene (default: %(default)s)")
    parser.add_argument(
        "--camera", choices=BACKENDS, default="auto", help="camera backend (default: %(default)s)"
    )
    parser.add_argument("--no-colour", action="store_true", help="depth alone, which takes no OpenGL")


def main(args: argparse.Namespace) -> int:
    """Run the command; returns the exit code."""
    config = GenerateConfig(
        scenes=args.scenes, seed=args.seed, views=args.views, camera=args.camera, colour=not args.no_colour
    )
    generate(config, args.out, workers=args.workers)
    print((args.out / "README.md").read_text(encoding="utf-8"))
    return 0


def generate(config: GenerateConfig, out: Path, *, workers: int = 1, progress: bool = True) -> list[Path]:
    """Write the data set; shards that are there already are kept.

    Raises:
        ConfigError: fewer than one worker, or `out` holds data of another configuration.
        CameraError: colour is wanted, and there is no OpenGL to draw it.
        OutputError: `out` cannot be written.
    """
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeElapsedColumn, TimeRemainingColumn

    if workers < 1:
        raise ConfigError("unusable number of workers", got=workers, allowed="1 or more")
    if config.colour:
        _require_colour()
    shards.prepare(config, out)
    starts = range(0, config.scenes, shards.SHARD_SCENES)
    jobs = [
        (config, range(s, min(s + shards.SHARD_SCENES, config.scenes)), shards.shard_path(out, s))
        for s in starts
    ]
    waiting = [job for job in jobs if not job[2].is_file()]
    columns = (
        "generate",
        BarColumn(),
        MofNCompleteColumn(),
        "shards",
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, disable=not progress) as bar:
        task = bar.add_task("generate", total=len(jobs), completed=len(jobs) - len(waiting))
        if workers == 1 or len(waiting) < 2:
            for job in waiting:
                _write_shard(job)
                bar.advance(task)
        else:
            # spawned, not forked: an OpenGL context does not survive a fork
            with multiprocessing.get_context("spawn").Pool(min(workers, len(waiting)), _one_thread) as pool:
                for _ in pool.imap_unordered(_write_shard, waiting):
                    bar.advance(task)
    paths = [job[2] for job in jobs]
    from mpgrasp.training.data_card import write_data_card
    from mpgrasp.training.sheet import write_sheet

    write_data_card(config, paths, out / "README.md")
    write_sheet(paths[0], out / "sheet.png")
    return paths


def _require_colour() -> None:
    from mpgrasp.rasteriser import require_gl

    try:
        require_gl()
    except CameraError as error:
        raise CameraError("no colour without OpenGL", got=str(error), allowed="--no-colour") from None


def _one_thread() -> None:
    cv2.setNumThreads(1)  # the workers fill the cores


def _write_shard(job: tuple[GenerateConfig, range, Path]) -> None:
    config, indices, path = job
    scenes = [make_views(config, index) for index in indices]
    shards.write_shard(path, {name: np.concatenate([s[name] for s in scenes]) for name in scenes[0]})
