"""Training data: random scenes, their dense grasps put to the test, and noisy views from anywhere above.

`python -m mpgrasp.training generate --scenes 2000 --out DIR` writes shards `shard_00000.npz` of
`SHARD_SCENES` scenes each, `meta.json` and `README.md` that describe them, and `sheet.png` to look at. A
scene is a function of the seed, its index and the format (`shards.FORMAT`) alone, so neither the number of
workers nor an interruption changes a byte; finished shards are kept.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import signal
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

import cv2
import numpy as np

from mpgrasp.camera.wrist_camera import BACKENDS
from mpgrasp.exceptions import CameraError, ConfigError, MpgraspError
from mpgrasp.training.data import shards
from mpgrasp.training.data.generate_config import GenerateConfig
from mpgrasp.training.data.views import make_scene, make_views

__all__ = ["GenerateConfig", "add_arguments", "generate", "main", "make_scene", "make_views"]

Job = tuple[GenerateConfig, range, Path]
"""The scenes of a shard, and where it goes."""


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
    """Write the data set; shards that are there already, with all of their scenes, are kept.

    Raises:
        ConfigError: fewer than one worker, or `out` holds data of another configuration, or more scenes.
        CameraError: colour is wanted, and there is no OpenGL to draw it.
        OutputError: `out` cannot be written.
        MpgraspError: a worker process was killed.
    """
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeElapsedColumn, TimeRemainingColumn

    if workers < 1:
        raise ConfigError("unusable number of workers", got=workers, allowed="1 or more")
    if config.colour:
        _require_colour()
    shards.prepare(config, out)
    paths = list(shards.planned(config, out))
    waiting = [(config, scenes, path) for path, scenes in shards.unfinished(config, out).items()]
    columns = (
        "generate",
        BarColumn(),
        MofNCompleteColumn(),
        "shards",
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, disable=not progress) as bar:
        task = bar.add_task("generate", total=len(paths), completed=len(paths) - len(waiting))
        alone = workers == 1 or len(waiting) < 2
        for _ in map(_write_shard, waiting) if alone else _written_by_workers(waiting, workers):
            bar.advance(task)
    from mpgrasp.training.data.data_card import write_data_card
    from mpgrasp.training.data.sheet import write_sheet

    write_data_card(config, paths, out / "README.md")
    write_sheet(paths[0], out / "sheet.png")
    return paths


def _require_colour() -> None:
    from mpgrasp.camera.rasteriser import require_gl

    try:
        require_gl()
    except CameraError as error:
        raise CameraError("no colour without OpenGL", got=str(error), allowed="--no-colour") from None


def _written_by_workers(jobs: Sequence[Job], workers: int) -> Iterator[None]:
    """Yields whenever a shard is written.

    Raises:
        MpgraspError: a worker process was killed.
    """
    # spawned, not forked: an OpenGL context does not survive a fork
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(min(workers, len(jobs)), spawn, _start_worker) as pool:
        try:
            for written in as_completed([pool.submit(_write_shard, job) for job in jobs]):
                yield written.result()
        except BrokenProcessPool:
            raise MpgraspError(
                "a worker process was killed",
                got=f"{workers} workers",
                allowed="memory for all of them; finished shards are kept, and the same command goes on",
            ) from None
        finally:
            pool.shutdown(cancel_futures=True)


def _start_worker() -> None:
    cv2.setNumThreads(1)  # the workers fill the cores
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # Ctrl-C ends them without a traceback each


def _write_shard(job: Job) -> None:
    config, indices, path = job
    scenes = [make_views(config, index) for index in indices]
    shards.write_shard(path, {name: np.concatenate([s[name] for s in scenes]) for name in scenes[0]})
