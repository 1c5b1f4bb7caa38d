"""`--objects`: puts meshes in the place of a suite's own objects, and says which and why not.

Every mesh that is not in the cache is cut up and examined in a process of its own, so that one on which a
library crashes or never ends is reported like any other that cannot be used.
"""

from __future__ import annotations

import multiprocessing
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from multiprocessing.connection import Connection, wait

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from mpgrasp.bench.meshes.check import MeshVerdict, examine, is_cached
from mpgrasp.bench.meshes.files import ObjectFile, find_objects, label
from mpgrasp.bench.report.terminal_tables import wide_console
from mpgrasp.bench.results.provenance import sha256
from mpgrasp.exceptions import ConfigError
from mpgrasp.names import printable
from mpgrasp.processes import born_deaf, die_with_parent, ignore_interrupts
from mpgrasp.scene.config import SceneConfig
from mpgrasp.scene.objects.from_mesh import require_packages
from mpgrasp.scene.objects.model import check_density
from mpgrasp.suite import Suite

TIME_LIMIT = 900.0
"""Wall-clock time that one mesh may take [s]; a usual one takes 5 to 10 s."""

_context = multiprocessing.get_context("spawn")


def take_objects(
    suite: Suite,
    words: Sequence[str],
    *,
    density: float,
    workers: int,
    scale: float = 1.0,
    quiet: bool = False,
) -> tuple[Suite, tuple[MeshVerdict, ...]]:
    """The suite with meshes in the place of its objects, one per turn, and the verdict on every mesh.

    Args:
        suite: of one object at a time.
        words: files, folders and `ycb`.
        density: [kg/m^3]
        workers: number of processes; 0 works in this one.
        scale: unit of the numbers in the files [m].
        quiet: no progress.

    Raises:
        ConfigError: a suite that has no use for them, files that are not there, or nothing usable in them.
    """
    check_density(density)
    scene = _shared_scene(suite)
    files = find_objects(words, scale)
    require_packages()
    verdicts = _examine_all(files, scene, density, workers, quiet)
    models = [verdict.model for verdict in verdicts if verdict.model is not None]
    if not models:
        raise ConfigError(
            "none of the objects can be used",
            allowed="; ".join(f"not {verdict.name} ({verdict.reason})" for verdict in verdicts),
        )
    what = label(words)
    taken = replace(
        suite,
        name=f"{suite.name}-{what}",  # its worlds are others, and so are their seeds
        title=f"{suite.title}, with {len(models)} {'YCB scans' if what == 'ycb' else 'meshes'}",
        scenes=tuple(replace(scene, objects=(model,)) for model in models),
    )
    return taken, verdicts


def print_verdicts(verdicts: Sequence[MeshVerdict], console: Console | None = None) -> None:
    """Print which meshes are used and, of the others, why not."""
    table = Table(box=SIMPLE_HEAD, padding=(0, 0), collapse_padding=True, header_style="bold")
    table.add_column("object", overflow="fold")
    table.add_column("used", no_wrap=True)
    for heading in ("edges mm", "mass g", "pieces", "best grasp by pose"):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("reason", overflow="fold")
    for verdict in verdicts:
        model, columns = verdict.model, ["-", "-", "-"]
        if model is not None:
            edges = " x ".join(f"{1000 * edge:.0f}" for edge in model.size)
            columns = [edges, f"{1000 * model.mass:.0f}", str(len(model.parts))]
        table.add_row(
            escape(verdict.name),
            "yes" if verdict.accepted else "no",
            *columns,
            _spread([quality or 0.0 for quality in verdict.qualities]),
            escape(printable(verdict.reason or "")),
        )
    used = sum(verdict.accepted for verdict in verdicts)
    wide_console(console).print(f"Objects: {used} of {len(verdicts)} are used", table, sep="\n")


def _spread(qualities: Sequence[float]) -> str:
    return f"{min(qualities):.2f}-{max(qualities):.2f}" if qualities else "-"


def _shared_scene(suite: Suite) -> SceneConfig:
    """The scene of a suite's turns, which may differ in their one object."""
    scene = suite.scenes[0]
    one_each = all(len(s.objects) == 1 and s.placing == "scatter" for s in suite.scenes)
    alike = all(replace(s, objects=scene.objects) == scene for s in suite.scenes)
    if len(suite.scenes) < 2 or not (one_each and alike):
        raise ConfigError(
            "--objects with a suite that is made for its own objects",
            got=suite.name,
            allowed="single, unseen, or a declaration whose [[turns]] differ in their one object alone",
        )
    return scene


