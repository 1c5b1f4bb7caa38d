"""Do the intervals of a ladder hold the truth, and how near do its levels come to it?

    python benchmarks/ladder_coverage.py --methods 500

Simulates methods whose success over the rungs of `thickness` is known: half at a level between 0.9 and 3 mm,
from 10 to 90 % within a factor between 1.35 and 4.5, failing 0, 1 or 3 % of the time however easy it is. Each
climbs the ladder as a real one would, rungs chosen by its own results. Counted is how often the 95 % interval
of the levels at 50 and at 90 % holds the true level, and the error is told in rungs.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from study import RESULTS, Parser, about, figure, prepare, publish, rate, run_command, style, track

from mpgrasp.bench.ladders.declaration import load_ladder
from mpgrasp.bench.ladders.schedule import RATES, Schedule
from mpgrasp.command_line import COUNT, SEED
from mpgrasp.thresholds import Fit

if TYPE_CHECKING:
    from matplotlib.figure import Figure

OUT = RESULTS / "ladder-coverage"
LAPSES = (0.0, 0.01, 0.03)


class Simulated(dict[float, dict[int, bool]]):
    """Results of a method of which all is known, made when somebody asks for a rung."""

    def __init__(self, rng: np.random.Generator, episodes: int) -> None:
        super().__init__()
        self._rng, self._episodes = rng, episodes
        self.middle = float(np.exp(rng.uniform(np.log(0.9), np.log(3.0))))
        self.width = float(np.exp(rng.uniform(np.log(0.3), np.log(1.5))))
        self.lapse = float(rng.choice(LAPSES))

    def get(self, rung: float, default: Any = None) -> dict[int, bool]:
        if rung not in self:
            steep = 2 * np.log(9) / self.width
            success = (1 - self.lapse) / (1 + np.exp(-steep * np.log(rung / self.middle)))
            luck = self._rng.random(self._episodes)
            self[rung] = {k: bool(value < success) for k, value in enumerate(luck)}
        return self[rung]

    def level(self, success: float) -> float:
        """The true level at which it falls through a success rate."""
        share = success / (1 - self.lapse)
        return float(self.middle * np.exp(np.log(share / (1 - share)) * self.width / (2 * np.log(9))))


def climb(schedule: Schedule, method: Simulated) -> list[dict[str, Any]]:
    """A row for each of `RATES`: the true level, the one that was found, and its interval."""
    *_, counts = schedule.counts(method)
    tally = {}
    for rung, number in counts.items():
        of_rung = [success for episode, success in method.get(rung).items() if episode < number]
        tally[rung] = sum(of_rung), len(of_rung)
    fit = Fit(schedule.scale, tally)
    rows = []
    for success in RATES:
        true, found = method.level(success), fit.threshold(success)
        held = found.low <= true <= found.high
        rows.append({"rate": success, "true": true, **found._asdict(), "held": held})
    return rows


def summary(rows: Sequence[dict[str, Any]], rung: float) -> list[dict[str, Any]]:
    """Coverage, and root mean square of the error in rungs, of each rate."""
    found = []
    for success in RATES:
        mine = [row for row in rows if row["rate"] == success]
        errors = np.log([row["level"] / row["true"] for row in mine]) / rung
        held = rate(sum(row["held"] for row in mine), len(mine))
        found.append({"rate": success, "coverage": held, "error_rungs": float(np.sqrt(np.mean(errors**2)))})
    return found


def draw(rows: Sequence[dict[str, Any]]) -> Figure:
    """Levels that were found over the true ones."""
    picture, panels = figure(2, width=4.4, height=4.0)
    for axes, success in zip(panels, RATES, strict=True):
        mine = [row for row in rows if row["rate"] == success]
        for k, held in enumerate((True, False)):
            places = [(row["true"], row["level"]) for row in mine if row["held"] is held]
            label = "interval holds the truth" if held else "it does not"
            axes.loglog(*np.array(places).reshape(-1, 2).T, ls="", ms=3, label=label, **style(k))
        axes.set(xlabel="true level [mm]", ylabel="level found [mm]", title=f"{100 * success:.0f} %")
    panels[0].legend(fontsize=9)
    return picture


def _study(command: Sequence[str]) -> None:
    parser = Parser(description=__doc__)
    add = parser.add_argument
    add("--methods", metavar="N", type=COUNT, default=500, help="simulated methods (default: 500)")
    add("--episodes", metavar="N", type=COUNT, default=200, help="of each (default: 200)")
    add("--seed", metavar="S", type=SEED, default=0, help="default: 0")
    add("--out", metavar="DIR", type=Path, default=OUT, help="default: benchmarks/results/ladder-coverage")
    options = parser.parse_args(command)
    prepare(options.out)
    settings = {"methods": options.methods, "episodes": options.episodes, "seed": options.seed}
    told = about("ladder_coverage", command, **settings)
    schedule = Schedule(scale=load_ladder("thickness").scale, episodes=options.episodes)
    rng = np.random.default_rng(options.seed)
    rows = []
    for number in track(range(options.methods), "methods", options.methods):
        method = Simulated(rng, options.episodes)
        rows += [{"method": number, **row} for row in climb(schedule, method)]
    rungs = schedule.scale.rungs
    found = summary(rows, float(rungs[-1] - rungs[0]) / (len(rungs) - 1))
    publish(options.out, "ladder-coverage", told, {"rows": found}, rows, draw(rows))
    for row in found:
        held, error = 100 * row["coverage"]["rate"], row["error_rungs"]
        print(f"{100 * row['rate']:.0f} %: {held:.1f} % of intervals hold, error {error:.2f} rungs")
    print(f"Results: {options.out}")


def main(command: Sequence[str] | None = None) -> int:
    """Run the command line (`sys.argv` if not given) and return the exit code; 2 for unusable input."""
    return run_command(_study, command)


if __name__ == "__main__":
    sys.exit(main())
