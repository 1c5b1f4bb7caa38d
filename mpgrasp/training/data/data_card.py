"""The card of a data set, README.md beside its shards: format, units, and what the simulated lifts say."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mpgrasp.exceptions import OutputError
from mpgrasp.statistics import wilson_interval
from mpgrasp.training.data import shards
from mpgrasp.training.data import verification as v
from mpgrasp.training.data.generate_config import GenerateConfig
from mpgrasp.training.data.labels import ANGLE_UNIT, DEPTH_UNIT
from mpgrasp.training.data.views import META_COLUMNS, THIN

_TEXT = """\
# Training data

Made by

    python -m mpgrasp.training generate --scenes {scenes} --seed {seed} --views {views} --out DIR{options}

{n_scenes} scenes, {n_views} views. A scene is a function of the seed, its index and the version of mpgrasp
alone: `mpgrasp.training.data.views.make_scene(seed, index)` builds it again, with the same objects in every
version of format {format}, though physics may let a few scenes settle otherwise. None of the objects is one
of the evaluation sets', or comes close to the size of one.

## Lifts

Of every scene a free-flying gripper tries {positives} grasps of the analysis (analytic positives), spread
over the objects and over the range of quality; grasps with the hand wide open at places on objects where
the analysis has none at that angle (analytic negatives, {negatives} a scene); and, after what failed has
lowered the labels around it, fresh ones ({audits} a scene) of label {good} or better (shipped positives),
which say what the labels are worth and correct nothing. Intervals are Wilson's, 95 %.

{table}

Failures of shipped positives: {failures}.

## Shards

`shard_*.npz`, of {shard_scenes} scenes each, hold arrays with a row per view; `trials` has a row per lift.

| array | type | what |
|---|---|---|
| depth | uint16 (n, 224, 224) | measured depth, noise included, steps of {depth_unit} mm; 0 = no return |
| rgb | uint8 (n, 224, 224, 3) | colour{colour} |
| quality | uint8 (n, 224, 224) | label: worth of the grasp, steps of 1/255; 0 = none |
| angle | uint8 (n, 224, 224) | label: closing direction in the image, steps of pi/{angle_steps} from -pi/2 |
| width | uint8 (n, 224, 224) | label: opening [px] |
| object_mask | uint8 (n, 224, 224) | 1 on objects |
| meta | float32 (n, {n_meta}) | columns `meta_columns` of meta.json |
| trials | float32 (m, {n_trial}) | columns `trial_columns` of meta.json |

Lengths in `meta` and `trials` are in m, angles in rad. `meta`: {meta}. `trials`: {trial}.
An `outcome` is an index into `lift_outcomes`; `quality` is the analysis's before, `shipped` after the lifts.
"""


def write_data_card(config: GenerateConfig, made: Sequence[Path], path: Path) -> None:
    """Write the card of the finished shards `made`.

    Raises:
        OutputError: it cannot be written.
    """
    trials = []
    for shard in made:
        with np.load(shard) as arrays:
            trials.append(arrays["trials"])
    all_trials = np.concatenate(trials)
    options = "" if config.camera == "auto" else f" --camera {config.camera}"
    text = _TEXT.format(
        scenes=config.scenes,
        seed=config.seed,
        views=config.views,
        format=shards.FORMAT,
        options=options + ("" if config.colour else " --no-colour"),
        n_scenes=config.scenes,
        n_views=config.scenes * config.views,
        positives=v.POSITIVES,
        negatives=v.NEGATIVES,
        audits=v.AUDITS,
        good=v.GOOD,
        table=lift_table(all_trials),
        failures=_failures(all_trials),
        shard_scenes=shards.SHARD_SCENES,
        depth_unit=1e3 * DEPTH_UNIT,
        colour="" if config.colour else "; not in this set (--no-colour)",
        angle_steps=round(np.pi / ANGLE_UNIT),
        n_meta=len(META_COLUMNS),
        n_trial=len(v.TRIAL_COLUMNS),
        meta=", ".join(META_COLUMNS),
        trial=", ".join(v.TRIAL_COLUMNS),
    )
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise OutputError("cannot write the card", got=str(path), allowed=str(error)) from None


def lift_table(trials: np.ndarray) -> str:
    """Return a Markdown table of the shares that lifted, by group; `trials` (m, len(TRIAL_COLUMNS))."""
    told = dict(zip(v.TRIAL_COLUMNS, trials.T, strict=True))
    positive, audit = told["positive"] > 0, told["audit"] > 0
    thin = told["thickness"] < THIN
    tried = positive & ~audit
    groups = [
        ("analytic positives, any quality", tried),
        *(
            (
                f"analytic positives, {low:.1f} to {high:.1f}",
                tried & _between(told["quality"], low, high),
            )
            for low, high in itertools.pairwise(v.STRATA)
        ),
        (f"analytic positives of {v.GOOD} or better", tried & (told["quality"] >= v.GOOD)),
        ("analytic negatives", ~positive),
        (f"shipped positives ({v.GOOD} or better)", audit),
        *(
            (
                f"shipped positives, {low:.1f} to {high:.1f}",
                audit & _between(told["shipped"], low, high),
            )
            for low, high in itertools.pairwise(v.STRATA)
            if high > v.GOOD
        ),
    ]
    lines = ["| drawn from | all | thin (below 13 mm) | thicker |", "|---|---|---|---|"]
    for name, mask in groups:
        cells = [_rate(told["lifted"][mask & part]) for part in (np.ones_like(thin), thin, ~thin)]
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _between(quality: np.ndarray, low: float, high: float) -> np.ndarray:
    return (quality >= low) & ((quality < high) | (high == v.STRATA[-1]))


def _rate(lifted: np.ndarray) -> str:
    n, k = len(lifted), int(lifted.sum())
    if not n:
        return "none"
    low, high = wilson_interval(k, n)
    return f"{k}/{n} = {k / n:.1%} ({low:.1%} to {high:.1%})"


def _failures(trials: np.ndarray) -> str:
    told = dict(zip(v.TRIAL_COLUMNS, trials.T, strict=True))
    lost = (told["audit"] > 0) & (told["lifted"] == 0)
    counts = np.bincount(told["outcome"][lost].astype(int), minlength=len(v.LIFT_OUTCOMES))
    words = [f"{n} {name}" for name, n in zip(v.LIFT_OUTCOMES, counts, strict=True) if n]
    return ", ".join(words) or "none"
