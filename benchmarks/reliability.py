"""What a user, a mesh, a plug-in, a disk or a signal does wrong: is it said, in time, and is nothing lost?

    python benchmarks/reliability.py

Every bad mesh, weight file, command line and plug-in of this folder is played as its user would play it, in
a process of its own. It must end within 60 s as it is documented: a refusal with exit code 2 and one line,
without a traceback, and with the folder left as it was; a plug-in that breaks its contract in a run as error
rows that count for nothing. Then a run is killed by SIGKILL at random moments and goes on; runs with
recordings meet disks that are too small; and the same episodes are played with other numbers of workers, in
another order, with other hash seeds and threads. All of these must end with the results of an undisturbed
run, bit for bit. Kinds that are through are kept in `parts/`: the same command goes on from there.
"""

from __future__ import annotations

import random
import shutil
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import repeat
from pathlib import Path
from typing import TYPE_CHECKING, Any

from equal_runs import PAIRED, WAYS, pair
from killed_runs import ORPHANS, Killed
from refusals import LIMIT, play, trials
from small_disks import SmallDisk, small_disks_here
from study import (
    RESULTS,
    Parser,
    about,
    begin,
    figure,
    kept,
    publish,
    rate,
    run_command,
    style,
    track,
)
from whole_runs import PLAY_LIMIT, Bench

from mpgrasp.command_line import COUNT, SEED, THREADS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

OUT = RESULTS / "reliability"
Row = Mapping[str, Any]
"""kind, name, fault ("" if all was as it must be) and seconds."""
Make = Callable[[], list[dict[str, object]]]


def by_kind(rows: Sequence[Row]) -> dict[str, dict[str, Any]]:
    """Share of trials that ended as they must, the slowest one, by kind and for "all"."""
    found: dict[str, dict[str, Any]] = {}
    for kind in (*dict.fromkeys(row["kind"] for row in rows), "all"):
        of = [row for row in rows if kind in ("all", row["kind"])]
        seconds = [row["seconds"] for row in of]
        found[kind] = {**rate(sum(not row["fault"] for row in of), len(of)), "slowest_s": max(seconds)}
    return found


def draw(rows: Sequence[Row]) -> Figure:
    """The time that every trial took, by kind; faults in another colour."""
    kinds = list(dict.fromkeys(row["kind"] for row in rows))[::-1]
    picture, (axes,) = figure(width=8.0, height=0.45 * len(kinds) + 1.4)
    spread = random.Random(0)
    for fault, label in ((False, "as it must be"), (True, "not so")):
        some = [row for row in rows if bool(row["fault"]) is fault]
        y = [kinds.index(row["kind"]) + spread.uniform(-0.25, 0.25) for row in some]
        look = {**style(int(fault)), "s": 14, "alpha": 0.6, "label": f"{label} ({len(some)})"}
        axes.scatter([row["seconds"] for row in some], y, **look)
    axes.set(yticks=range(len(kinds)), yticklabels=kinds, xscale="log", xlabel="time until it had ended [s]")
    axes.legend(loc="lower right")
    return picture


def parts(options: Any, work: Path) -> dict[str, Make]:
    """All that there is to play, by name: functions that return rows."""
    bench = Bench(work, work / "cache")
    rng = random.Random(options.seed)

    def some(things: Sequence[Any]) -> list[Any]:
        if options.sample is None or len(things) <= options.sample:
            return list(things)
        return [things[k] for k in sorted(rng.sample(range(len(things)), options.sample))]

    every = list(trials())
    kinds: dict[str, Make] = {}
    for kind in dict.fromkeys(trial.kind for trial in every):
        chosen = some([trial for trial in every if trial.kind == kind])

        def played(kind: str = kind, chosen: list[Any] = chosen) -> list[dict[str, object]]:
            with ThreadPoolExecutor(options.workers) as pool:
                found = pool.map(play, chosen, repeat(bench.cache))
                return list(track(found, kind, len(chosen)))

        kinds[kind] = played
    pairs = some([(kind, *paired) for paired in PAIRED for kind in WAYS])
    kinds["equal runs"] = lambda: [
        pair(bench, kind, suite, detector, options.episodes)
        for kind, suite, detector in track(pairs, "equal runs", len(pairs))
    ]
    killed = Killed(bench=bench, episodes=12 * options.episodes, seed=options.seed)
    kinds["SIGKILL"] = lambda: killed.kill(options.kills)
    disk = SmallDisk(bench=bench, episodes=options.episodes)
    kinds["full disk"] = lambda: [
        disk.play(size) for size in track(some(disk.sizes(5)), "full disk", options.sample or 5)
    ]
    return kinds


def play_all(options: Any) -> tuple[list[dict[str, Any]], dict[str, str]]:
    """Rows of all parts, and the kinds that cannot be played here with the reason."""
    settings = {name: getattr(options, name) for name in ("sample", "kills", "episodes", "seed")}
    with tempfile.TemporaryDirectory(prefix="mpgrasp-reliability-") as name:
        work = Path(name)
        missing = {"full disk": why} if (why := small_disks_here(work)) else {}
        rows: list[dict[str, Any]] = []
        for kind, make in parts(options, work).items():
            if kind not in missing:
                path = options.out / "parts" / f"{kind.replace(' ', '-').replace(',', '')}.json"
                rows += kept(path, settings, lambda make=make: {"rows": make()})["rows"]  # type: ignore[misc]
    return rows, missing


def _study(command: Sequence[str]) -> None:
    parser = Parser(description=__doc__)
    add = parser.add_argument
    add("--sample", metavar="N", type=COUNT, help="play N of each kind, drawn by the seed (default: all)")
    add("--kills", metavar="K", type=COUNT, default=40, help="processes to be killed (default: 40)")
    add(
        "--episodes",
        metavar="N",
        type=COUNT,
        default=4,
        help="of each cell of equal runs, and with recordings (default: 4)",
    )
    add("--seed", metavar="S", type=SEED, default=0, help="of sample and moments (default: 0)")
    add("--workers", metavar="K", type=THREADS, default=2, help="refusals at a time (default: 2)")
    add("--out", metavar="DIR", type=Path, default=OUT, help="default: benchmarks/results/reliability")
    options = parser.parse_args(command)
    limits = {"refusal": LIMIT, "run": PLAY_LIMIT, "workers of a killed run": ORPHANS}
    names = ("sample", "kills", "episodes", "seed")
    told = about(
        "reliability",
        command,
        settings={name: getattr(options, name) for name in names},
        limits_s=limits,
    )
    begin(options.out, told)
    rows, missing = play_all(options)
    kinds = by_kind(rows)
    faults = [row for row in rows if row["fault"]]
    publish(
        options.out,
        "reliability",
        told,
        {"kinds": kinds, "faults": faults, "not_played": missing},
        rows,
        draw(rows),
    )
    shutil.rmtree(options.out / "parts")
    for kind, found in kinds.items():
        print(f"{kind:<30}{found['count']:4d} of {found['n']:4d}   slowest {found['slowest_s']:6.1f} s")
    for row in faults:
        print(f"{row['kind']}: {row['name']}: {row['fault']}")
    for kind, why in missing.items():
        print(f"{kind}: not played: {why}")
    print(f"Results: {options.out}")


def main(command: Sequence[str] | None = None) -> int:
    """Run the command line (`sys.argv` if not given) and return the exit code; 2 for unusable input."""
    return run_command(_study, command)


if __name__ == "__main__":
    sys.exit(main())
