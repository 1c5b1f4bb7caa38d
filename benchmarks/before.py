"""What do episodes, a start and a small run cost, beside an earlier version in the same run?

    git worktree add ../before a3b0698
    python benchmarks/before.py --before ../before

Plays `thin` with DHRNet with both versions in turns, in one process on one thread: runs of one episode, and
of six. Five episodes are what six take more than one; what remains of the one is the start and the end of
a run. CPU time, all of it from the system. Caches are warm: a run of each is played before, and not counted.
"""

from __future__ import annotations

import statistics
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from many_episodes import measure
from study import RESULTS, Parser, about, figure, prepare, publish, run_command, style, track

from mpgrasp.command_line import COUNT
from mpgrasp.exceptions import ConfigError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

OUT = RESULTS / "before"
NOW = Path(__file__).resolve().parents[1]
MORE = 5
"""Episodes that the longer run has more than the one of the shorter."""


def play(checkout: Path, controller: str, episodes: int) -> dict[str, Any]:
    """Time and memory of a run of a version; see `many_episodes.measure`."""
    with tempfile.TemporaryDirectory(prefix="mpgrasp-before-") as folder:
        words = ["thin", "--detector", "dhrnet", "--controller", controller, "--episodes", str(episodes)]
        words += ["--workers", "0", "--quiet", "--out", f"{folder}/run"]
        return measure(words, checkout)


def costs(checkout: Path, controller: str) -> dict[str, float]:
    """CPU time of an episode, of a start with its end, and of six episodes [s]; memory of the latter [MB]."""
    one, six = (play(checkout, controller, n) for n in (1, 1 + MORE))
    episode = (six["cpu_s"] - one["cpu_s"]) / MORE
    return {
        "episode_s": episode,
        "start_and_end_s": one["cpu_s"] - episode,
        "six_s": six["cpu_s"],
        "memory_mb": six["memory_mb"],
    }


def ratios(rounds: Sequence[Mapping[str, Mapping[str, float]]]) -> list[dict[str, Any]]:
    """A row for each cost: medians before and now, and the median of their ratios with its range."""
    rows = []
    for name in rounds[0]["now"]:
        pairs = [(turn["before"][name], turn["now"][name]) for turn in rounds]
        quotients = [now / before for before, now in pairs]
        rows.append(
            {
                "cost": name,
                "before": statistics.median(before for before, _ in pairs),
                "now": statistics.median(now for _, now in pairs),
                "ratio": statistics.median(quotients),
                "least": min(quotients),
                "most": max(quotients),
            }
        )
    return rows


def draw(rows: Sequence[Mapping[str, Any]]) -> Figure:
    """Ratios, a bar for each cost, with the range of the rounds."""
    picture, (axes,) = figure(width=5.4, height=2.8)
    for k, row in enumerate(rows):
        around = [[row["ratio"] - row["least"]], [row["most"] - row["ratio"]]]
        axes.barh(k, row["ratio"], xerr=around, color=style(k)["color"])
    names = ["an episode", "start and end", "six episodes", "memory"]
    axes.set_yticks(range(len(rows)), names[: len(rows)])
    axes.invert_yaxis()
    axes.axvline(1.0, color="#999999", linestyle=":")
    axes.set(xlabel="now, over what it was before")
    return picture


def _study(command: Sequence[str]) -> None:
    parser = Parser(description=__doc__)
    add = parser.add_argument
    add("--before", metavar="DIR", type=Path, required=True, help="checkout of the earlier version")
    add("--before-controller", metavar="C", default="mppc", help="that it plays (default: mppc)")
    add("--controller", metavar="C", default="mppc_robust", help="the same of today (default: mppc_robust)")
    add("--rounds", metavar="N", type=COUNT, default=5, help="default: 5")
    add("--out", metavar="DIR", type=Path, default=OUT, help="default: benchmarks/results/before")
    options = parser.parse_args(command)
    before = options.before.resolve()
    if not (before / "mpgrasp" / "__init__.py").is_file():
        raise ConfigError(
            "no checkout of mpgrasp", got=str(options.before), allowed="git worktree add DIR REV"
        )
    prepare(options.out)
    told = about("before", command, rounds=options.rounds)
    versions = {"before": (before, options.before_controller), "now": (NOW, options.controller)}
    for version in versions.values():
        play(*version, 1)
    rounds = [
        {name: costs(*version) for name, version in versions.items()}
        for _ in track(range(options.rounds), "rounds", options.rounds)
    ]
    rows = ratios(rounds)
    publish(options.out, "before", told, {"rows": rows, "rounds": rounds}, rows, draw(rows))
    for row in rows:
        print(
            f"{row['cost']:<16}{row['before']:9.2f}{row['now']:9.2f}{row['ratio']:7.2f} x"
            f" ({row['least']:.2f}-{row['most']:.2f})"
        )
    print(f"Results: {options.out}")


def main(command: Sequence[str] | None = None) -> int:
    """Run the command line (`sys.argv` if not given) and return the exit code; 2 for unusable input."""
    return run_command(_study, command)


if __name__ == "__main__":
    sys.exit(main())
