"""Laws about a controller's motion, and about the grasp it chooses where the best one is known."""

from __future__ import annotations

import numpy as np

from mpgrasp.check.controller_subject import FAR, NEAR, ControllerSubject
from mpgrasp.check.flight import Flight, Peak, fly
from mpgrasp.check.laws import Broken, Law, Skipped
from mpgrasp.controllers.controller import remembers_failures
from mpgrasp.episode.config import FER_REFLEXES, EpisodeConfig
from mpgrasp.geometry import wrap_half_pi
from mpgrasp.grasp import Grasp
from mpgrasp.robot.hand import FINGERTIP_BEYOND_TCP
from mpgrasp.workspace import WORKSPACE_CENTRE, WORKSPACE_REACH

PLACE = 0.02
"""Most that the chosen grasp may lie off the only one [m]: half of the opening that it asks for."""
ANGLE = np.deg2rad(30)
"""Most that its closing direction may be off; the tolerance of the rectangle metric (Jiang et al. 2011)."""
WIDTH = 0.5
"""Most that its opening may be off, as a share."""
PATHS = 0.05
"""Most that the paths in mirrored worlds may differ by, mirrored back, on average [m]."""


def _form(subject: ControllerSubject) -> str:
    flights = subject.over_peak, subject.over_nothing, fly(subject.controller, blind=True)
    ticks = sum(len(flight.commands) for flight in flights)
    return f"{ticks} commands over a peak, an empty table and a blind camera are finite and in range"


def _limits(subject: ControllerSubject) -> str:
    speeds, rates = zip(
        *(_speeds(flight) for flight in (subject.over_peak, subject.over_nothing)), strict=True
    )
    speed, rate = max(speeds), max(rates)
    if speed > FER_REFLEXES.cartesian_velocity or rate > FER_REFLEXES.cartesian_rotation:
        raise Broken(
            f"it asks for up to {speed:.2f} m/s and {rate:.2f} rad/s; beyond "
            f"{FER_REFLEXES.cartesian_velocity:g} m/s or {FER_REFLEXES.cartesian_rotation:g} rad/s the robot "
            f"stops by itself"
        )
    return f"up to {speed:.2f} m/s and {rate:.2f} rad/s"


def _speeds(flight: Flight) -> tuple[float, float]:
    """Return the greatest linear [m/s] and angular speed [rad/s] of a reach."""
    twists = np.array([command.twist for command in flight.commands], float)
    return float(np.linalg.norm(twists[:, :3], axis=1).max()), float(
        np.linalg.norm(twists[:, 3:], axis=1).max()
    )


def _table(subject: ControllerSubject) -> str:
    lowest = min(float(f.positions[:, 2].min()) for f in (subject.over_peak, subject.over_nothing))
    if lowest < FINGERTIP_BEYOND_TCP:
        raise Broken(
            f"it comes down to {1e3 * lowest:.0f} mm above the table, and the finger tips reach "
            f"{1e3 * FINGERTIP_BEYOND_TCP:.0f} mm below the tool point: end the reach by `done` before, such "
            f"as at 0.175 m"
        )
    return f"it comes down to {lowest:.2f} m above the table, no lower"


def _ends(subject: ControllerSubject) -> str:
    limit = EpisodeConfig().max_reach_time
    for flight, where in ((subject.over_peak, "a peak"), (subject.over_nothing, "an empty table")):
        if not flight.done:
            raise Broken(
                f"over {where} it is not done after {limit:g} s, when every episode is a timeout: say "
                f"`done=True` once the tool has come down far enough"
            )
    return f"done after {len(subject.over_peak.commands)} ticks over a peak"


def _inside(subject: ControllerSubject) -> str:
    away = np.abs(subject.over_peak.positions[:, :2] - WORKSPACE_CENTRE).max()
    if away > WORKSPACE_REACH:
        raise Broken(
            f"over a peak in the middle the tool goes {away:.2f} m aside, out of the workspace of "
            f"{WORKSPACE_REACH:g} m: the arm may come near a singular posture there"
        )
    return f"over a peak in the middle the tool stays within {away:.2f} m of it"


