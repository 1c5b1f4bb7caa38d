"""Families of thin objects: 0.8 to 12 mm high as they lie."""

from __future__ import annotations

import numpy as np

from mpgrasp.scene.objects.model import Part
from mpgrasp.training.data.shapes import (
    LYING,
    Family,
    bar,
    box,
    letter,
    open_box,
    polygon,
    ring,
    shell,
    thickness,
)


def _thin_plate(rng: np.random.Generator) -> list[Part]:
    return [box((rng.uniform(0.025, 0.11), rng.uniform(0.012, 0.07), thickness(rng)))]


def _thin_stick(rng: np.random.Generator) -> list[Part]:
    width = rng.uniform(0.006, 0.025)
    return [box((rng.uniform(0.04, 0.18), width, min(thickness(rng), 1.2 * width)))]


def _thin_stepped(rng: np.random.Generator) -> list[Part]:
    """A body with a narrower, lower tongue in front: plugs, keys, blades."""
    h, length, width = thickness(rng), rng.uniform(0.02, 0.07), rng.uniform(0.012, 0.035)
    tongue = np.array([rng.uniform(0.008, 0.06), width * rng.uniform(0.3, 0.9), h * rng.uniform(0.4, 1.0)])
    lift = 0.0 if rng.random() < 0.5 else -(h - tongue[2]) / 2
    return [
        box((length, width, h)),
        box(tongue, ((length + tongue[0]) / 2, rng.uniform(-0.5, 0.5) * (width - tongue[1]), lift)),
    ]


def _thin_disc(rng: np.random.Generator) -> list[Part]:
    return [Part(shape="cylinder", size=(rng.uniform(0.01, 0.034), thickness(rng) / 2))]


def _thin_ring(rng: np.random.Generator) -> list[Part]:
    return ring(rng.uniform(0.012, 0.04), rng.uniform(0.005, 0.014), thickness(rng))


def _thin_letter(rng: np.random.Generator) -> list[Part]:
    return letter(rng, thickness(rng), rng.uniform(0.006, 0.022), rng.uniform(0.03, 0.09))


def _thin_rod(rng: np.random.Generator) -> list[Part]:
    radius = thickness(rng) / 2
    shape = "capsule" if rng.random() < 0.5 else "cylinder"
    return [Part(shape=shape, size=(radius, rng.uniform(0.02, 0.08)), quaternion=LYING)]


def _thin_hull(rng: np.random.Generator) -> list[Part]:
    """A pebble-like or polygonal slab."""
    outline = rng.uniform(0.012, 0.04) * polygon(rng) * (1.0, rng.uniform(0.4, 1.0))
    h, taper = thickness(rng), rng.uniform(0.7, 1.0)
    bottom = np.column_stack([outline, np.full(len(outline), -h / 2)])
    top = np.column_stack([outline * taper, np.full(len(outline), h / 2)])
    return [Part(shape="mesh", vertices=np.vstack([bottom, top]))]


def _thin_hook(rng: np.random.Generator) -> list[Part]:
    """A shaft, a bend and a shorter way back."""
    h, width = thickness(rng), rng.uniform(0.006, 0.016)
    length, gap = rng.uniform(0.05, 0.12), rng.uniform(0.012, 0.04)
    back = length * rng.uniform(0.2, 0.6)
    return [
        bar((0, 0), (length, 0), width, h),
        bar((length, -width / 2), (length, gap + width / 2), width, h),
        bar((length, gap), (length - back, gap), width, h),
    ]


def _thin_scissors(rng: np.random.Generator) -> list[Part]:
    """Two bars that cross, mostly with loops at the ends of one side."""
    h, width = thickness(rng), rng.uniform(0.007, 0.015)
    length, half = rng.uniform(0.07, 0.15), np.deg2rad(rng.uniform(8, 35))
    share = rng.uniform(0.35, 0.65)  # of the bars beyond the pivot
    ends = [length * np.array([np.cos(a), np.sin(a)]) for a in (half, -half)]
    parts = [bar(-share * end, (1 - share) * end, width, h) for end in ends]
    if rng.random() < 0.7:
        radius = rng.uniform(0.012, 0.02)
        for end in ends:
            x, y = -share * end - radius * end / length
            parts += [
                box(2 * np.array(p.size), (p.position[0] + x, p.position[1] + y, 0.0), yaw=_yaw(p))
                for p in ring(radius, 0.3 * radius, h, n=8)
            ]
    return parts


def _thin_arc(rng: np.random.Generator) -> list[Part]:
    """A piece of a ring: clips, handles, bananas."""
    h, radius = thickness(rng), rng.uniform(0.02, 0.06)
    width = min(rng.uniform(0.006, 0.02), 0.6 * radius)
    outer, inner = ([(r, -h / 2), (r, h / 2)] for r in (radius, radius - width))
    turn = rng.uniform(1.2, 4.8)
    return shell(outer, inner, int(np.ceil(turn / 0.5)), turn)


def _thin_comb(rng: np.random.Generator) -> list[Part]:
    """A back with tines: forks, combs, plugs, keys."""
    h, back = thickness(rng), rng.uniform(0.006, 0.015)
    n = int(rng.integers(2, 6))
    tine, pitch, length = rng.uniform(0.004, 0.01), rng.uniform(0.012, 0.02), rng.uniform(0.015, 0.06)
    parts = [bar((0, 0), ((n - 1) * pitch + tine, 0), back, h)]
    parts += [bar((k * pitch + tine / 2, 0), (k * pitch + tine / 2, length), tine, h) for k in range(n)]
    if rng.random() < 0.5:
        middle = ((n - 1) * pitch + tine) / 2
        parts.append(bar((middle, 0), (middle, -rng.uniform(0.03, 0.08)), rng.uniform(0.006, 0.015), h))
    return parts


def _thin_tray(rng: np.random.Generator) -> list[Part]:
    """A lid or tray: a floor with a rim all around."""
    size = np.array([rng.uniform(0.03, 0.11), rng.uniform(0.025, 0.07), max(thickness(rng), 0.004)])
    return open_box(size, rng.uniform(0.0015, 0.003))


def _yaw(part: Part) -> float:
    return float(2 * np.arctan2(part.quaternion[3], part.quaternion[0]))


THIN_FAMILIES: dict[Family, float] = {
    _thin_plate: 3,
    _thin_stick: 4,
    _thin_stepped: 3,
    _thin_disc: 1.5,
    _thin_ring: 1,
    _thin_letter: 1.5,
    _thin_rod: 1.5,
    _thin_hull: 1.5,
    _thin_hook: 1,
    _thin_scissors: 1,
    _thin_arc: 1,
    _thin_comb: 0.7,
    _thin_tray: 0.7,
}
"""Families and how often each is drawn."""
