"""Laws about what a controller keeps: nothing from episode to episode but what its seed decides."""

from __future__ import annotations

import io
from contextlib import redirect_stdout
from functools import partial
from itertools import islice

import numpy as np

from mpgrasp.check.controller_subject import FAR, NEAR, ControllerSubject
from mpgrasp.check.flight import T_TCP_CAMERA, Flight, fly, observations, view_of
from mpgrasp.check.laws import Broken, Law
from mpgrasp.check.running import same_in_a_thread, time_of
from mpgrasp.guards.asking import ask_final_grasp
from mpgrasp.linear_algebra import product

_LOOKS = 5


def _name(subject: ControllerSubject) -> str:
    name = getattr(subject.controller, "name", None)
    if not isinstance(name, str) or not name:
        raise Broken(f'it has no name: write `name = "mine"` into the class (name is {name!r})')
    return name


def _different(first: Flight, second: Flight) -> str | None:
    """Return in words where two reaches differ; None where they are equal bit for bit."""
    for tick, (a, b) in enumerate(zip(first.commands, second.commands, strict=False)):
        if not np.array_equal(a.twist, b.twist) or a.gripper != b.gripper or bool(a.done) != bool(b.done):
            return f"tick {tick}: {np.round(a.twist, 4).tolist()}, then {np.round(b.twist, 4).tolist()}"
    if len(first.commands) != len(second.commands):
        return f"{len(first.commands)} ticks, then {len(second.commands)}"
    one, two = first.grasp, second.grasp
    if (one is None) != (two is None):
        return "a grasp and none"
    if one is not None and two is not None and not np.array_equal(one.position, two.position):
        return f"grasps at {np.round(one.position, 3).tolist()} and {np.round(two.position, 3).tolist()}"
    return None


def _again(subject: ControllerSubject) -> str:
    found = _different(subject.over_peak, fly(subject.controller, NEAR))
    if found:
        raise Broken(
            f"the same world and seed give another reach the second time ({found}): draw random numbers from "
            f"numpy.random.default_rng(seed), made in reset, and forget all of the last episode there"
        )
    return "the same world and seed give the same reach, bit for bit"


def _forgets(subject: ControllerSubject) -> str:
    first = subject.over_peak
    fly(subject.controller, FAR, seed=7)
    found = _different(first, fly(subject.controller, NEAR))
    if found:
        raise Broken(
            f"after another episode the same one goes otherwise ({found}): it keeps something from episode "
            f"to episode; forget all of it in reset"
        )
    subject.controller.reset(0)
    if ask_final_grasp(subject.controller) is not None:
        raise Broken("right after reset, before any view, final_grasp returns a grasp of the last episode")
    return "an episode before changes nothing in the next"


def _fresh(subject: ControllerSubject) -> str:
    found = _different(subject.over_peak, fly(subject.make(), NEAR))
    if found:
        raise Broken(
            f"a new one, as every worker process makes, reaches otherwise ({found}): results would depend on "
            f"--workers; keep nothing on the class or in the module"
        )
    return "a new one, as every worker makes, reaches alike"


def _view_is_kept(subject: ControllerSubject) -> str:
    subject.controller.reset(0)
    for tick, (seen, _) in enumerate(observations(subject.controller, [NEAR])):
        view, shown = seen.grasp_map, view_of([NEAR], product(seen.T_world_tcp, T_TCP_CAMERA))
        for name in ("quality", "angle", "width", "depth", "T_world_camera"):
            if not np.array_equal(getattr(view, name), getattr(shown, name)):
                raise Broken(
                    f"update writes into the observation's {name}, which is recorded: work on a copy"
                )
        if tick == _LOOKS:
            break
    return "the observation is not written into"


def _silent(subject: ControllerSubject) -> str:
    text = io.StringIO()
    subject.controller.reset(0)
    with redirect_stdout(text):
        for tick, _ in enumerate(observations(subject.controller, [NEAR])):
            if tick == _LOOKS:
                break
    if text.getvalue():
        raise Broken(
            f"update prints ({text.getvalue().strip()[:40]!r}): use logging, a run has thousands of ticks"
        )
    return "nothing is printed"


def _thread(subject: ControllerSubject) -> str:
    same_in_a_thread(lambda: fly(subject.controller, NEAR), _different)
    return "another thread sees the same reach"


def _latency(subject: ControllerSubject) -> str:
    subject.controller.reset(0)
    ticks = islice(observations(subject.controller, [NEAR]), _LOOKS)
    return time_of((partial(subject.controller.update, seen) for seen, _ in ticks), "an update")


FIRST: tuple[Law[ControllerSubject], ...] = (Law(name="name", check=_name),)
"""Before all others."""
LAWS: tuple[Law[ControllerSubject], ...] = (
    Law(name="same seed, same reach", check=_again),
    Law(name="reset forgets", check=_forgets),
    Law(name="a new one reaches alike", check=_fresh),
    Law(name="view left as it is", check=_view_is_kept),
    Law(name="prints nothing", must=False, check=_silent),
    Law(name="in another thread", must=False, check=_thread),
    Law(name="fast enough", must=False, check=_latency),
)
"""In the order in which they are tried."""
