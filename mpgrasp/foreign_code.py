"""Runs what a plug-in does when it is imported and made, so that it can neither end, stop nor move us.

A plug-in's module is foreign code: it may exit, wait for ever, change the working directory or print. Each is
said in one line that names the plug-in. What hangs in Python ends as an error after `load_limit()` seconds.
What hangs in C and never returns to Python can only be ended with the process: a command of mpgrasp then says
so and ends with exit code 2.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, redirect_stdout
from typing import Any, NoReturn

from mpgrasp.exceptions import ConfigError

LOAD_LIMIT = 120.0
"""Wall-clock time that the import of a plug-in may take, and again its constructor [s]."""
LIMIT_VARIABLE = "MPGRASP_LOAD_LIMIT"
"""Environment variable with another limit [s], for plug-ins that compile for longer."""
GRACE = 10.0
"""Time after the limit at which a command ends that hangs in C [s]."""

_EXIT = os._exit
_AGAIN = 0.5  # [s], until somebody who has caught the error of the limit is told again


class TimeLimitError(ConfigError):
    """Foreign code takes longer than `load_limit()`."""


class _Late(BaseException):
    """The limit is over; no Exception, so that `except Exception` in a plug-in does not swallow it."""


class _Left(BaseException):
    """`os._exit` was called."""


def load_limit() -> float:
    """Return the limit in use [s].

    Raises:
        ConfigError: a variable of the environment that is no time.
    """
    text = os.environ.get(LIMIT_VARIABLE)
    try:
        limit = LOAD_LIMIT if text is None else float(text)
    except ValueError:
        limit = -1.0
    if not 0 < limit < float("inf"):
        raise ConfigError(f"unusable {LIMIT_VARIABLE} [s]", got=text, allowed="a number above 0")
    return limit


@contextmanager
def contained(what: str, path: str) -> Iterator[None]:
    """Run a block of foreign code; its prints go to standard error.

    Args:
        what: happens in it, such as "the import of a detector plug-in".
        path: name of the plug-in, for errors.

    Raises:
        ConfigError: it exits or interrupts.
        TimeLimitError: it takes longer than `load_limit()`.
    """
    limit, before, typed = load_limit(), working_directory(), [signal.SIGINT]
    try:
        with ExitStack() as traps:
            typed = traps.enter_context(_interrupts())
            traps.enter_context(redirect_stdout(sys.stderr))
            traps.enter_context(_no_exit())
            traps.enter_context(_time_limit(limit, f"{what} hangs; got {path!r}"))
            yield
    except SystemExit as error:
        _refuse(f"{what} ends the program: sys.exit({error.code!r})", path, error)
    except _Left as error:
        _refuse(f"{what} ends the program: os._exit({error.args[0]!r})", path, error)
    except _Late as error:
        allowed = f"less, or {LIMIT_VARIABLE}=SECONDS"
        raise TimeLimitError(f"{what} takes longer than {limit:g} s", got=path, allowed=allowed) from error
    except KeyboardInterrupt as error:
        if typed:
            raise
        _refuse(f"{what} raises KeyboardInterrupt, which nobody has typed", path, error)
    finally:
        _go_back(before, what, path)


def _refuse(wrong: str, path: str, error: BaseException) -> NoReturn:
    raise ConfigError(wrong, got=path, allowed="a module that only defines its classes") from error


def working_directory() -> str | None:
    """Return the working directory; None where it was deleted."""
    try:
        return os.getcwd()
    except FileNotFoundError:
        return None


def _go_back(before: str | None, what: str, path: str) -> None:
    """Go back to the working directory, from which files are named, and say so."""
    after = working_directory()
    if before is not None and after != before:
        os.chdir(before)
        print(
            f"mpgrasp: note: {what} ({path}) changed the working directory to {after}; it is changed back",
            file=sys.stderr,
        )


@contextmanager
def _interrupts() -> Iterator[list[signal.Signals]]:
    """Yield a list that has an entry once Ctrl-C was typed, where that is what KeyboardInterrupt means."""
    typed: list[signal.Signals] = []
    handler = signal.getsignal(signal.SIGINT)
    if not _in_main_thread() or handler is signal.SIG_IGN:  # Ctrl-C does not come here
        yield typed
        return
    if handler is not signal.default_int_handler:
        yield [signal.SIGINT]  # who knows
        return

    def interrupt(number: int, frame: Any) -> NoReturn:
        typed.append(signal.Signals(number))
        raise KeyboardInterrupt

    signal.signal(signal.SIGINT, interrupt)
    try:
        yield typed
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)


@contextmanager
def _no_exit() -> Iterator[None]:
    """Let `os._exit` raise an error in this process; its forks, which end by it, keep it."""
    here = os.getpid()

    def leave(status: int) -> NoReturn:
        if os.getpid() != here:
            _EXIT(status)
        raise _Left(status)

    os._exit = leave
    try:
        yield
    finally:
        os._exit = _EXIT


@contextmanager
def _time_limit(limit: float, hangs: str) -> Iterator[None]:
    """Raise `_Late` in the block after a time [s], in the main thread unless it has an alarm already."""
    last = threading.Timer(limit + GRACE, _give_up, (hangs, limit))
    last.daemon = True
    alarmed = _in_main_thread() and not signal.getitimer(signal.ITIMER_REAL)[0]
    running, told = [True], []

    def late(number: int, frame: Any) -> None:
        if running:  # else the block has just ended
            told.append(number)
            raise _Late

    if _is_command():
        last.start()
    before = signal.signal(signal.SIGALRM, late) if alarmed else None
    try:
        if alarmed:
            signal.setitimer(signal.ITIMER_REAL, limit, _AGAIN)
        yield
        if told:  # and it was swallowed
            raise _Late
    finally:
        running.clear()
        if alarmed:
            signal.setitimer(signal.ITIMER_REAL, 0)
            signal.signal(signal.SIGALRM, before)
        last.cancel()


def _give_up(hangs: str, limit: float) -> None:
    """End a command that hangs where Python cannot reach it."""
    allowed = f"less than {limit:g} s, or {LIMIT_VARIABLE}=SECONDS"
    os.write(2, f"mpgrasp: error: {hangs}; allowed: {allowed}\n".encode(errors="replace"))
    _EXIT(2)


def _in_main_thread() -> bool:
    return threading.current_thread() is threading.main_thread()


def _is_command() -> bool:
    """True in the process of `python -m mpgrasp....`, which has nothing to lose while it loads."""
    spec = getattr(sys.modules.get("__main__"), "__spec__", None)
    return spec is not None and str(spec.name).startswith("mpgrasp.")
