"""What does a step of an environment cost, beside those of other simulators?

    python benchmarks/environments.py --python .venv/bin/python --others /path/to/other/venv/bin/python

Every environment takes random actions in a process of its own, on one thread, in turns within one run:
mpgrasp with the oracle and with DHRNet, robosuite's Lift with its eye-in-hand camera, and panda-gym's
PandaPickAndPlace, which sees no image. --others names an interpreter in which robosuite and panda-gym are
installed (`pip install robosuite panda-gym "mujoco<3.4"`): their requirements may not go with ours. What
is not installed is left out, and said.
"""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from environment_probes import PROBES
from study import RESULTS, Parser, about, figure, prepare, publish, run_command, style, track

from mpgrasp.command_line import COUNT
from mpgrasp.exceptions import OutputError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

OUT = RESULTS / "environments"
PROBE = Path(__file__).with_name("environment_probes.py")
LIMIT = 600.0
"""Time that an environment may take for its steps [s]."""


def probe(name: str, python: str, steps: int) -> dict[str, Any] | None:
    """Time an environment in an interpreter; None where it is not installed there.

    Raises:
        OutputError: it is, and fails.
    """
    distribution, _ = PROBES[name]
    there = f"import importlib.metadata as m; m.version({distribution!r})"
    try:
        if subprocess.run([python, "-c", there], capture_output=True).returncode:
            return None
        run = subprocess.run(
            [python, str(PROBE), name, "--steps", str(steps)],
            capture_output=True,
            text=True,
            timeout=LIMIT,
            env={"MUJOCO_GL": "egl", **os.environ, "OMP_NUM_THREADS": "1"},
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise OutputError(f"{name} cannot be timed: {error}", got=python) from error
    if run.returncode:
        said = (run.stderr.strip().splitlines() or ["no word"])[-1]
        raise OutputError(f"{name} cannot be timed: {said}", got=python)
    found: dict[str, Any] = json.loads(run.stdout.strip().splitlines()[-1])
    return found


def medians(rounds: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """A row for each environment: medians over its rounds, and how many times as fast as robosuite it is."""
    rows = []
    for name in dict.fromkeys(row["environment"] for row in rounds):
        mine = [row for row in rounds if row["environment"] == name]
        times = {key: statistics.median(row[key] for row in mine) for key in ("median_ms", "mean_ms")}
        rows.append({**mine[0], **times, "rounds": len(mine)})
    slow = next((row["median_ms"] for row in rows if row["environment"] == "robosuite"), None)
    return [{**row, "times_robosuite": None if slow is None else slow / row["median_ms"]} for row in rows]


def draw(rows: Sequence[Mapping[str, Any]]) -> Figure:
    """CPU time of a step, a bar for each environment."""
    picture, (axes,) = figure(width=6.4, height=3.0)
    for k, row in enumerate(rows):
        axes.barh(k, row["median_ms"], color=style(k)["color"])
    axes.set_yticks(range(len(rows)), [row["environment"] for row in rows])
    axes.invert_yaxis()
    axes.set(xlabel="CPU time of a usual step [ms]")
    return picture


def _study(command: Sequence[str]) -> None:
    parser = Parser(description=__doc__)
    add = parser.add_argument
    add("--python", metavar="FILE", default=sys.executable, help="that has mpgrasp (default: this one)")
    add("--others", metavar="FILE", default=sys.executable, help="that has the others (default: this one)")
    add("--steps", metavar="N", type=COUNT, default=200, help="default: 200")
    add("--rounds", metavar="N", type=COUNT, default=3, help="default: 3")
    add("--out", metavar="DIR", type=Path, default=OUT, help="default: benchmarks/results/environments")
    options = parser.parse_args(command)
    prepare(options.out)
    words = ["--steps", str(options.steps), "--rounds", str(options.rounds)]  # no paths of this machine
    told = about("environments", words, steps=options.steps, rounds=options.rounds)
    rounds, missing = [], set()
    turns = [name for _ in range(options.rounds) for name in PROBES]
    for name in track(turns, "environments", len(turns)):
        python = options.python if PROBES[name][0] == "mpgrasp" else options.others
        found = probe(name, python, options.steps) if name not in missing else None
        rounds += [] if found is None else [found]
        missing |= {name} if found is None else set()
    for name in sorted(missing):
        print(f"{name} is not installed, and left out", file=sys.stderr)
    if not rounds:
        raise OutputError("no environment is installed", allowed="--python and --others")
    rows = medians(rounds)
    publish(options.out, "environments", told, {"rows": rows, "rounds": rounds}, rows, draw(rows))
    for row in rows:
        times = row["times_robosuite"]
        faster = "" if times is None else f"  {times:5.1f} x robosuite's rate"
        print(f"{row['environment']:<18}{row['median_ms']:7.1f} ms (mean {row['mean_ms']:.1f}){faster}")
    print(f"Results: {options.out}")


def main(command: Sequence[str] | None = None) -> int:
    """Run the command line (`sys.argv` if not given) and return the exit code; 2 for unusable input."""
    return run_command(_study, command)


if __name__ == "__main__":
    sys.exit(main())
