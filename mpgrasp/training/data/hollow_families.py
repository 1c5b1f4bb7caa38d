"""Families of thicker objects that are not convex: bowls, mugs, boxes, channels, tubes, hooks, beams ..."""

from __future__ import annotations

import numpy as np

from mpgrasp.scene.objects.model import Part
from mpgrasp.training.data.shapes import GRASPABLE, LYING, Family, bar, box, lay_down, open_box, ring, shell

_AROUND = 10  # convex pieces of a round wall


def _bowl(rng: np.random.Generator) -> list[Part]:
    """A wall that widens upwards on a round floor."""
    top, height, wall = rng.uniform(0.03, 0.06), rng.uniform(0.015, 0.05), rng.uniform(0.003, 0.006)
    bottom, floor = top * rng.uniform(0.45, 0.85), rng.uniform(0.003, 0.005)
    bulge = bottom + (top - bottom) * rng.uniform(0.5, 0.9)
    z = np.array([0, height / 2, height]) - height / 2
    outer = np.column_stack([[bottom, bulge, top], z])
    parts = []
    for k in range(2):  # two rows of pieces, each of them convex
        row = outer[k : k + 2]
        parts += shell(row, row - (wall, 0), _AROUND)
    disc = Part(
        shape="cylinder", size=(bottom - wall / 2, floor / 2), position=(0.0, 0.0, (floor - height) / 2)
    )
    return [disc, *parts]


def _cup(rng: np.random.Generator) -> list[Part]:
    """A beaker, or a mug with a handle."""
    radius, height, wall = rng.uniform(0.022, 0.042), rng.uniform(0.03, 0.09), rng.uniform(0.003, 0.006)
    taper = rng.uniform(0.75, 1.0)
    outer = np.array([(radius * taper, -height / 2), (radius, height / 2)])
    parts = shell(outer, outer - (wall, 0), _AROUND)
    parts.append(
        Part(
            shape="cylinder",
            size=(radius * taper - wall / 2, 0.002),
            position=(0.0, 0.0, 0.002 - height / 2),
        )
    )
    if rng.random() < 0.6:
        thick, out, high = rng.uniform(0.005, 0.009), rng.uniform(0.018, 0.03), height * rng.uniform(0.5, 0.8)
        start = radius * taper - wall
        reach = radius - start + out
        parts.append(box((thick, thick, high), (start + reach, 0.0, 0.0)))
        for s in (-1, 1):
            parts.append(box((reach, thick, thick), (start + reach / 2, 0.0, s * (high - thick) / 2)))
    return parts


def _open_box(rng: np.random.Generator) -> list[Part]:
    size = (rng.uniform(0.04, 0.12), rng.uniform(0.035, 0.09), rng.uniform(0.015, 0.06))
    return open_box(size, rng.uniform(0.003, 0.006))


def _channel(rng: np.random.Generator) -> list[Part]:
    """A U section, open at both ends."""
    length, width, height = rng.uniform(0.04, 0.16), rng.uniform(0.02, GRASPABLE), rng.uniform(0.012, 0.045)
    wall = rng.uniform(0.003, 0.008)
    floor = box((length, width, wall), (0.0, 0.0, (wall - height) / 2))
    return [floor, *(box((length, wall, height), (0.0, s * (width - wall) / 2, 0.0)) for s in (-1, 1))]


def _beam(rng: np.random.Generator) -> list[Part]:
    """An I section, standing on its flange or lying on its side."""
    length, width, height = rng.uniform(0.04, 0.15), rng.uniform(0.02, 0.06), rng.uniform(0.02, 0.06)
    web, flange = rng.uniform(0.004, 0.015), rng.uniform(0.004, 0.01)
    middle = (length, web, height)
    if rng.random() < 0.5:
        return [
            box(middle),
            *(box((length, width, flange), (0.0, 0.0, s * (height - flange) / 2)) for s in (-1, 1)),
        ]
    return [
        box((length, height, web)),
        *(box((length, flange, width), (0.0, s * (height - flange) / 2, 0.0)) for s in (-1, 1)),
    ]


def _tube(rng: np.random.Generator) -> list[Part]:
    """Standing or lying."""
    radius, length = rng.uniform(0.012, 0.036), rng.uniform(0.03, 0.13)
    wall = min(rng.uniform(0.003, 0.008), 0.5 * radius)
    outer, inner = ([(r, -length / 2), (r, length / 2)] for r in (radius, radius - wall))
    parts = shell(outer, inner, _AROUND)
    return lay_down(parts) if length > 1.5 * radius or rng.random() < 0.5 else parts


