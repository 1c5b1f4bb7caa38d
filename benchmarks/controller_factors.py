"""Which factor decides? Eight differences between controllers, varied together on sticks of 1.5, 2 and 3 mm.

    python benchmarks/controller_factors.py

The low level of every factor is that of `mvp`, multi-view picking as published; the first run is `mvp`.

    factor             low (mvp)                     high
    A prior in mean    the mean includes the prior   it is of the observations alone
    B evidence         rank by the mean alone        a cell of 20 observations counts half
    C border           cells there are never best,   they can be best, and nothing
                       the gain mirrors beyond       lies beyond
    D gamma            4/3 nat/m                     8 nat/m
    E descent          constant (Table I)            coupled (published code)
    F grid             0.68 m                        0.34 m
    G alpha            1                             0.2 without a peak
    H choice           the grid's best cell          the best pixel of any view

They are played as a fractional factorial of 16 runs (`factorial.py`: generators, aliases), and all runs meet
the same worlds. An effect is the mean at the high level less that at the low one. Finished episodes are kept
in `episodes.csv`: the same command goes on where it was interrupted, and more --episodes add worlds.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from factor_episodes import FACTORS, NAMES, Rows, Study, Task, detector_of, play_all
from factorial import design, interactions, main_effects
from study import (
    RESULTS,
    Parser,
    about,
    begin,
    figure,
    positive,
    publish,
    run_command,
    style,
    weights_hashes,
)

from mpgrasp.camera.backends import BACKENDS
from mpgrasp.command_line import COUNT, SEED, THREADS
from mpgrasp.controllers.config import MVP
from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import FloatArray

if TYPE_CHECKING:
    from matplotlib.figure import Figure

OUT = RESULTS / "controller-factors"
THICKNESSES = (1.5, 2.0, 3.0)  # [mm]


class Measure(NamedTuple):
    """A quantity that factors act on, in the unit in which it is told."""

    key: str
    """Its column in episodes.csv."""
    title: str
    scale: float
    digits: int


MEASURES = (
    Measure("success", "success [points]", 100.0, 1),
    Measure("stop", "protective stops [points]", 100.0, 1),
    Measure("blind_drift_m", "drift before detection [mm]", 1000.0, 0),
    Measure("min_singular_value", "smallest singular value [1e-3]", 1000.0, 0),
)


def responses(rows: Rows, measure: Measure, thicknesses: Sequence[float], worlds: int) -> FloatArray:
    """A measure (16, n) of all runs in all worlds of some thicknesses, in the unit in which it is told."""
    met = [(thickness, world) for thickness in thicknesses for world in range(worlds)]
    return np.array(
        [
            [measure.scale * float(rows[Task(*world, run)][measure.key]) for world in met]
            for run in range(len(design()))
        ]
    )


def evaluate(rows: Rows, thicknesses: Sequence[float], worlds: int) -> list[dict[str, Any]]:
    """A row per measure, thickness (0: all of them) and effect, those of interactions after the factors'."""
    found: list[dict[str, Any]] = []
    for measure in MEASURES:
        for thickness in (0.0, *thicknesses):
            some = (thickness,) if thickness else tuple(thicknesses)
            response = responses(rows, measure, some, worlds)
            for effect in (*main_effects(response), *interactions(response)):
                where = {"measure": measure.key, "thickness_mm": thickness}
                found.append({**where, "factor": NAMES.get(effect.name, ""), **asdict(effect)})
    return found


def table(rows: Sequence[Mapping[str, Any]], thicknesses: Sequence[float]) -> str:
    """Per measure the factors' effects, by thickness and for all of them, and the groups of interactions."""
    lines: list[str] = []
    for measure in MEASURES:
        heads = "".join(f"{thickness:>9g} mm" for thickness in thicknesses)
        lines += ["", f"{measure.title:<32}{heads}{'all [95 % interval]':>28}{'Holm p':>9}"]
        of_measure = [row for row in rows if row["measure"] == measure.key]
        for row in (row for row in of_measure if row["thickness_mm"] == 0):
            each = [
                next(
                    other["effect"]
                    for other in of_measure
                    if (other["thickness_mm"], other["name"]) == (thickness, row["name"])
                )
                for thickness in thicknesses
            ]
            d = measure.digits
            interval = f"{row['effect']:+.{d}f} [{row['low']:+.{d}f} to {row['high']:+.{d}f}]"
            p = f"{row['p_holm']:9.3g}" if row["factor"] else ""
            numbers = "".join(f"{value:>+12.{d}f}" for value in each)
            lines.append(f"{row['factor'] or '  ' + row['name']:<32}{numbers}{interval:>28}{p}")
    return "\n".join(lines[1:])