def _examine_all(
    files: Sequence[ObjectFile], scene: SceneConfig, density: float, workers: int, quiet: bool
) -> tuple[MeshVerdict, ...]:
    """A verdict on every file, in order."""
    scene = replace(scene, objects=("it",))  # what it has now may be large, and goes to every process
    verdicts: dict[ObjectFile, MeshVerdict] = {}
    fresh = [file for file in files if not is_cached(file, scene, density)]
    with _Progress(len(fresh), quiet=quiet) as progress:

        def take(file: ObjectFile, verdict: MeshVerdict) -> None:
            verdicts[file] = verdict
            progress.add(verdict)

        if workers:
            _in_processes(fresh, (scene, density), workers, take)
        else:
            for file in fresh:
                take(file, examine(file, scene, density))
    for file in files:
        if file not in verdicts:
            verdicts[file] = examine(file, scene, density)
    return tuple(verdicts[file] for file in files)


def _in_processes(
    files: Sequence[ObjectFile],
    arguments: tuple[SceneConfig, float],
    workers: int,
    sink: Callable[[ObjectFile, MeshVerdict], object],
) -> None:
    """Examine each file in a process of its own, some at a time; verdicts come as they are reached."""
    todo = list(reversed(files))
    running: dict[Connection, _Job] = {}
    try:
        while todo or running:
            while todo and len(running) < workers:
                job = _Job(todo.pop(), arguments)
                running[job.connection] = job
            soonest = min(job.deadline for job in running.values())
            ready = wait(list(running), max(0.0, soonest - time.monotonic()))
            for connection, job in list(running.items()):
                if connection in ready or job.deadline <= time.monotonic():
                    sink(job.file, job.verdict())
                    del running[connection]
    finally:
        for job in running.values():
            job.end()


class _Job:
    """One file and the process that examines it."""

    def __init__(self, file: ObjectFile, arguments: tuple[SceneConfig, float]) -> None:
        self.file = file
        self.connection, theirs = _context.Pipe(duplex=False)
        self._process = _context.Process(target=_work, args=(theirs, file, *arguments), daemon=True)
        with born_deaf():
            self._process.start()
        theirs.close()  # or the end of the process would not be the end of the pipe
        self.deadline = time.monotonic() + TIME_LIMIT

    def verdict(self) -> MeshVerdict:
        """The verdict that the process reached, or one that says how it ended."""
        reason = f"cutting it up takes more than {TIME_LIMIT:g} s"
        try:
            if self.connection.poll():
                found: MeshVerdict = self.connection.recv()
                return found
        except (EOFError, OSError):
            self._process.join()
            reason = f"its process crashed with exit code {self._process.exitcode}"
        finally:
            self.end()
        return MeshVerdict(
            name=self.file.name, path=str(self.file.path), sha256=sha256(self.file.path), reason=reason
        )

    def end(self) -> None:
        self._process.kill()
        self._process.join()
        self.connection.close()


def _work(connection: Connection, file: ObjectFile, scene: SceneConfig, density: float) -> None:
    ignore_interrupts()
    threading.Thread(target=die_with_parent, daemon=True).start()
    connection.send(examine(file, scene, density))


class _Progress:
    """One bar on a terminal, one line per mesh elsewhere, nothing if quiet or all is cached."""

    def __init__(self, total: int, *, quiet: bool) -> None:
        self._total, self._done = total, 0
        self._console = Console(stderr=True)
        self._shown = total > 0 and not quiet
        self._bar: Progress | None = None
        if self._shown and self._console.is_terminal:
            columns = (BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
            self._bar = Progress(TextColumn("{task.description}"), *columns, console=self._console)
            self._task = self._bar.add_task("objects", total=total)

    def __enter__(self) -> _Progress:
        if self._bar:
            self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar:
            self._bar.stop()

    def add(self, verdict: MeshVerdict) -> None:
        self._done += 1
        if self._bar:
            self._bar.update(self._task, completed=self._done, description=f"objects: {verdict.name}")
        elif self._shown:
            text = f"[{self._done}/{self._total}] {verdict.name}: {verdict.reason or 'can be used'}"
            self._console.out(text, highlight=False)
