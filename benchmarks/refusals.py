"""Processes that must end in a stated way: what is typed, and what has to come of it.

Every bad mesh, weight file, command line and plug-in of this folder is played here as its user would play it:
by the command line, in a process and a folder of its own.
"""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from bad_commands import BAD_COMMANDS, BadCommand
from bad_commands import prepare as prepare_commands
from bad_meshes import BAD_MESHES, BadMesh
from bad_plug_ins import BAD_PLUG_INS, BadPlugIn
from bad_weights import BAD_WEIGHTS, BadWeights

from mpgrasp.bench.playing.patience import ALIKE, FIRST
from mpgrasp.foreign_code import LIMIT_VARIABLE

LIMIT = 60.0
"""Wall-clock time after which a refusal counts as a hang [s]."""
BENCH = (sys.executable, "-m", "mpgrasp.bench")
_QUICK = ("--controller", "open_loop", "--episodes", "5", "--workers", "1", "--quiet", "--out", "run")
_LOAD_LIMIT = "5"
"""Seconds that a plug-in may take to load or to answer here; 120 by default."""


@dataclass(frozen=True, kw_only=True)
class Ended:
    """A process that has ended, or was ended."""

    code: int | None
    """Exit code; None if it was still at work after its limit."""
    out: str
    err: str
    seconds: float


@dataclass(frozen=True, kw_only=True)
class Trial:
    """One thing that a user does wrong."""

    kind: str
    name: str
    set_up: Callable[[Path], Sequence[str]]
    """Puts what is needed into an empty folder, and returns the words of the process."""
    said: str
    """Regular expression of what is said."""
    code: int = 2
    limit: float = LIMIT
    """Wall-clock time within which it must have ended [s]."""
    environment: Mapping[str, str] = field(default_factory=dict)
    one_line: bool = True
    """True if there must be one line on stderr and nothing else."""
    look: Callable[[Path, Ended], str] | None = None
    """Returns what is wrong with what is left in the folder, "" for nothing."""


def run(argv: Sequence[str], folder: Path, environment: Mapping[str, str], limit: float = LIMIT) -> Ended:
    """Run a process in a folder; what it has started is ended with it."""
    clock = time.monotonic()
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        process = subprocess.Popen(
            argv,
            cwd=folder,
            env={**os.environ, **environment},
            stdin=subprocess.DEVNULL,
            stdout=out,
            stderr=err,
            start_new_session=True,
        )
        code: int | None
        try:
            code = process.wait(limit)
        except subprocess.TimeoutExpired:
            code = None
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
        seconds = time.monotonic() - clock
        words = [(file.seek(0), file.read().decode("utf-8", "replace"))[1] for file in (out, err)]
    return Ended(code=code, out=words[0], err=words[1], seconds=seconds)


def fault_of(trial: Trial, ended: Ended) -> str:
    """Return what is wrong with the way in which a process has ended; "" if nothing is."""
    if ended.code is None:
        return f"still at work after {trial.limit:g} s"
    if "Traceback (most recent call last)" in ended.out + ended.err:
        return "a traceback"
    if ended.code != trial.code:
        return f"exit code {ended.code} in place of {trial.code}: {ended.err.strip()[-200:]}"
    if trial.one_line and (ended.err.count("\n") != 1 or ended.out):
        return f"{ended.err.count(chr(10))} lines on stderr and {len(ended.out)} characters on stdout"
    if not re.search(trial.said, ended.err + ended.out, re.DOTALL):
        return f"not said: {trial.said}; got {(ended.err or ended.out).strip()[-200:]}"
    return ""


def content(folder: Path) -> dict[str, tuple[int, int]]:
    """Size and time of change of every regular file below a folder."""
    return {
        str(path): (path.stat().st_size, path.stat().st_mtime_ns)
        for path in folder.rglob("*")
        if path.is_file() and not path.is_symlink() and "__pycache__" not in path.parts
    }


