"""Numbers that the paper reports of its physical trials, Tables III to VI, and the orderings that it claims.

References:
    The paper, Section IV-D: Tables III (single objects), IV (unseen toys), V (thin objects) and VI
    (stacked objects), and the text around them.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

METHODS = {"GG-CNN": ("ggcnn", "ggcnn2"), "TF-Grasp": ("tfgrasp",), "DHRNet": ("dhrnet",)}
"""The paper's detectors, and by which names they may stand in a run; the first one there counts, so that
GG-CNN2 stands for GG-CNN in runs without it."""
QUOTED = {"Lenz et al.": ("lenz",), "Pinto et al.": ("pinto",)}
"""Detectors that Table III alone has, likewise."""


class Baseline(StrEnum):
    """Map on which the paper's two controllers are compared."""

    PUBLISHED = "published"
    """The map of published multi-view picking: the test of the paper."""
    ROBUST = "robust"
    """This project's own map, which does not take a cell that was hardly seen for a good one."""


CONTROLLERS = {
    Baseline.PUBLISHED: {"MVP": "mvp", "MP-PC": "mppc"},
    Baseline.ROBUST: {"MVP": "mvp_robust", "MP-PC": "mppc_robust"},
}
"""Names here that stand for the paper's controllers, by baseline."""


def controllers_of(baseline: Baseline) -> tuple[str, ...]:
    """Names of the controllers of a baseline, in the paper's order."""
    return tuple(CONTROLLERS[baseline].values())


CELLS = tuple((method, controller) for method in METHODS for controller in ("MVP", "MP-PC"))
"""Columns of Tables IV to VI."""


class Measure(StrEnum):
    """Quantity that an ordering compares."""

    SUCCESS = "success rate"
    TIME = "time"
    REFLEX = "reflex stops"
    DRIFT = "drift before the first detection"


@dataclass(frozen=True, kw_only=True)
class Claim:
    """One ordering: `better` is more often successful, or faster, or stopped less often, or drifts less."""

    suite: str
    measure: Measure
    better: tuple[str, str]
    """(detector, controller) in the paper's words."""
    worse: tuple[str, str]
    source: str
    """Table or section of the paper that says so."""


SINGLE = {
    "GG-CNN": (88, 100),
    "Lenz et al.": (76, 100),
    "Pinto et al.": (64, 100),
    "TF-Grasp": (87, 100),
    "DHRNet": (91, 100),
}
"""Table III: successes and grasps. It does not say by which controller; MP-PC stands for it here."""
SINGLE_CONTROLLER = "MP-PC"
UNSEEN = {
    "Toy 1": (6, 6, 8, 8, 8, 9),
    "Toy 2": (6, 6, 7, 8, 8, 10),
    "Toy 3": (5, 6, 5, 7, 7, 7),
    "Toy 4": (7, 8, 8, 8, 9, 10),
}
"""Table IV: successes of `CELLS` in `UNSEEN_TRIALS` with each toy."""
UNSEEN_TRIALS = 10
THIN = (3, 6, 4, 6, 7, 9)
"""Table V: successes of `CELLS` in `THIN_TRIALS`."""
THIN_TRIALS = 10
STACKED = (721, 555, 421, 255, 168, 128)
"""Table VI: seconds of `CELLS` until the table was clear; the paper gives no number of trials."""


def reported(suite: str) -> dict[tuple[str, str], tuple[int, int]]:
    """Successes and trials that the paper reports of a suite, by (detector, controller); empty for others."""
    match suite:
        case "single":
            return {(name, SINGLE_CONTROLLER): counts for name, counts in SINGLE.items()}
        case "unseen":
            sums = [sum(column) for column in zip(*UNSEEN.values(), strict=True)]
            return {cell: (k, UNSEEN_TRIALS * len(UNSEEN)) for cell, k in zip(CELLS, sums, strict=True)}
        case "thin":
            return {cell: (k, THIN_TRIALS) for cell, k in zip(CELLS, THIN, strict=True)}
    return {}


def _claims() -> tuple[Claim, ...]:
    claims = [
        Claim(
            suite="single", measure=Measure.SUCCESS, source="Table III",
            better=("DHRNet", SINGLE_CONTROLLER), worse=(other, SINGLE_CONTROLLER),
        )
        for other in ("GG-CNN", "TF-Grasp")
    ]  # fmt: skip
    for suite, measure, table in (
        ("unseen", Measure.SUCCESS, "Table IV"),
        ("thin", Measure.SUCCESS, "Table V"),
        ("stacked", Measure.TIME, "Table VI"),
    ):
        claims += [
            Claim(
                suite=suite, measure=measure, source=table,
                better=("DHRNet", controller), worse=(other, controller),
            )
            for controller in ("MVP", "MP-PC") for other in ("GG-CNN", "TF-Grasp")
        ]  # fmt: skip
        claims += [
            Claim(suite=suite, measure=measure, source=table, better=(name, "MP-PC"), worse=(name, "MVP"))
            for name in METHODS
        ]
    claims += [
        Claim(
            suite="thin", measure=measure, source="Section IV-D.2",
            better=(name, "MP-PC"), worse=(name, "MVP"),
        )
        for measure in (Measure.REFLEX, Measure.DRIFT) for name in METHODS
    ]  # fmt: skip
    return tuple(claims)


CLAIMS = _claims()
"""Every ordering that the paper claims of its physical trials."""