def draw(rows: Sequence[Mapping[str, Any]], thicknesses: Sequence[float], worlds: int) -> Figure:
    """A panel per measure: the factors' effects with intervals, the strongest on success on top."""
    mains = [row for row in rows if row["factor"]]
    overall = [row for row in mains if row["measure"] == "success" and row["thickness_mm"] == 0]
    order = [row["name"] for row in sorted(overall, key=lambda row: abs(row["effect"]))]
    picture, panels = figure(len(MEASURES), width=4.4, height=5.6)
    for axes, measure in zip(panels, MEASURES, strict=True):
        for k, thickness in enumerate((0.0, *thicknesses)):
            shown = {
                row["name"]: row
                for row in mains
                if (row["measure"], row["thickness_mm"]) == (measure.key, thickness)
            }
            x = [shown[name]["effect"] for name in order]
            bars = np.nan_to_num(
                [[x[i] - shown[name]["low"], shown[name]["high"] - x[i]] for i, name in enumerate(order)]
            ).T.clip(0)
            look = style(6) | {"markersize": 8} if not k else style(k - 1) | {"markersize": 4, "alpha": 0.8}
            y = np.arange(len(order)) + 0.3 - 0.17 * k
            label = f"{thickness:g} mm, n = {worlds}" if k else f"all, n = {worlds * len(thicknesses)}"
            axes.errorbar(x, y, xerr=bars, linestyle="", capsize=2, label=label, **look)
        axes.axvline(0, color="black", linewidth=1)
        axes.set(title=measure.title, yticks=range(len(order)))
        axes.set_yticklabels([NAMES[name] for name in order] if axes is panels[0] else [])
    panels[0].set_xlabel("effect of the change; bars: 95 %, worlds bootstrapped")
    picture.legend(*panels[-1].get_legend_handles_labels(), loc="outside lower right", ncols=4)
    return picture


def _study(command: Sequence[str]) -> None:
    parser = Parser(description=__doc__)
    add = parser.add_argument
    add("--detector", metavar="D", default="dhrnet", help="default: %(default)s")
    add("--episodes", metavar="N", type=COUNT, default=8, help="worlds of each thickness (default: 8)")
    add("--thickness", metavar="T[,T]", help="of the sticks [mm] (default: 1.5,2,3)")
    add("--seed", metavar="S", type=SEED, default=0, help="0, 1, 2, ... (default: 0)")
    add("--camera", choices=BACKENDS, default="auto", help="default: %(default)s")
    add("--workers", metavar="K", type=THREADS, default=1, help="play in K processes (default: 1)")
    add("--out", metavar="DIR", type=Path, default=OUT, help="default: benchmarks/results/controller-factors")
    options = parser.parse_args(command)
    thicknesses = _thicknesses(options.thickness)
    positive("number of episodes or workers", options.episodes, options.workers)
    study = Study(detector=options.detector, seed=options.seed, camera=options.camera)
    detector_of(study.detector)  # an unknown one is better known now
    told = about(
        "controller_factors", command, episodes=options.episodes, thicknesses_mm=thicknesses,
        settings={
            **asdict(study), "weights_sha256": weights_hashes([study.detector]),
            "factors": [asdict(factor) for factor in FACTORS], "low": asdict(MVP), "design": design(),
        },
    )  # fmt: skip
    begin(options.out, told)
    tasks = [
        Task(thickness, world, run)
        for world in range(options.episodes)
        for thickness in thicknesses
        for run in range(len(design()))
    ]
    rows = play_all(study, tasks, options.workers, options.out / "episodes.csv")
    found = evaluate(rows, thicknesses, options.episodes)
    picture = draw(found, thicknesses, options.episodes)
    publish(options.out, "controller-factors", told, {"effects": found}, found, picture)
    print(f"Effects over {options.episodes} worlds of each thickness, each met in {len(design())} runs.")
    print(f"{table(found, thicknesses)}\nResults: {options.out}")


def _thicknesses(text: str | None) -> tuple[float, ...]:
    if text is None:
        return THICKNESSES
    try:
        found = tuple(dict.fromkeys(map(float, text.split(","))))
    except ValueError as error:
        raise ConfigError("unusable thickness", got=text, allowed="such as 1.5,2,3 [mm]") from error
    positive("thickness", *found)
    return found


def main(command: Sequence[str] | None = None) -> int:
    """Run the command line (`sys.argv` if not given) and return the exit code; 2 for unusable input."""
    return run_command(_study, command)


if __name__ == "__main__":
    sys.exit(main())
