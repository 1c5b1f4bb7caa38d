"""Ways of running what is tried: in another thread, and by the clock."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable
from typing import TypeVar

import numpy as np

from mpgrasp.check.laws import Broken
from mpgrasp.episode.config import EpisodeConfig

Answer = TypeVar("Answer")
THREAD_LIMIT = 60.0
"""Time after which what runs in a thread is taken for hung [s]."""


def same_in_a_thread(run: Callable[[], Answer], different: Callable[[Answer, Answer], str | None]) -> None:
    """Raise Broken unless something answers alike in another thread than this one.

    Args:
        run: what is to answer.
        different: says in words where two answers differ; None where they do not.
    """
    here = run()
    there: list[Answer] = []
    errors: list[BaseException] = []

    def elsewhere() -> None:
        try:
            there.append(run())
        except BaseException as error:
            errors.append(error)

    thread = threading.Thread(target=elsewhere, daemon=True)
    thread.start()
    thread.join(THREAD_LIMIT)
    if errors:
        found: str | None = f"it raises {errors[0]!r}"
    else:
        found = different(here, there[0]) if there else "it hangs"
    if found:
        raise Broken(
            f"in another thread than the one that made it: {found}; environments on threads need that"
        )


def time_of(calls: Iterable[Callable[[], object]], what: str) -> str:
    """Return in words the median time of calls, which must be within a control tick.

    Raises:
        Broken: it is longer.
    """
    seconds = []
    for call in calls:
        clock = time.perf_counter()
        call()
        seconds.append(time.perf_counter() - clock)
    median, tick = float(np.median(seconds)), EpisodeConfig().control_dt
    if median > tick:
        raise Broken(
            f"{what} takes {1e3 * median:.0f} ms, longer than a control tick of {1e3 * tick:.0f}: simulated "
            f"time waits for it, a robot would not"
        )
    return f"{what} takes {1e3 * median:.1f} ms of a control tick of {1e3 * tick:.0f}"
