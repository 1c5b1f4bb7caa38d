"""Laws about what a detector keeps: nothing from episode to episode, so that workers change no result."""

from __future__ import annotations

from mpgrasp.check.detector_subject import BAR, BOX, HEIGHTS, DetectorSubject, different
from mpgrasp.check.laws import Broken, Law
from mpgrasp.check.running import same_in_a_thread, time_of
from mpgrasp.detectors.detector import prepare
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
    same_in_a_thread(lambda: subject.look(BOX), different)
    return "another thread sees the same"


def _latency(subject: DetectorSubject) -> str:
    image = subject.frame(BOX)
    subject.reset(BOX)
    return time_of([lambda: subject.detector.predict(image)] * _REPEATS, "a frame")


LAWS: tuple[Law[DetectorSubject], ...] = (
    Law(name="same frame, same map", check=_again),
    Law(name="reset forgets", check=_forgets),
    Law(name="a new one sees the same", check=_fresh),
    Law(name="in another thread", must=False, check=_thread),
    Law(name="fast enough", must=False, check=_latency),
)
"""In the order in which they are tried."""