def _planted(subject: ControllerSubject) -> str:
    offs = [_off(subject.over_peak.grasp, NEAR), _off(fly(subject.controller, FAR).grasp, FAR)]
    return f"of a lone peak the grasp is chosen, within {1e3 * max(offs):.0f} mm, at two places"


def _off(grasp: Grasp | None, peak: Peak) -> float:
    """Return how far a grasp lies from the only right one [m]."""
    where = f"one peak of quality {peak.quality:g} at x {peak.x:g}, y {peak.y:g} was in view from the start"
    if grasp is None:
        raise Broken(f"{where}, and final_grasp returns None: nothing that it sees is ever grasped")
    off = float(np.hypot(grasp.position[0] - peak.x, grasp.position[1] - peak.y))
    turn = abs(float(wrap_half_pi(grasp.angle - peak.angle)))
    if off > PLACE:
        raise Broken(
            f"{where}, and final_grasp is {1e3 * off:.0f} mm beside it (allowed: {1e3 * PLACE:.0f}): take "
            f"pixels to the world by GraspMap.grasp_at or world_points"
        )
    if turn > ANGLE:
        raise Broken(
            f"{where}, and final_grasp closes {np.rad2deg(turn):.0f} degrees off its direction (allowed: "
            f"{np.rad2deg(ANGLE):.0f}): a grasp's angle is in the world, a map's in the image; "
            f"GraspMap.grasp_at turns it"
        )
    if abs(grasp.width - peak.width) > WIDTH * peak.width:
        raise Broken(
            f"{where} with an opening of {1e3 * peak.width:.0f} mm, and final_grasp opens "
            f"{1e3 * grasp.width:.0f} mm: a grasp's width is in metres, a map's in pixels; GraspMap.grasp_at "
            f"turns it"
        )
    return off


def _empty(subject: ControllerSubject) -> str:
    grasp = subject.over_nothing.grasp
    if grasp is not None:
        raise Broken(
            f"over a table on which no view claimed anything it grasps all the same, at a quality of "
            f"{grasp.quality:.2g}; None ends the episode as no_grasp (published MVP and MP-PC grasp too)"
        )
    return "where nothing was claimed, nothing is grasped"


def _failures(subject: ControllerSubject) -> str:
    if not remembers_failures(subject.controller):
        raise Skipped(
            "it has no remember_failure(position): on a table that is being cleared it may try the same "
            "place for ever"
        )
    second = Peak(x=FAR.x, y=FAR.y, quality=0.8)
    grasp = fly(subject.controller, NEAR, second, failures=[np.array([NEAR.x, NEAR.y, 0.0])]).grasp
    if grasp is None or np.hypot(grasp.position[0] - second.x, grasp.position[1] - second.y) > PLACE:
        raise Broken("told that the better of two grasps has failed, it does not take the other one")
    return "told that the better of two grasps has failed, it takes the other"


def _mirror(subject: ControllerSubject) -> str:
    one, other = subject.over_peak, fly(subject.controller, NEAR.mirrored())
    n = min(len(one.positions), len(other.positions))
    apart = float(np.linalg.norm(one.positions[:n] - other.positions[:n] * [1, -1, 1], axis=1).mean())
    if apart > PATHS:
        raise Broken(
            f"in a mirrored world its path differs by {1e3 * apart:.0f} mm from the mirrored one on average: "
            f"it prefers a side"
        )
    return f"in a mirrored world it takes the mirrored path, within {1e3 * apart:.0f} mm"


LAWS: tuple[Law[ControllerSubject], ...] = (
    Law(name="form, range, type", check=_form),
    Law(name="within the robot's speeds", check=_limits),
    Law(name="stays above the table", check=_table),
    Law(name="comes to an end", check=_ends),
    Law(name="takes a lone peak", check=_planted),
    Law(name="stays in the workspace", must=False, check=_inside),
    Law(name="leaves an empty table", must=False, check=_empty),
    Law(name="remembers failures", must=False, check=_failures),
    Law(name="mirror symmetry", must=False, check=_mirror),
)
"""In the order in which they are tried."""
