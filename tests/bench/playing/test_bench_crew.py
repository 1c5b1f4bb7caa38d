from __future__ import annotations

import json
import os
import subprocess
import sys
import textwrap
import time
from pathlib import Path
from typing import Any

import fakes
import numpy as np
import pytest
from bench_plans import CONTROLLER, DETECTOR, lines_of, make_plan, without_timing

from mpgrasp.bench.playing.player import Player
from mpgrasp.exceptions import ConfigError, WeightsError
from mpgrasp.files.json_values import difference, json_value
from mpgrasp.plugins import load_controller, load_detector
from mpgrasp.suite import episode_seed


def test_lines_say_which_episode_they_are() -> None:
    line = lines_of(make_plan(seed=7))[2]
    assert (line.suite, line.seed, line.episode) == ("thin", 7, 2)
    assert (line.detector, line.controller) == (DETECTOR, CONTROLLER)
    assert line.scene_seed == episode_seed("thin", 7, 2)


def test_every_cell_meets_the_same_scenes() -> None:
    lines = lines_of(make_plan(controllers=(CONTROLLER, "fakes:OtherController")))
    assert [line.episode for line in lines] == [0, 0, 1, 1, 2, 2, 3, 3]
    for a, b in zip(lines[::2], lines[1::2], strict=True):
        assert a.controller != b.controller
        assert a.scene_seed == b.scene_seed


def test_two_runs_differ_in_timing_alone() -> None:
    first, second = lines_of(make_plan()), lines_of(make_plan())
    assert first != second
    assert without_timing(first) == without_timing(second)


def test_workers_change_no_line() -> None:
    plan = make_plan(episodes=6)
    alone = without_timing(lines_of(plan))
    together = without_timing(lines_of(plan, fakes.slow_first_episode, workers=2))
    assert sorted(together) == sorted(alone)


def test_workers_do_not_outlive_a_killed_parent(tmp_path: Path) -> None:
    script = tmp_path / "parent.py"
    script.write_text(
        textwrap.dedent("""
        import multiprocessing, os, signal
        import bench_plans as t
        def kill(line):
            print(*[child.pid for child in multiprocessing.active_children()], flush=True)
            os.kill(os.getpid(), signal.SIGKILL)
        if __name__ == "__main__":
            t.play(t.make_plan(), kill, workers=2)
        """)
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([*sys.path, str(Path(fakes.__file__).parent)])}
    done = subprocess.run(
        [sys.executable, script], env=environment, capture_output=True, text=True, timeout=60
    )
    pids = [int(word) for word in done.stdout.split()]
    assert len(pids) == 2, done.stderr
    deadline = time.monotonic() + 10
    while any(_alive(pid) for pid in pids) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not any(_alive(pid) for pid in pids)


def _alive(pid: int) -> bool:
    try:
        return "Z" not in Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except FileNotFoundError:
        return False


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"episodes": 0}, "episodes out of range.*got 0"),
        ({"seed": -1}, "seed out of range"),
        ({"record": -1}, "record out of range"),
        ({"camera": "eye"}, "unknown camera backend.*auto, gl, ray"),
        ({"detectors": ()}, "list of detectors"),
        ({"controllers": ("mppc", "mppc")}, "list of controllers"),
        ({"weights": {"other": Path("x")}}, "does not run"),
        ({"runtime": "abacus"}, "unknown runtime.*auto, torch, openvino"),
        ({"until_ci": 0.0}, "until-ci out of range"),
        ({"until_ci": 10.0, "max_episodes": 3}, "max-episodes out of range; got 3; allowed: 4"),
    ],
)
def test_impossible_plans_are_refused(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        make_plan(**settings)


def test_fewer_than_no_workers_are_refused() -> None:
    with pytest.raises(ConfigError, match="workers"):
        lines_of(make_plan(), workers=-1)


def test_recordings_have_names_that_every_file_system_takes() -> None:
    assert [task.stem for task in make_plan(episodes=1).tasks()] == [
        "thin-fakes-FakeDetector-fakes-FakeController-0000"
    ]


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("resnet", "unknown detector.*'resnet'.*dhrnet.*module:Class"),
        ("no_such_module:Net", "cannot be imported .ModuleNotFoundError"),
        ("fakes:Missing", "has no class 'Missing'.*FakeDetector"),
        ("fakes:NotADetector", "lacks reset, predict"),
        ("fakes:FailsToStart", "RuntimeError: no licence"),
    ],
)
def test_unusable_detectors_are_refused(name: str, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        load_detector(name)


def test_unusable_controllers_are_refused() -> None:
    with pytest.raises(ConfigError, match=r"unknown controller.*mppc, mvp, .*open_loop"):
        load_controller("pid")
    with pytest.raises(ConfigError, match="lacks update, final_grasp, diagnostics"):
        load_controller(DETECTOR)


def test_plug_ins_get_their_weights(tmp_path: Path) -> None:
    file = tmp_path / "net.pt"
    file.write_bytes(b"x")
    player = Player(make_plan(weights={DETECTOR: file}), fakes.run_episode)
    assert player.detectors[DETECTOR].weights == file  # type: ignore[attr-defined]
    with pytest.raises(WeightsError, match="no such weights file"):
        load_detector(DETECTOR, tmp_path / "absent.pt")


def test_the_order_of_a_plan_is_that_of_its_tasks_whatever_order_they_come_in() -> None:
    plan = make_plan(controllers=(CONTROLLER, "fakes:OtherController"), episodes=12)
    tasks = list(plan.tasks())
    shuffled = [tasks[k] for k in np.random.default_rng(0).permutation(len(tasks))]
    place = plan.roster().place
    assert sorted(shuffled, key=place) == tasks
    others = [tasks[0]._replace(suite="other"), tasks[0]._replace(detector="other")]
    assert sorted([*others, tasks[-1]], key=place)[0] == tasks[-1]


def test_plain_copies_are_json_and_do_not_change_between_processes() -> None:
    value = {"a": (1, np.int64(2)), "b": np.array([0.1 + 0.2]), "p": Path("x"), "o": object(), "s": {3, 1}}
    assert json_value(value) == {"a": [1, 2], "b": [0.3], "p": "x", "o": "builtins.object", "s": [1, 3]}
    assert json.loads(json.dumps(json_value(make_plan())))["suites"][0]["scenes"][0]["objects"] == [
        "usb_stick"
    ]


def test_the_first_difference_is_named_by_its_path() -> None:
    a = {"x": {"y": [1, 2]}, "z": 1}
    assert difference(a, a) is None
    assert difference(a, {"x": {"y": [1, 3]}, "z": 1}) == ("x.y", [1, 2], [1, 3])
    assert difference(a, {"x": {"y": [1, 2]}, "z": 1, "w": 0}) == ("w", None, 0)
    cells = {"d": [{"n": 1}, {"n": 2}]}
    assert difference(cells, {"d": [{"n": 1}, {"n": 3}]}) == ("d.1.n", 2, 3)
    assert difference(cells, {"d": [{"n": 1}]}) == ("d", cells["d"], [{"n": 1}])
