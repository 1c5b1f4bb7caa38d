"""How much memory and time do resumption, summary, report and comparison of a million episodes take?

    python benchmarks/many_episodes.py --episodes 1000000

The lines are made, not played: the benchmark begins a run, is interrupted, and its file is filled with lines
as of real episodes, with random times and outcomes. Then the command line works on it, each command in a
process of its own, whose greatest memory the system tells. `--resume` finds nothing left to play, and
settles, summarises and reports the run; `report` and `compare` read it again.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from study import RESULTS, Parser, about, figure, prepare, publish, run_command, style, track

from mpgrasp.bench.record import Method, text_of
from mpgrasp.bench.record import line_of as made
from mpgrasp.bench.results.reader import EPISODES, RUN
from mpgrasp.command_line import SEED
from mpgrasp.exceptions import ConfigError, OutputError
from mpgrasp.suite import episode_seed

if TYPE_CHECKING:
    from matplotlib.figure import Figure

OUT = RESULTS / "many-episodes"
SUITE = "thin"
METHODS = (Method("oracle", "mppc"), Method("oracle", "mvp"))
BENCH = (sys.executable, "-m", "mpgrasp.bench")
START_LIMIT = 300.0
"""Time in which a run must have begun [s]."""


def begin(folder: Path, episodes: int) -> None:
    """Begin a run of that many episodes of each method, and interrupt it.

    Raises:
        OutputError: it does not begin.
    """
    controllers = ",".join(method.controller for method in METHODS)
    command = [*BENCH, SUITE, "--detector", METHODS[0].detector, "--controller", controllers]
    command += ["--episodes", str(episodes), "--workers", "0", "--quiet", "--out", str(folder)]
    run = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    limit = time.monotonic() + START_LIMIT
    while not (folder / EPISODES).exists():
        if run.poll() is not None or time.monotonic() > limit:
            run.kill()
            raise OutputError("a run does not begin", got=run.communicate()[1].decode()[-200:])
        time.sleep(0.05)
    run.kill()
    run.communicate()


def lines(episodes: int, seed: int) -> Iterator[str]:
    """Yield the lines of a run with that many episodes of each method."""
    rng = np.random.default_rng(seed)
    for episode in range(episodes):
        scene = episode_seed(SUITE, 0, episode)
        for method, chance in zip(METHODS, (0.97, 0.95), strict=True):
            yield text_of(made(_row(method, episode, scene, bool(rng.random() < chance), rng)))


def _row(method: Method, episode: int, scene: int, success: bool, rng: np.random.Generator) -> dict[str, Any]:
    numbers = rng.gamma(20.0, 0.05, 8).tolist()
    state = rng.bytes(32).hex()
    return {
        "suite": SUITE, "seed": 0, "scene_seed": scene, "episode": episode, "detector": method.detector,
        "controller": method.controller, "outcome": "success" if success else "missed", "success": success,
        "object": "usb_stick", "sim_time_s": 13 * numbers[0], "ticks": int(60 * numbers[1]), "reflex": None,
        "min_singular_value": 0.15 * numbers[2], "near_singularity_s": 0.0, "path_length_m": 0.5 * numbers[3],
        "jerk_rms": 11 * numbers[4], "spectral_arc_length": -2 * numbers[5], "first_detection_s": 0.0,
        "blind_drift_m": 0.0, "state_hash": state,
        "grasp": {"position": [0.5, 0.01, 0.02], "angle": 0.3, "width": 0.02, "quality": 0.9},
        "timing": {name: numbers[6] for name in ("control", "detect", "ik", "physics", "render")},
    }  # fmt: skip


def measure(words: Sequence[str], checkout: Path | None = None) -> dict[str, Any]:
    """Run a command of the benchmark; its time, and the most memory that it took.

    Args:
        words: of the command.
        checkout: of the version that is measured; this one unless given.

    Raises:
        OutputError: it fails.
    """
    start = time.monotonic()
    command = subprocess.Popen(
        [*BENCH, *words],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        cwd=checkout,
        env=os.environ if checkout is None else {**os.environ, "PYTHONPATH": str(checkout)},
    )
    said = command.stderr.read() if command.stderr else b""
    _, status, used = os.wait4(command.pid, 0)
    command.returncode = os.waitstatus_to_exitcode(status)
    if command.returncode:
        raise OutputError(f"`{' '.join(words)}` ends with {command.returncode}", got=said.decode()[-300:])
    return {"seconds": time.monotonic() - start, "cpu_s": _cpu(used), "memory_mb": used.ru_maxrss / 1024}


def _cpu(used: resource.struct_rusage) -> float:
    return used.ru_utime + used.ru_stime


def play(episodes: int, seed: int) -> list[dict[str, Any]]:
    """A row per command: its name, time and memory, with `episodes` in all."""
    with tempfile.TemporaryDirectory(prefix="mpgrasp-many-") as name:
        folder = Path(name) / "run"
        begin(folder, episodes // len(METHODS))
        with (folder / EPISODES).open("w", encoding="utf-8") as file:
            file.writelines(lines(episodes // len(METHODS), seed))
        assert (folder / RUN).is_file()
        size = (folder / EPISODES).stat().st_size / 1e6
        commands = {
            "resume": ["--resume", str(folder), "--workers", "0", "--quiet"],
            "report": ["report", str(folder)],
            "compare": ["compare", f"{folder}/{METHODS[1]}", f"{folder}/{METHODS[0]}"],
        }
        rows = []
        for what, words in track(commands.items(), f"{episodes} episodes", len(commands)):
            rows.append({"command": what, "episodes": episodes, "file_mb": size, **measure(words)})
        summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
        if not summary["complete"] or sum(cell["n"] for cell in summary["cells"]) != episodes:
            raise OutputError("the summary misses episodes", got=str(folder))
    return rows


def draw(rows: Sequence[Mapping[str, Any]]) -> Figure:
    """Memory and time against the number of episodes, a line per command."""
    picture, panels = figure(2, width=4.8, height=3.8)
    for axes, key, label in zip(
        panels, ("memory_mb", "seconds"), ("greatest memory [MB]", "time [s]"), strict=True
    ):
        for k, name in enumerate(dict.fromkeys(row["command"] for row in rows)):
            mine = [row for row in rows if row["command"] == name]
            axes.plot([row["episodes"] for row in mine], [row[key] for row in mine], label=name, **style(k))
        axes.set(xscale="log", xlabel="episodes", ylabel=label)
        axes.set_ylim(bottom=0)
    panels[0].legend()
    return picture


def _study(command: Sequence[str]) -> None:
    parser = Parser(description=__doc__)
    add = parser.add_argument
    add("--episodes", metavar="N[,N]", default="10000,100000,1000000", help="default: %(default)s")
    add("--seed", metavar="S", type=SEED, default=1, help="of the made-up lines (default: 1)")
    add("--out", metavar="DIR", type=Path, default=OUT, help="default: benchmarks/results/many-episodes")
    options = parser.parse_args(command)
    try:
        sizes = [int(word) for word in options.episodes.split(",")]
    except ValueError as error:
        raise ConfigError("unusable episodes", got=options.episodes, allowed="such as 1000,10000") from error
    if any(size < 2 * len(METHODS) or size % len(METHODS) for size in sizes):
        raise ConfigError("unusable episodes", got=sizes, allowed=f"even numbers from {2 * len(METHODS)}")
    prepare(options.out)
    told = about("many_episodes", command, episodes=sizes, seed=options.seed)
    rows = [row for size in sizes for row in play(size, options.seed)]
    publish(options.out, "many-episodes", told, {"rows": rows}, rows, draw(rows))
    for row in rows:
        print(f"{row['command']:<10}{row['episodes']:>9}{row['seconds']:8.1f} s{row['memory_mb']:8.0f} MB")
    print(f"Results: {options.out}")


def main(command: Sequence[str] | None = None) -> int:
    """Run the command line (`sys.argv` if not given) and return the exit code; 2 for unusable input."""
    return run_command(_study, command)


if __name__ == "__main__":
    sys.exit(main())
