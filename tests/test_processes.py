"""Laws of worker processes and Ctrl-C."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator

import pytest

from mpgrasp.processes import born_deaf, end_by_interrupts, ignore_interrupts, interrupts_wait


@pytest.fixture(autouse=True)
def hears_interrupts() -> Iterator[None]:
    """Who runs the tests in the background has them ignore Ctrl-C, and so would their processes."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


SPAWN = multiprocessing.get_context("spawn")


def exit_code(target: Callable[[], object], *, deaf: bool = True) -> int | None:
    """How a process ends that is interrupted before it can have imported anything."""
    process = SPAWN.Process(target=target)
    if deaf:
        with born_deaf():
            process.start()
    else:
        process.start()
    assert process.pid is not None
    os.kill(process.pid, signal.SIGINT)
    process.join(60)
    return process.exitcode


def test_an_interrupt_ends_a_process_that_hears_it_while_it_starts() -> None:
    assert exit_code(os.getpid, deaf=False) not in (0, None)


def test_a_process_that_is_born_deaf_starts_in_spite_of_an_interrupt() -> None:
    assert exit_code(os.getpid) == 0


def test_a_process_that_ignores_interrupts_from_then_on_has_forgotten_the_one_at_its_start() -> None:
    assert exit_code(ignore_interrupts) == 0


def test_a_process_that_ends_by_interrupts_ends_by_the_one_at_its_start() -> None:
    assert exit_code(end_by_interrupts) == -signal.SIGINT


def test_the_parent_hears_interrupts_again_after_the_block() -> None:
    with pytest.raises(KeyboardInterrupt), born_deaf():
        os.kill(os.getpid(), signal.SIGINT)
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, ())


def test_interrupts_inside_of_the_block_take_effect_after_it() -> None:
    done: list[str] = []

    def interrupted_work() -> None:
        with interrupts_wait():
            signal.raise_signal(signal.SIGINT)
            done.append("all of it")

    with pytest.raises(KeyboardInterrupt):
        interrupted_work()
    assert done


def test_interrupts_wait_elsewhere_than_in_the_main_thread_without_effect() -> None:
    errors: list[BaseException] = []

    def wait() -> None:
        try:
            with interrupts_wait():
                pass
        except BaseException as error:
            errors.append(error)

    thread = threading.Thread(target=wait)
    thread.start()
    thread.join()
    assert not errors
