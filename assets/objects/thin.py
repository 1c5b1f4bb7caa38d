"""The set of thin objects; millimetres and grams."""

from __future__ import annotations

import numpy as np
from shapes import Declared, box, hull, ring, rod


def usb_stick() -> Declared:
    """USB-A flash drive."""
    return Declared(
        [box(44, 18, 8), box(14, 12, 4.5, (29, 0, 0))],
        10,
        0.6,
        (0.16, 0.17, 0.20),
        "USB-A flash drive: plug 12 x 4.5 mm as in the USB 2.0 specification, body 44 x 18 x 8 mm; 10 g",
    )


def key() -> Declared:
    """Door key lying flat."""
    bow = ring((4, 4), (13, 13), -2.5, 2.5)
    return Declared(
        [*bow, box(34, 8, 2.4, (28.5, 0, 0)), box(16, 3, 2.4, (35, -5, 0))],
        14,
        0.5,
        (0.72, 0.70, 0.62),
        "door key with a plastic bow of 26 x 5 mm, blade 2.4 mm thick; 14 g",
    )


def ruler() -> Declared:
    """School ruler."""
    return Declared(
        [box(200, 28, 3)],
        12,
        0.5,
        (0.80, 0.66, 0.42),
        "wooden school ruler, 200 x 28 x 3 mm, 700 kg/m3; 12 g",
    )


def pen() -> Declared:
    """Ballpoint pen with clip."""
    parts = [rod("cylinder", 5, 122, axis="x"), box(38, 2.5, 2.5, (-38, 0, 6.0))]
    tip = np.array(
        [(x, r * np.cos(a), r * np.sin(a)) for x, r in ((61, 5), (75, 1)) for a in np.arange(16) * np.pi / 8]
    )
    return Declared(
        [*parts, hull(tip)],
        11,
        0.5,
        (0.10, 0.16, 0.42),
        "ballpoint pen, 136 x 10 mm with clip; 11 g",
        rolls=True,
    )


def card_stack() -> Declared:
    """Banded stack of bank cards."""
    return Declared(
        [box(85.6, 54, 6.1)],
        41,
        0.5,
        (0.82, 0.80, 0.86),
        "eight ISO/IEC 7810 ID-1 cards, 85.6 x 54 x 0.76 mm each, banded to one block; 41 g",
    )


def washer() -> Declared:
    """Large steel washer."""
    return Declared(
        ring((10.5, 10.5), (18.5, 18.5), -1.5, 1.5),
        17,
        0.5,
        (0.62, 0.63, 0.65),
        "M20 washer as in ISO 7089: 37 x 21 x 3 mm steel; 17 g",
    )


def plate_brick() -> Declared:
    """Flat toy brick with studs."""
    studs = [rod("cylinder", 2.4, 1.7, (x, y, 2.45)) for x in (-12, -4, 4, 12) for y in (-4, 4)]
    return Declared(
        [box(31.8, 15.8, 3.2), *studs],
        2.2,
        0.6,
        (0.78, 0.12, 0.10),
        "2 x 4 toy brick plate, pitch 8 mm, 3.2 mm + studs; 2.2 g",
    )
