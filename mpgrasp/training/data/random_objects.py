"""Random parametric objects and scenes to train on.

They are drawn from continuous families of primitives and hulls, never from the catalogue, and anything
that comes close to the size of an object of the catalogue or of a shipped suite is drawn again: training
and evaluation stay apart.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from mpgrasp.geometry import FloatArray
from mpgrasp.scene.config import SceneConfig
from mpgrasp.scene.objects.catalogue import OBJECT_SETS, load_object
from mpgrasp.scene.objects.model import ObjectModel
from mpgrasp.suite import load_suite, suite_names
from mpgrasp.training.data.hollow_families import HOLLOW_FAMILIES
from mpgrasp.training.data.shapes import Family
from mpgrasp.training.data.solid_families import SOLID_FAMILIES
from mpgrasp.training.data.thin_families import THIN_FAMILIES
from mpgrasp.workspace import WORKSPACE_CENTRE

LONGEST = 0.2
"""Longest edge of a bounding box [m]."""
DENSITY = (200.0, 1500.0)
"""Least and greatest density of objects [kg/m^3]."""
LIGHTEST = 0.0003
"""Least mass of an object [kg]."""
FLAT_CLOTH = 0.1
"""Share of the scenes on a flat cloth."""
UNEVEN_CLOTH = 0.4
"""Share of the scenes on a cloth more uneven than `USUAL_CLOTH` ..."""
USUAL_CLOTH, WORST_CLOTH = 0.0015, 0.006
"""... up to the second one (RMS) [m]."""
WRINKLED = 0.2
"""Share of the scenes with wrinkles ..."""
WRINKLES = (0.0005, 0.004)
"""... and the range of their height [m]."""
LIKENESS = 0.15
"""A box whose three edges all lie within this share of an evaluation object's is drawn again."""
THIN_SCENES = 0.5
"""Share of the scenes that hold thin objects alone."""
HOLLOW = 0.4
"""Share of the thicker objects that are not convex as a whole: bowls, mugs, channels, hooks ..."""
PILES = 0.4
"""Share of the scenes of several objects that are dropped on each other near the centre."""
STACKS = 0.15
"""Share of them whose objects are set on one another, the broadest at the bottom."""
STACK_HEIGHT = 4
"""Most objects in a stack."""


LADDER_STICKS = [(0.060, 0.018, float(h)) for h in np.geomspace(0.0005, 0.0056, 11)]
"""Sticks of the ladders `thickness`, `cloth` and `noise`, with no gap for another between them [m]."""
LADDER_BLOCKS = [(0.090, float(w), 0.090) for w in np.geomspace(0.020, 0.076, 7)]
"""Blocks of the ladder `size`, likewise [m]."""


def random_object(rng: np.random.Generator, name: str, thin: bool) -> ObjectModel:
    """Draw an object: a box, stick, plate, disc, ring, letter, stack, hull ...

    Args:
        rng: source of all that is random.
        name: name of the object.
        thin: lie 0.8 to 12 mm high.
    """
    while True:
        parts = _pick(rng, thin)(rng)
        density, friction, (r, g, b) = rng.uniform(*DENSITY), rng.uniform(0.4, 0.9), rng.uniform(0.15, 0.9, 3)
        size = np.ptp(np.vstack([part.points for part in parts]), axis=0)
        mass = density * sum(part.volume for part in parts)
        if size.max() > LONGEST or mass < LIGHTEST or resembles_evaluation_object(size):
            continue
        return ObjectModel(
            name=name,
            parts=tuple(parts),
            mass=mass,
            friction=friction,
            rgba=(float(r), float(g), float(b), 1.0),
            provenance="random",
        )


def training_scene_config(rng: np.random.Generator) -> SceneConfig:
    """Draw a training scene: 1 to 10 objects, half of the scenes with thin objects alone."""
    thin_alone = rng.random() < THIN_SCENES
    thin_share = 1.0 if thin_alone else 0.15
    n = 1 + min(rng.geometric(0.3) - 1, 9)
    kind, share = "scatter", rng.random()
    if n > 1 and share < PILES + STACKS:
        kind = "pile" if share < PILES else "stack"
    if kind == "stack":
        n = min(n, STACK_HEIGHT)
    objects = [random_object(rng, f"train_{k}", bool(rng.random() < thin_share)) for k in range(n)]
    offset = rng.uniform(-0.2, 0.2, 2)
    if kind == "stack":
        objects.sort(key=lambda model: -model.size[0] * model.size[1])
        half_extent = rng.uniform(0.01, 0.03)
    elif kind == "pile":
        half_extent = rng.uniform(0.06, 0.09) + 0.02 * np.sqrt(n)
    else:  # objects need room; a pile makes its own
        half_extent = rng.uniform(0.02, 0.05) + 0.045 * np.sqrt(n)
    upright = kind == "stack" or (thin_alone and kind == "scatter")
    return SceneConfig(
        objects=tuple(objects),
        placing="scatter" if kind == "scatter" else "pile",
        pose="upright" if upright or rng.random() < 0.5 else "random",
        centre=(WORKSPACE_CENTRE[0] + offset[0] * 0.8, WORKSPACE_CENTRE[1] + offset[1]),
        half_extent=float(half_extent),
        cloth_unevenness=_unevenness(rng),
        cloth_wavelength=rng.uniform(0.04, 0.15),
        cloth_wrinkles=float(rng.uniform(*WRINKLES)) if rng.random() < WRINKLED else 0.0,
    )


def _unevenness(rng: np.random.Generator) -> float:
    kind, usual, worse = rng.random(), rng.uniform(0, USUAL_CLOTH), rng.uniform(USUAL_CLOTH, WORST_CLOTH)
    if kind < FLAT_CLOTH:
        return 0.0
    return float(worse if kind < FLAT_CLOTH + UNEVEN_CLOTH else usual)


def resembles_evaluation_object(size: ArrayLike) -> bool:
    """True if all three edges `size` [m], however turned, lie within `LIKENESS` of an evaluation object's."""
    ratio = np.sort(np.asarray(size, float)) / _evaluation_sizes()
    return bool((np.abs(ratio - 1) < LIKENESS).all(axis=1).any())


@cache
def _evaluation_sizes() -> FloatArray:
    """Return sorted edges (n, 3) of the boxes around the objects of catalogue, suites and ladders [m].

    What a seed means depends on them: where they change, `shards.FORMAT` has to be counted up.
    """
    catalogue: list[str | ObjectModel] = [name for names in OBJECT_SETS.values() for name in names]
    declared = [o for name in suite_names() for scene in load_suite(name).scenes for o in scene.objects]
    models = [load_object(o) if isinstance(o, str) else o for o in catalogue + declared]
    sizes = [*(model.size for model in models), *LADDER_STICKS, *LADDER_BLOCKS]
    return np.unique(np.sort(sizes, axis=1), axis=0)


def _pick(rng: np.random.Generator, thin: bool) -> Family:
    thick = HOLLOW_FAMILIES if rng.random() < HOLLOW else SOLID_FAMILIES
    families = THIN_FAMILIES if thin else thick
    weights = np.array(list(families.values()))
    return list(families)[rng.choice(len(families), p=weights / weights.sum())]
