"""Making a training set: shards written by worker processes, then the card and the sheet about them."""

from __future__ import annotations

import multiprocessing
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

import cv2
import numpy as np

from mpgrasp.camera.rasteriser import require_gl
from mpgrasp.exceptions import CameraError, ConfigError, MpgraspError
from mpgrasp.processes import born_deaf, end_by_interrupts
from mpgrasp.training.data import shards
from mpgrasp.training.data.data_card import write_data_card
from mpgrasp.training.data.generate_config import GenerateConfig
from mpgrasp.training.data.sheet import write_sheet
from mpgrasp.training.data.views import make_views

Job = tuple[GenerateConfig, range, Path]
"""The scenes of a shard, and where it goes."""


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
    write_data_card(config, paths, out / "README.md")
    write_sheet(paths[0], out / "sheet.png")
    return paths


def _require_colour() -> None:
    try:
        require_gl()
    except CameraError as error:
        raise CameraError("no colour without OpenGL", got=str(error), allowed="--no-colour") from None


def _written_by_workers(jobs: Sequence[Job], workers: int) -> Iterator[None]:
    """Yield whenever a shard is written.

    Raises:
        MpgraspError: a worker process was killed.
    """
    # spawned, not forked: an OpenGL context does not survive a fork
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(min(workers, len(jobs)), spawn, _start_worker) as pool:
        try:
            with born_deaf():
                written_shards = [pool.submit(_write_shard, job) for job in jobs]
            for written in as_completed(written_shards):
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
    end_by_interrupts()


def _write_shard(job: Job) -> None:
    config, indices, path = job
    scenes = [make_views(config, index) for index in indices]
    shards.write_shard(path, {name: np.concatenate([s[name] for s in scenes]) for name in scenes[0]})
