"""A run that is killed by SIGKILL at random moments, and goes on until it is complete."""

from __future__ import annotations

import os
import random
import shutil
import signal
import subprocess
import time
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from refusals import BENCH
from whole_runs import Bench, different, fault_at_end, row_of

from mpgrasp.bench.results.reader import EPISODES, RUN

ORPHANS = 15.0
"""Wall-clock time within which the workers of a killed run have to end [s]."""
_SUMMARY = "summary.json"


@dataclass(frozen=True, kw_only=True)
class Killed:
    """A run that is killed again and again, at random moments, and goes on."""

    bench: Bench
    episodes: int
    seed: int = 0
    longest: float = 8.0
    """Longest time that a process is given before it is killed [s]."""

    @property
    def words(self) -> list[str]:
        """Command line of the run, without its folder."""
        return ["thin", "--detector", "oracle", "--controller", "open_loop", "--episodes", str(self.episodes)]

    @cached_property
    def whole(self) -> Path:
        """Folder of the same run, undisturbed."""
        out = self.bench.folder / "whole"
        shutil.rmtree(out, ignore_errors=True)
        return self.bench.play_whole([*self.words, "--out", str(out)], out)

    def kill(self, times: int) -> list[dict[str, object]]:
        """Kill so many processes; return a row for each. Runs that come to their end are compared."""
        rng = random.Random(self.seed)
        rows: list[dict[str, object]] = []
        run_number = 0
        while len(rows) < times:
            out = self.bench.folder / f"killed-{run_number}"
            shutil.rmtree(out, ignore_errors=True)
            run_number += 1
            strikes: list[dict[str, object]] = []
            while len(rows) + len(strikes) < times and not (out / _SUMMARY).is_file():
                struck = self._strike(out, rng.uniform(0, self.longest), len(rows) + len(strikes))
                strikes += [struck] if struck else []
            ended = self.bench.play(self._next(out))
            fault = fault_at_end(ended) or different(out, self.whole) or self._summaries(out)
            if strikes and not strikes[-1]["fault"]:
                strikes[-1]["fault"] = fault
            rows += strikes
        return rows

    def _next(self, out: Path) -> list[str]:
        return ["--resume", str(out)] if (out / RUN).is_file() else [*self.words, "--out", str(out)]

    def _summaries(self, out: Path) -> str:
        same = (out / _SUMMARY).read_bytes() == (self.whole / _SUMMARY).read_bytes()
        return "" if same else "another summary"

    def _strike(self, out: Path, after: float, number: int) -> dict[str, object] | None:
        """Begin the run, or go on with it, and kill it after a time [s]; None if it had ended by then."""
        before = _whole_lines(out)
        environment = {**os.environ, "MPGRASP_CACHE": str(self.bench.cache)}
        with (self.bench.folder / "said").open("wb") as said:
            process = subprocess.Popen(
                [*BENCH, *self._next(out), "--quiet"],
                env=environment,
                stdin=subprocess.DEVNULL,
                stdout=said,
                stderr=said,
                start_new_session=True,
            )
            clock = time.monotonic()
            try:
                process.wait(after)
            except subprocess.TimeoutExpired:
                process.kill()
            process.wait()
        if process.returncode != -signal.SIGKILL:
            return None
        fault = _left_alive(process.pid)
        lines = _whole_lines(out)
        if not fault and not set(before) <= set(lines):  # a run that ends puts them into its order
            fault = "lines that were written are gone"
        struck = f"after {after:.2f} s, at {len(lines)} of {self.episodes} episodes"
        return row_of("SIGKILL", f"{number}: {struck}", fault, time.monotonic() - clock)


def _whole_lines(out: Path) -> list[bytes]:
    file = out / EPISODES
    data = file.read_bytes() if file.is_file() else b""
    return data[: data.rfind(b"\n") + 1].splitlines()


def _left_alive(group: int) -> str:
    """Wait for what is left of a killed process's group; kill it, and say so, if it does not end."""
    deadline = time.monotonic() + ORPHANS
    while time.monotonic() < deadline:
        if not _alive(group):
            return ""
        time.sleep(0.05)
    os.killpg(group, signal.SIGKILL)
    return f"workers are still at work {ORPHANS:g} s after their parent"


def _alive(group: int) -> bool:
    """True if a process of the group does anything; a zombie does not."""
    listed = subprocess.run(["ps", "-A", "-o", "pgid=,stat="], capture_output=True, text=True, check=True)
    rows = (line.split() for line in listed.stdout.splitlines())
    return any(row[0] == str(group) and row[1][0] != "Z" for row in rows if len(row) > 1)
