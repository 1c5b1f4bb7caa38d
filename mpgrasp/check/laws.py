"""A law, how it is tried, and what came of it.

A law must hold: a run with a plug-in that breaks one counts what it should not. An advice should be followed:
whoever does not is slow, or is no bug but worth knowing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import StrEnum
from typing import Generic, TypeVar

from mpgrasp.exceptions import MpgraspError
from mpgrasp.foreign_code import TimeLimitError, contained

Subject = TypeVar("Subject")


class State(StrEnum):
    """Outcome of a check."""

    PASSED = "passed"
    FAILED = "failed"
    SKIPPED = "skipped"


class Broken(Exception):
    """A law does not hold; the text says why, in words for beginners."""


class Skipped(Exception):
    """There is nothing to try it on; the text says why."""


@dataclass(frozen=True, kw_only=True)
class Law(Generic[Subject]):
    """Something that must hold, or should."""

    name: str
    """Two to four words."""
    must: bool = True
    """False for an advice."""
    check: Callable[[Subject], str]
    """Returns what was found in a few words; raises Broken or Skipped."""


@dataclass(frozen=True, kw_only=True)
class Finding:
    """What came of trying a law."""

    name: str
    must: bool
    state: State
    reason: str
    """What was found, or what is wrong and what to do about it."""

    @property
    def broken(self) -> bool:
        """True for a law that does not hold."""
        return self.must and self.state is State.FAILED


def try_laws(laws: Iterable[Law[Subject]], subject: Subject, path: str) -> list[Finding]:
    """Return the findings, one a law, whatever the code at `path` does meanwhile.

    Once a check has met the time limit the others are skipped: each would wait as long.
    """
    findings: list[Finding] = []
    hung = ""
    for law in laws:
        if hung:
            reason = f'not tried after the check "{hung}" took too long'
            findings.append(Finding(name=law.name, must=law.must, state=State.SKIPPED, reason=reason))
            continue
        try:
            findings.append(_try(law, subject, path))
        except TimeLimitError as error:
            hung = law.name
            findings.append(Finding(name=law.name, must=True, state=State.FAILED, reason=str(error)))
    return findings


def _try(law: Law[Subject], subject: Subject, path: str) -> Finding:
    try:
        with contained(f'the check "{law.name}"', path):
            state, reason = State.PASSED, law.check(subject)
    except TimeLimitError:
        raise
    except Skipped as why:
        state, reason = State.SKIPPED, str(why)
    except Broken as why:
        state, reason = State.FAILED, str(why)
    except MpgraspError as error:
        state, reason = State.FAILED, str(error)
    except Exception as error:  # of the plug-in
        state, reason = State.FAILED, f"it raises {type(error).__name__}: {error}"
    return Finding(name=law.name, must=law.must, state=state, reason=" ".join(reason.split()))