def play(trial: Trial, cache: Path) -> dict[str, object]:
    """Play a trial in a folder of its own; return its row: kind, name, fault and seconds.

    A refusal that says one line must leave the folder as it was.
    """
    with tempfile.TemporaryDirectory(prefix="mpgrasp-refusal-") as name:
        folder = Path(name)
        argv = list(trial.set_up(folder))
        before = content(folder)
        ended = run(argv, folder, {"MPGRASP_CACHE": str(cache), **trial.environment}, trial.limit)
        fault = fault_of(trial, ended)
        if not fault and trial.one_line and content(folder) != before:
            fault = f"left behind: {sorted(set(content(folder).items()) ^ set(before.items()))}"
        if not fault and trial.look is not None:
            fault = trial.look(folder, ended)
    return {"kind": trial.kind, "name": trial.name, "fault": fault, "seconds": round(ended.seconds, 2)}


def mesh_trial(name: str, bad: BadMesh) -> Trial:
    """A bad mesh as the only object of the suite `single`."""

    def set_up(folder: Path) -> list[str]:
        objects = ["single", "--objects", bad.write(folder).name, "--detector", "oracle"]
        return [*BENCH, *objects, *_QUICK]

    return Trial(kind="mesh", name=name, set_up=set_up, said=bad.said)


def weights_trial(name: str, bad: BadWeights) -> Trial:
    """A bad weight file in place of the weights that ship."""

    def set_up(folder: Path) -> list[str]:
        return [
            *BENCH,
            "thin",
            "--detector",
            bad.network,
            "--weights",
            bad.write(folder).name,
            *_QUICK,
        ]

    return Trial(kind="weights", name=name, set_up=set_up, said=bad.said)


def command_trial(name: str, bad: BadCommand) -> Trial:
    """A bad command line."""

    def set_up(folder: Path) -> list[str]:
        prepare_commands(folder)
        return bad.argv()

    said = re.escape(bad.said)
    return Trial(kind="command", name=name, set_up=set_up, said=said, environment=bad.environment)


def plug_in_trial(name: str, bad: BadPlugIn) -> Trial:
    """A bad plug-in: refused when it is loaded, an error row when it plays, or found out by the kit."""

    def set_up(folder: Path) -> list[str]:
        given_as = bad.write(folder, f"bad_{name.replace('-', '_')}")
        if bad.by == "kit":
            return [sys.executable, "-m", "mpgrasp.check", bad.kind, given_as, "--json"]
        if bad.kind == "detector":
            return [*BENCH, "thin", "--detector", given_as, *_QUICK]
        plays = [word if word != "open_loop" else given_as for word in _QUICK]
        return [*BENCH, "thin", "--detector", "oracle", *plays]

    return Trial(
        kind=f"plug-in, found out by {bad.by}",
        name=name,
        set_up=set_up,
        said="" if bad.by == "kit" else bad.said,
        code=2 if bad.by == "loader" else 1,
        environment={LIMIT_VARIABLE: _LOAD_LIMIT},
        one_line=False,
        look={"guard": ended_by_errors, "kit": found_out(bad.said)}.get(bad.by),
    )


def ended_by_errors(folder: Path, _: Ended) -> str:
    """Return what is wrong with a run that a plug-in's errors should have ended, with a row for each."""
    lines = (folder / "run" / "episodes.jsonl").read_text(encoding="utf-8").splitlines()
    errors = sum(json.loads(line)["outcome"] == "error" for line in lines)
    # one more may have been in hand when the run ended
    return "" if ALIKE <= errors <= FIRST else f"{errors} error rows of {len(lines)} in place of {ALIKE}"


def found_out(said: str) -> Callable[[Path, Ended], str]:
    """A look at the verdict of the kit: a broken law or advice has to say it."""

    def look(_: Path, ended: Ended) -> str:
        findings = json.loads(ended.out)["findings"]
        broken = [f"{row['check']}: {row['reason']}" for row in findings if row["state"] == "failed"]
        return "" if any(re.search(said, line) for line in broken) else f"not said: {said}; got {broken}"

    return look


def trials() -> Iterator[Trial]:
    """All of them, kind after kind."""
    yield from (mesh_trial(*item) for item in BAD_MESHES.items())
    yield from (weights_trial(*item) for item in BAD_WEIGHTS.items())
    yield from (command_trial(*item) for item in BAD_COMMANDS.items())
    yield from (plug_in_trial(*item) for item in BAD_PLUG_INS.items())
