"""Laws about the units and directions of grasps, by boxes of which the answer is known."""

from __future__ import annotations

import numpy as np

from mpgrasp.check.detector_subject import BAR, BOX, CLAIMED, HEIGHTS, DetectorSubject
from mpgrasp.check.laws import Broken, Law
from mpgrasp.check.solids import Box
from mpgrasp.geometry import wrap_half_pi
from mpgrasp.grasp import Grasp

ANGLE = np.deg2rad(30)
"""Most that a closing direction may be off; the tolerance of the rectangle metric (Jiang et al. 2011)."""
OPENINGS = (0.8, 3.5)
"""Opening over the breadth of the bar. With less, a finger comes down on it, a network's error left aside;
this hand, fully open, has 2.7."""
AMPLE = 2.4
"""Opening over the breadth of the bar beyond which it is worth a look; those that ship ask for less."""
SPREAD = 1.6
"""Most that the openings of one bar, each the median under `YAWS`, may differ by between heights, as a ratio.
Openings in millimetres, or in pixels of one height for all, differ by 1.96 there; those of the networks that
ship by up to 1.4."""
BESIDE = 0.015
"""Most that a grasp may lie beside what it grasps [m]."""
YAWS = (0.0, 0.9, -1.2)
"""Headings of the camera [rad]."""
ASIDE = Box(x=0.53, y=0.05, yaw=0.7, length=0.05, breadth=0.025, height=0.03)
"""A box off the middle, and askew; along its length one grasp is as good as the next."""


def _sees(subject: DetectorSubject) -> str:
    found = [float(subject.look(BOX, height=height).quality.max()) for height in HEIGHTS]
    words = ", ".join(f"{quality:.2f}" for quality in found)
    if min(found) < CLAIMED:
        raise Broken(
            f"a plain box of 60 x 30 x 30 mm has a best quality of {words} from {len(HEIGHTS)} heights; a "
            f"detector that never claims more than {CLAIMED:g} leads the robot nowhere"
        )
    return f"a plain box has a best quality of {words} from {len(HEIGHTS)} heights"


def _place(subject: DetectorSubject) -> str:
    offs = [_beside(subject.best(BAR, height=height), BAR) for height in HEIGHTS]
    if max(offs) > BESIDE:
        raise Broken(
            f"the best grasp of a lone bar lies {1e3 * max(offs):.0f} mm beside it (allowed: "
            f"{1e3 * BESIDE:.0f}): rows and columns may be swapped, or the map is shifted against its image"
        )
    return f"the best grasp of a lone bar lies on it, from {len(HEIGHTS)} heights"


def _beside(grasp: Grasp, box: Box) -> float:
    """Return the distance of a grasp from the footprint of a box [m], 0 on it."""
    offset = box.local(grasp.position[0] - box.x, grasp.position[1] - box.y)
    beyond = np.abs(np.array(offset, float)) - np.array([box.length, box.breadth]) / 2
    return float(np.linalg.norm(np.maximum(beyond, 0.0)))


def _openings(subject: DetectorSubject) -> list[float]:
    """Return the openings for the bar at each height, each the median under `YAWS` [m]."""
    return [
        float(np.median([subject.best(BAR, height=height, yaw=yaw).width for yaw in YAWS]))
        for height in HEIGHTS
    ]


def _ample(subject: DetectorSubject) -> str:
    widest, breadth = max(_openings(subject)), BAR.breadth
    if widest > AMPLE * breadth:
        raise Broken(
            f"a bar {1e3 * breadth:.0f} mm broad is to be grasped with an opening of {1e3 * widest:.0f} mm: "
            f"is it counted twice? A hand that opens this far needs room, and hits what stands beside"
        )
    return f"a bar {1e3 * breadth:.0f} mm broad needs no opening above {1e3 * widest:.0f} mm"


def _width(subject: DetectorSubject) -> str:
    openings = _openings(subject)
    words = ", ".join(f"{1e3 * opening:.0f}" for opening in openings)
    low, high = (share * BAR.breadth for share in OPENINGS)
    if not low <= min(openings) <= max(openings) <= high:
        raise Broken(
            f"a bar {1e3 * BAR.breadth:.0f} mm broad is to be grasped with openings of {words} mm from "
            f"cameras {_heights()} m high (allowed: {1e3 * low:.0f} to {1e3 * high:.0f}): `width` is the "
            f"whole opening in pixels of the map, metres times intrinsics.fx / depth"
        )
    if max(openings) > SPREAD * min(openings):
        raise Broken(
            f"one bar is to be grasped with openings of {words} mm from cameras {_heights()} m high, which "
            f"differ by more than a factor {SPREAD:g}: `width` is in pixels of the map, so it grows as the "
            f"camera comes nearer"
        )
    return f"a bar {1e3 * BAR.breadth:.0f} mm broad: openings of {words} mm from {_heights()} m"


def _heights() -> str:
    return ", ".join(f"{height:g}" for height in HEIGHTS)


def _angle(subject: DetectorSubject) -> str:
    offs = [float(wrap_half_pi(subject.best(BAR, yaw=yaw).angle - BAR.across)) for yaw in YAWS]
    words = ", ".join(f"{np.rad2deg(off):.0f}" for off in offs)
    if max(map(abs, offs)) > ANGLE:
        raise Broken(
            f"the fingers close {words} degrees off the right direction on a bar seen under {len(YAWS)} "
            f"headings (allowed: {np.rad2deg(ANGLE):.0f}, modulo half a turn): `angle` is the direction in "
            f"which they close, in radians, counter-clockwise as one looks at the image; {_guess(offs)}"
        )
    return f"{words} degrees off the right direction on a bar, under {len(YAWS)} headings of the camera"


def _guess(offs: list[float]) -> str:
    """Return what may be wrong with angles that are off by so much [rad]."""
    if all(abs(abs(off) - np.pi / 2) < ANGLE for off in offs):
        return "yours looks like the direction along the bar: add pi / 2"
    return "yours may be clockwise (v points down: negate it), in degrees, or in another frame"


def _mirror(subject: DetectorSubject) -> str:
    one, other = subject.best(ASIDE), subject.best(ASIDE.mirrored())
    off = float(np.hypot(one.position[0] - other.position[0], one.position[1] + other.position[1]))
    turn = abs(float(wrap_half_pi(one.angle + other.angle)))
    if off > ASIDE.length / 2 or turn > ANGLE:
        raise Broken(
            f"in a mirrored image the best grasp lies {1e3 * off:.0f} mm and {np.rad2deg(turn):.0f} degrees "
            f"from where the mirrored one is: it prefers a side (networks do, a little; more augmentation "
            f"helps)"
        )
    return (
        f"a mirrored image has the mirrored grasp, {1e3 * off:.0f} mm and {np.rad2deg(turn):.0f} degrees off"
    )


LAWS: tuple[Law[DetectorSubject], ...] = (
    Law(name="sees a plain box", check=_sees),
    Law(name="place of the grasp", check=_place),
    Law(name="unit of the width", check=_width),
    Law(name="direction of the angle", check=_angle),
    Law(name="opening no wider than needed", must=False, check=_ample),
    Law(name="mirror symmetry", must=False, check=_mirror),
)
"""In the order in which they are tried."""
