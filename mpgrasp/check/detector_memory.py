"""Laws about what a detector keeps: nothing from episode to episode, so that workers change no result."""

from __future__ import annotations

import threading
import time

import numpy as np

from mpgrasp.check.detector_subject import BAR, BOX, HEIGHTS, DetectorSubject, different
from mpgrasp.check.laws import Broken, Law
from mpgrasp.detectors.detector import prepare
from mpgrasp.episode.config import EpisodeConfig
from mpgrasp.grasp import GraspMap
from mpgrasp.guards.asking import ask_detector

_REPEATS = 5


def _again(subject: DetectorSubject) -> str:
    found = different(subject.look(BOX), subject.look(BOX))
    if found:
        raise Broken(
            f"the same frame gives another map the second time, reset in between ({found}): draw random "
            f"numbers from a generator that reset makes anew"
        )
    return "the same frame gives the same map, bit for bit"


def _forgets(subject: DetectorSubject) -> str:
    first = subject.look(BOX)
    for height in HEIGHTS:
        subject.look(BAR, height=height)
    found = different(first, subject.look(BOX))
    if found:
        raise Broken(
            f"after an episode with another object the same frame gives another map ({found}): it keeps "
            f"something from episode to episode, and results depend on who played before; forget all of it "
            f"in reset"
        )
    return "an episode before changes nothing in the next"


def _fresh(subject: DetectorSubject) -> str:
    used = subject.look(BOX)
    fresh = subject.make()
    prepare(fresh)
    subject.reset(BOX, detector=fresh)
    found = different(used, ask_detector(fresh, subject.frame(BOX)))
    if found:
        raise Broken(
            f"a new one, as every worker process makes, sees the same frame otherwise ({found}): results "
            f"would depend on --workers; keep nothing on the class or in the module, and seed what is random"
        )
    return "a new one, as every worker makes, sees the same"


def _thread(subject: DetectorSubject) -> str:
    here = subject.look(BOX)
    there: list[GraspMap | BaseException] = []

    def look() -> None:
        try:
            there.append(subject.look(BOX))
        except BaseException as error:
            there.append(error)

    thread = threading.Thread(target=look, daemon=True)
    thread.start()
    thread.join(60)
    if not there or isinstance(there[0], BaseException):
        found: str | None = f"it raises {there[0]!r}" if there else "it hangs"
    else:
        found = different(here, there[0])
    if found:
        raise Broken(
            f"in another thread than the one that made it: {found}; environments on threads need that"
        )
    return "another thread sees the same"


def _latency(subject: DetectorSubject) -> str:
    image = subject.frame(BOX)
    subject.reset(BOX)
    seconds = []
    for _ in range(_REPEATS):
        clock = time.perf_counter()
        subject.detector.predict(image)
        seconds.append(time.perf_counter() - clock)
    median, tick = float(np.median(seconds)), EpisodeConfig().control_dt
    if median > tick:
        raise Broken(
            f"a frame takes {1e3 * median:.0f} ms, longer than a control tick of {1e3 * tick:.0f}: simulated "
            f"time waits for it, a robot would not"
        )
    return f"a frame takes {1e3 * median:.1f} ms of a control tick of {1e3 * tick:.0f}"


LAWS: tuple[Law[DetectorSubject], ...] = (
    Law(name="same frame, same map", check=_again),
    Law(name="reset forgets", check=_forgets),
    Law(name="a new one sees the same", check=_fresh),
    Law(name="in another thread", must=False, check=_thread),
    Law(name="fast enough", must=False, check=_latency),
)
"""In the order in which they are tried."""
