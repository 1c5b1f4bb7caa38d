"""Options of MuJoCo for a scene in which the hand moves: who sleeps, and how far friction is solved.

What is held must not creep. MuJoCo's friction gives way a little, and a second pass takes that slip out, one
contact after the other, until the gain of a sweep is small against the inertia of the whole model. Beside an
arm of 20 kg that ends at once for a stick of 10 g. What an unfinished sweep leaves over favours the contacts
that came last: a moment that never rests, and turned a stick between the pads against the force of the
grip, by 17 degrees in a minute and faster and faster. So the pass goes on until it has converged.
"""

from __future__ import annotations

import mujoco

SLEEP_TOLERANCE = 1e-3
"""Speed below which what touches no robot falls asleep after ten steps [m/s; rotations count by an object's
size]; whatever moves and touches it wakes it, with all that it touches."""
NO_SLIP_ITERATIONS = 30
"""Most sweeps of the pass that takes the slip out of friction; a key held by an edge needs some 30."""
NO_SLIP_TOLERANCE = 1e-12
"""Gain of a sweep at which the pass has converged, in parts of the model's mean inertia."""


def set_in_motion(spec: mujoco.MjSpec) -> None:
    """Set the options of a world with the hand in it; objects settle without them, before the hand comes."""
    # what rests untouched then costs nothing: 15 us a step instead of 800 for a pile of nine on the cloth
    spec.option.enableflags |= int(mujoco.mjtEnableBit.mjENBL_SLEEP)
    spec.option.sleep_tolerance = SLEEP_TOLERANCE
    spec.option.noslip_iterations = NO_SLIP_ITERATIONS
    spec.option.noslip_tolerance = NO_SLIP_TOLERANCE
