"""What a plug-in does when it is imported and made can neither end, stop nor move the program."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from bad_plug_ins import LOADED, SOUND_CONTROLLER, SOUND_DETECTOR, BadPlugIn

import mpgrasp
from mpgrasp.bench.__main__ import main
from mpgrasp.exceptions import ConfigError
from mpgrasp.foreign_code import LIMIT_VARIABLE, LOAD_LIMIT, contained, load_limit
from mpgrasp.plugins import load_controller, load_detector

ROOT = Path(mpgrasp.__file__).parents[1]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of a user's modules, from which mpgrasp is called."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setenv(LIMIT_VARIABLE, "0.3")
    return tmp_path


def load(bad: BadPlugIn, name: str) -> None:
    if bad.kind == "detector":
        load_detector(name)
    else:
        load_controller(name)


@pytest.mark.parametrize("name", LOADED)
def test_a_plug_in_that_cannot_be_loaded_is_refused_in_words(name: str, folder: Path) -> None:
    bad = LOADED[name]
    given_as = bad.write(folder, f"loaded_{name.replace('-', '_')}")
    clock = time.monotonic()
    with pytest.raises(ConfigError, match=bad.said) as refused:
        load(bad, given_as)
    assert "allowed: " in str(refused.value)
    assert time.monotonic() - clock < 10
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


def test_sound_plug_ins_are_loaded_and_every_trap_is_taken_away(folder: Path) -> None:
    exit_, interrupt, alarm = os._exit, signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGALRM)
    (folder / "sound_d.py").write_text(SOUND_DETECTOR)
    (folder / "sound_c.py").write_text(SOUND_CONTROLLER)
    assert load_detector("sound_d:Sound").name == "sound"
    assert load_controller("sound_c:Sound").name == "sound"
    assert os._exit is exit_
    assert signal.getsignal(signal.SIGINT) is interrupt
    assert signal.getsignal(signal.SIGALRM) is alarm


def test_a_plug_in_that_changes_the_directory_and_prints_does_neither(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    moves = f"import os\nos.chdir('/')\nprint('hello')\n{SOUND_DETECTOR}"
    (folder / "moves.py").write_text(moves)
    load_detector("moves:Sound")
    assert Path.cwd() == folder
    printed = capsys.readouterr()
    assert printed.out == ""
    assert "hello" in printed.err
    assert "(moves:Sound) changed the working directory to /; it is changed back" in printed.err


def test_in_another_thread_there_is_no_alarm_and_all_else_holds(folder: Path) -> None:
    caught: list[BaseException] = []
    bad = LOADED["exits"]
    name = bad.write(folder, "in_a_thread")

    def work() -> None:
        try:
            load(bad, name)
        except BaseException as error:
            caught.append(error)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert isinstance(caught[0], ConfigError)


def type_ctrl_c() -> None:
    with contained("the import of a plug-in", "m:C"):
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(5)


def test_ctrl_c_that_somebody_types_is_no_error() -> None:
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            type_ctrl_c()
    finally:
        signal.signal(signal.SIGINT, before)


def test_a_fork_may_end_as_forks_do() -> None:
    with contained("the import of a plug-in", "m:C"):
        pid = os.fork()
        if pid == 0:
            os._exit(7)
        assert os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == 7


def test_the_limit_is_two_minutes_unless_the_environment_says_else(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(LIMIT_VARIABLE, raising=False)
    assert load_limit() == LOAD_LIMIT == 120
    monkeypatch.setenv(LIMIT_VARIABLE, "600")
    assert load_limit() == 600
    for wrong in ("", "soon", "0", "-1", "inf", "nan"):
        monkeypatch.setenv(LIMIT_VARIABLE, wrong)
        with pytest.raises(ConfigError, match=f"unusable {LIMIT_VARIABLE}"):
            load_limit()


@pytest.mark.parametrize("name", ["exits", "exits-hard", "hangs", "by-file"])
def test_the_benchmark_says_it_in_one_line_and_ends_with_code_2(
    name: str, folder: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    bad = LOADED[name]
    given_as = bad.write(folder, f"benched_{name.replace('-', '_')}")
    assert main(["thin", "--detector", given_as, "--episodes", "1", "--quiet"]) == 2
    lines = capfd.readouterr().err.strip().splitlines()
    assert len(lines) == 1
    assert lines[0].startswith("mpgrasp: error: ")
    assert not (folder / "runs").exists()


def test_a_relative_folder_of_results_stays_where_it_was_named(
    folder: Path, fake_world: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    (folder / "moves_on.py").write_text(f"import os\nos.chdir('/')\n{SOUND_DETECTOR}")
    fake_world.setenv(LIMIT_VARIABLE, "60")
    words = ["thin", "--detector", "moves_on:Sound", "--controller", "fakes:FakeController", "--workers", "0"]
    assert main([*words, "--episodes", "2", "--quiet", "--out", "here"]) == 0
    assert (folder / "here" / "episodes.jsonl").exists()


def test_a_command_that_hangs_in_c_ends_all_the_same(tmp_path: Path) -> None:
    """`pthread_mutex_lock` of a mutex that is locked already: no signal handler of Python ever runs."""
    (tmp_path / "stuck.py").write_text(
        "import ctypes\nlibc = ctypes.CDLL(None)\nmutex = ctypes.create_string_buffer(64)\n"
        "libc.pthread_mutex_lock(mutex)\nlibc.pthread_mutex_lock(mutex)\n"
    )
    start = (
        "import mpgrasp.foreign_code as f, runpy, sys; f.GRACE = 0.3; "
        "sys.argv = ['bench', 'thin', '--detector', 'stuck:Bad', '--episodes', '1']; "
        "sys.modules['__main__'].__spec__ = __import__('importlib.util').util.find_spec('mpgrasp.bench'); "
        "from mpgrasp.bench.__main__ import main; sys.exit(main())"
    )
    environment = {**os.environ, "PYTHONPATH": f"{ROOT}:{tmp_path}", LIMIT_VARIABLE: "0.3"}
    done = subprocess.run(
        [sys.executable, "-c", start],
        capture_output=True,
        text=True,
        env=environment,
        cwd=tmp_path,
        timeout=60,
    )
    assert done.returncode == 2, done.stderr
    assert "the import of a detector plug-in hangs; got 'stuck:Bad'" in done.stderr