def _hook(rng: np.random.Generator) -> list[Part]:
    """A shaft, a bend, a way back, and sometimes a tip."""
    h, width = rng.uniform(0.012, 0.03), rng.uniform(0.01, 0.022)
    length, gap = rng.uniform(0.06, 0.13), rng.uniform(0.02, 0.05)
    back = length * rng.uniform(0.25, 0.7)
    parts = [
        bar((0, 0), (length, 0), width, h),
        bar((length, -width / 2), (length, gap + width / 2), width, h),
        bar((length, gap), (length - back, gap), width, h),
    ]
    if rng.random() < 0.4:
        parts.append(bar((0, -width / 2), (0, -rng.uniform(0.02, 0.04)), width, h))
    return parts


def _arc(rng: np.random.Generator) -> list[Part]:
    h, radius = rng.uniform(0.012, 0.035), rng.uniform(0.025, 0.065)
    width = min(rng.uniform(0.01, 0.03), 0.6 * radius)
    outer, inner = ([(r, -h / 2), (r, h / 2)] for r in (radius, radius - width))
    turn = rng.uniform(1.2, 4.8)
    return shell(outer, inner, int(np.ceil(turn / 0.5)), turn)


def _wedge(rng: np.random.Generator) -> list[Part]:
    """A ramp, or a roof."""
    length, width, height = rng.uniform(0.03, 0.11), rng.uniform(0.02, GRASPABLE), rng.uniform(0.015, 0.05)
    ridge = rng.choice([-0.5, 0.5, rng.uniform(-0.4, 0.4)]) * length
    low = [(x * length / 2, y * width / 2, -height / 2) for x in (-1, 1) for y in (-1, 1)]
    return [
        Part(shape="mesh", vertices=np.array([*low, *((ridge, y * width / 2, height / 2) for y in (-1, 1))]))
    ]


def _bridge(rng: np.random.Generator) -> list[Part]:
    """A slab on two legs, or on four."""
    length, width, height = rng.uniform(0.05, 0.12), rng.uniform(0.02, 0.065), rng.uniform(0.025, 0.07)
    slab, leg = rng.uniform(0.006, 0.015), rng.uniform(0.008, 0.018)
    parts = [box((length, width, slab), (0.0, 0.0, (height - slab) / 2))]
    breadth = width if rng.random() < 0.6 else min(leg, 0.4 * width)
    for x in (-1, 1):
        for y in (-1, 1) if breadth < width else (0,):
            place = (x * (length - leg) / 2, y * (width - breadth) / 2, -slab / 2)
            parts.append(box((leg, breadth, height - slab), place))
    return parts


def _dumbbell(rng: np.random.Generator) -> list[Part]:
    """Two heads on a grip."""
    radius, length = rng.uniform(0.005, 0.014), rng.uniform(0.05, 0.11)
    parts = [Part(shape="cylinder", size=(radius, length / 2), quaternion=LYING)]
    for s in (-1, 1):
        head = rng.uniform(1.3, 2.4) * radius
        if rng.random() < 0.5:
            thick = rng.uniform(0.005, 0.015)
            part = Part(
                shape="cylinder", size=(head, thick), position=(s * length / 2, 0.0, 0.0), quaternion=LYING
            )
        else:
            part = Part(shape="ellipsoid", size=(1.2 * head, head, head), position=(s * length / 2, 0.0, 0.0))
        parts.append(part)
    return parts


def _pan(rng: np.random.Generator) -> list[Part]:
    """A ring on a floor, with a handle: pans, sieves, magnifying glasses."""
    radius, height = rng.uniform(0.02, 0.045), rng.uniform(0.012, 0.03)
    parts = ring(radius, rng.uniform(0.003, 0.007), height, n=_AROUND)
    if rng.random() < 0.7:
        parts.append(
            Part(shape="cylinder", size=(0.95 * radius, 0.002), position=(0.0, 0.0, 0.002 - height / 2))
        )
    handle = rng.uniform(0.03, 0.09)
    parts.append(
        box(
            (handle, rng.uniform(0.008, 0.018), rng.uniform(0.4, 1.0) * height),
            (radius + handle / 2 - 0.004, 0.0, 0.0),
        )
    )
    return parts


HOLLOW_FAMILIES: dict[Family, float] = {
    _bowl: 1.5,
    _cup: 1.5,
    _open_box: 1,
    _channel: 1,
    _beam: 1,
    _tube: 1,
    _hook: 1,
    _arc: 1,
    _wedge: 1,
    _bridge: 1,
    _dumbbell: 1,
    _pan: 1,
}
"""Families and how often each is drawn."""
