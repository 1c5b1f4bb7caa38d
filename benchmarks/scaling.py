"""How many episodes a minute do workers play, of each engine, and what memory do they take?

    python benchmarks/scaling.py --workers 1,2 --engines processes,ray

Each setting plays a short and a long run of the same suite, in turns, --rounds times. What the long one has
more takes the difference of their times: that is the rate. What is left of the short one is the start and
the end of a run: imports, workers, networks, report. All runs must have the same final states, bit for bit.
"""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from study import RESULTS, Parser, about, figure, prepare, publish, run_command, style, track

from mpgrasp.bench.playing.crew import ENGINES
from mpgrasp.command_line import COUNT, SEED
from mpgrasp.exceptions import ConfigError, OutputError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

OUT = RESULTS / "scaling"
_PERIOD = 0.2  # [s] between two looks at the memory of processes


def play(options: Any, engine: str, workers: int, episodes: int) -> dict[str, Any]:
    """Play a run; its wall time, the memory of its largest worker [MB], and the final states by episode.

    Raises:
        OutputError: it fails.
    """
    with tempfile.TemporaryDirectory(prefix="mpgrasp-scaling-") as folder:
        words = [options.suite, "--detector", options.detector, "--controller", options.controller]
        words += ["--episodes", str(episodes), "--seed", str(options.seed), "--quiet"]
        words += ["--workers", str(workers), "--engine", engine, "--out", f"{folder}/run"]
        start = time.monotonic()
        command = subprocess.Popen(
            [sys.executable, "-m", "mpgrasp.bench", *words],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
        memory: dict[int, float] = {}
        watch = threading.Thread(target=_watch, args=(command, memory), daemon=True)
        watch.start()
        _, said = command.communicate()
        seconds = time.monotonic() - start
        watch.join()
        if command.returncode:
            raise OutputError(f"`{' '.join(words)}` ends with {command.returncode}", got=said[-300:])
        lines = (Path(folder) / "run" / "episodes.jsonl").read_text("utf-8").splitlines()
        states = {row["episode"]: row["state_hash"] for row in map(json.loads, lines)}
    return {"seconds": seconds, "memory_mb": max(memory.values(), default=0.0), "states": states}


def _watch(command: subprocess.Popen[str], memory: dict[int, float]) -> None:
    """Keep the largest resident size of each process below a command [MB], itself left out."""
    while command.poll() is None:
        for process in _below(command.pid):
            with suppress(OSError, StopIteration, ValueError):
                status = Path(f"/proc/{process}/status").read_text("utf-8").splitlines()
                peak = next(line for line in status if line.startswith("VmHWM:"))
                memory[process] = int(peak.split()[1]) / 1024
        time.sleep(_PERIOD)


def _below(process: int) -> Iterator[int]:
    """Yield the processes that a process has started, and those that they have."""
    with suppress(OSError):
        for child in Path(f"/proc/{process}/task/{process}/children").read_text("utf-8").split():
            yield int(child)
            yield from _below(int(child))


def rows_of(found: Mapping[tuple[str, int], Sequence[Mapping[str, float]]]) -> list[dict[str, Any]]:
    """A row for each setting: medians over its rounds; `times` is the rate over that of the first setting."""
    rows: list[dict[str, Any]] = []
    for (engine, workers), rounds in found.items():
        medians = {key: statistics.median(turn[key] for turn in rounds) for key in rounds[0]}
        rows.append({"engine": engine, "workers": workers, "rounds": len(rounds), **medians})
    return [{**row, "times": row["per_minute"] / rows[0]["per_minute"]} for row in rows]


def draw(rows: Sequence[Mapping[str, Any]]) -> Figure:
    """Episodes a minute against workers, a line per engine, with what as many times the first would be."""
    picture, (axes,) = figure(width=5.4, height=3.8)
    for k, engine in enumerate(dict.fromkeys(row["engine"] for row in rows)):
        mine = [row for row in rows if row["engine"] == engine]
        axes.plot([r["workers"] for r in mine], [r["per_minute"] for r in mine], label=engine, **style(k))
    numbers = sorted({row["workers"] for row in rows})
    each = rows[0]["per_minute"] / rows[0]["workers"]
    axes.plot(numbers, [n * each for n in numbers], color="#999999", linestyle=":", label="in proportion")
    axes.set(xlabel="workers", ylabel="episodes a minute", xticks=numbers)
    axes.set_ylim(bottom=0)
    axes.legend()
    return picture


def _study(command: Sequence[str]) -> None:
    parser = Parser(description=__doc__)
    add = parser.add_argument
    add("--suite", default="thin", help="default: thin")
    add("--detector", default="dhrnet", help="default: dhrnet")
    add("--controller", default="mppc_robust", help="default: mppc_robust")
    add("--workers", metavar="K[,K]", default="1,2", help="default: 1,2")
    add("--engines", metavar="E[,E]", default=",".join(ENGINES), help="default: %(default)s")
    add("--short", metavar="N", type=COUNT, default=4, help="episodes of the short run (default: 4)")
    add("--long", metavar="N", type=COUNT, default=24, help="episodes of the long run (default: 24)")
    add("--rounds", metavar="N", type=COUNT, default=3, help="default: 3")
    add("--seed", metavar="S", type=SEED, default=0, help="default: 0")
    add("--out", metavar="DIR", type=Path, default=OUT, help="default: benchmarks/results/scaling")
    options = parser.parse_args(command)
    workers = _numbers(options.workers)
    engines = options.engines.split(",")
    if not set(engines) <= set(ENGINES):
        raise ConfigError("unknown engine", got=options.engines, allowed=ENGINES)
    if options.short >= options.long:
        raise ConfigError("a long run that is short", got=options.long, allowed=f"more than {options.short}")
    os.environ["OMP_NUM_THREADS"] = "1"
    prepare(options.out)
    told = about(
        "scaling", command, workers=workers, engines=engines, cores=len(os.sched_getaffinity(0)),
        suite=options.suite, detector=options.detector, controller=options.controller,
        short=options.short, long=options.long, rounds=options.rounds, seed=options.seed,
    )  # fmt: skip
    found: dict[tuple[str, int], list[dict[str, float]]] = {}
    states: dict[int, str] = {}
    turns = [(engine, n) for _ in range(options.rounds) for engine in engines for n in workers]
    for engine, n in track(turns, "runs", len(turns)):
        short, long = (play(options, engine, n, count) for count in (options.short, options.long))
        for run in (short, long):
            if any(states.setdefault(episode, state) != state for episode, state in run["states"].items()):
                raise OutputError("an episode has other bits", got=f"{engine}, {n} workers")
        each = (long["seconds"] - short["seconds"]) / (options.long - options.short)
        found.setdefault((engine, n), []).append(
            {
                "per_minute": 60 / each,
                "start_and_end_s": short["seconds"] - options.short * each,
                "memory_mb": long["memory_mb"],
            }
        )
    rows = rows_of(found)
    results = {"rows": rows, "same_bits": True, "episodes": len(states)}
    publish(options.out, "scaling", told, results, rows, draw(rows))
    for row in rows:
        print(
            f"{row['engine']:<10}{row['workers']:>3} workers{row['per_minute']:8.1f} episodes a minute "
            f"({row['times']:.2f} x), {row['start_and_end_s']:.1f} s more, {row['memory_mb']:.0f} MB a worker"
        )
    print(f"Results: {options.out}")


def _numbers(text: str) -> list[int]:
    try:
        numbers = [int(word) for word in text.split(",")]
    except ValueError:
        numbers = []
    if not numbers or min(numbers) < 1:
        raise ConfigError("unusable numbers of workers", got=text, allowed="such as 1,2,4")
    return numbers


def main(command: Sequence[str] | None = None) -> int:
    """Run the command line (`sys.argv` if not given) and return the exit code; 2 for unusable input."""
    return run_command(_study, command)


if __name__ == "__main__":
    sys.exit(main())
