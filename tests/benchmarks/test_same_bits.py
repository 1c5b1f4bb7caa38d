"""Laws of the study of bits: what counts as equal, what each process is told, and settings that are kept."""

from __future__ import annotations

import csv
import json
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import bit_settings
import pytest
import same_bits
from bench_runs import configuration_row, detector_row, error_row, grasp_row, made_with_row, run_row
from bit_settings import CLEARED, REFERENCE, SETTINGS, digest, environment_of, hash_of, source_hash

from mpgrasp.bench.record import line_of
from mpgrasp.exceptions import ConfigError
from mpgrasp.statistics import wilson_interval

EVERY_SET = ["X86_V2", "X86_V3", "X86_V4"]


def write_run(folder: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """The files of a run that the study reads."""
    folder.mkdir(parents=True, exist_ok=True)
    names = list(dict.fromkeys(row["detector"] for row in rows))
    cards = [detector_row(name, runtime="torch f32") for name in names]
    run = run_row(configuration_row(detectors=cards), made_with=made_with_row(blas=["openblas 1 Haswell"]))
    (folder / "run.json").write_text(json.dumps(run))
    (folder / "episodes.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))


@dataclass
class Bench:
    """The benchmark's command line, which plays without taking time and notes what it was told."""

    told: list[tuple[list[str], dict[str, str]]] = field(default_factory=list)
    refuses: str = ""
    """Word of the command lines that it refuses."""
    ends: int = 0
    """Exit code of all others."""

    def __call__(
        self, arguments: Sequence[str], environment: Mapping[str, str]
    ) -> subprocess.CompletedProcess[str]:
        words = list(arguments)
        self.told.append((words, dict(environment)))
        if self.refuses and self.refuses in words:
            return subprocess.CompletedProcess(words, 2, "", "mpgrasp: error: no OpenGL here\n")
        folder = Path(words[words.index("--resume" if "--resume" in words else "--out") + 1])
        if self.ends not in (0, 1):
            write_run(folder, [])  # begun, and cut short
            return subprocess.CompletedProcess(words, self.ends, "", "Killed")
        write_run(folder, [self.row(k, words, environment) for k in range(4)])
        return subprocess.CompletedProcess(words, self.ends, "", "")

    def row(self, k: int, words: Sequence[str], environment: Mapping[str, str]) -> dict[str, Any]:
        """Torch has other bits in all episodes, and another outcome in episode 3."""
        which = {"episode": k, "scene_seed": 10 + k, "detector": "dhrnet"}
        if "torch" in words:
            return grasp_row(**which, success=k < 3, state_hash="t")
        if "ray" in words and k == 0:
            return error_row(**which)
        return grasp_row(**which, timing={"detect": float(len(self.told))})


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Bench:
    fake = Bench()
    monkeypatch.setattr(bit_settings, "bench", fake)
    monkeypatch.setattr(same_bits, "instruction_sets", lambda: EVERY_SET)
    monkeypatch.setattr(same_bits, "load_detector", lambda name: SimpleNamespace(name=name))
    return fake


def line(**changes: Any) -> str:
    return hash_of(line_of(grasp_row(**changes)))


def test_lines_are_equal_whatever_time_they_took_and_differ_with_state_or_measurement() -> None:
    assert line(timing={"detect": 1.0}) == line(timing={"detect": 2.0})
    # numbers in lines are rounded: the last bits are those of the state's hash
    others = [line(state_hash="1"), line(sim_time_s=5.1), line(ticks=51)]
    assert len({line(), *others}) == 4


def test_digests_keep_every_detectors_episodes_apart(tmp_path: Path) -> None:
    rows = [grasp_row(detector=name, episode=k, scene_seed=k) for name in ("a", "b") for k in range(2)]
    write_run(tmp_path, [*rows, error_row(detector="b", episode=2)])
    found = digest(tmp_path)
    assert {name: list(some) for name, some in found["episodes"].items()} == {
        "a": ["0", "1"], "b": ["0", "1", "2"],
    }  # fmt: skip
    assert found["episodes"]["b"]["2"] == {"scene_seed": 1, "outcome": "error", "line": None}
    assert found["blas"] == ["openblas 1 Haswell"]
    assert found["runtimes"] == {"a": "torch f32", "b": "torch f32"}


def episodes(outcomes: str, lines: str) -> dict[str, Any]:
    """An episode per letter: s for success, m for missed, t for timeout, e for error."""
    words = {"s": "success", "m": "missed", "t": "timeout", "e": "error"}
    return {
        str(k): {"scene_seed": k, "outcome": words[word], "line": bits}
        for k, (word, bits) in enumerate(zip(outcomes, lines, strict=True))
    }


def test_equal_lines_and_other_outcomes_are_counted_over_what_both_played() -> None:
    found = same_bits.compare(episodes("sssmmes", "abcdef0"), episodes("ssmtmse", "abxyzf0"))
    assert (found["n"], found["errors"]) == (5, 2)
    counts = [found[key]["count"] for key in ("equal", "other_outcome", "other_success")]
    assert counts == [2, 2, 1]
    low, high = wilson_interval(2, 5)
    assert (found["equal"]["wilson_low"], found["equal"]["wilson_high"]) == (low, high)
    assert found["changes"] == [
        {"episode": 2, "reference": "success", "here": "missed"},
        {"episode": 3, "reference": "missed", "here": "timeout"},
    ]


def test_changes_are_in_the_order_of_episodes() -> None:
    found = same_bits.compare(episodes("s" * 12, "a" * 12), episodes("m" * 12, "b" * 12))
    assert [change["episode"] for change in found["changes"]] == list(range(12))


@pytest.mark.parametrize("other", [{}, episodes("s", "a"), {"0": {"scene_seed": 9}, "1": {"scene_seed": 1}}])
def test_other_scenes_are_no_comparison(other: dict[str, Any]) -> None:
    with pytest.raises(ConfigError, match="other scenes"):
        same_bits.compare(episodes("ss", "ab"), other)


def test_no_setting_inherits_a_kernel_and_each_has_its_own_cache(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in CLEARED:
        monkeypatch.setenv(name, "Nehalem")
    monkeypatch.setenv("HOME", "/somewhere")
    for setting in SETTINGS:
        found = environment_of(setting, f"/cache/{setting.name}")
        assert {key: found[key] for key in CLEARED if key in found} == dict(setting.environment)
        assert found["MPGRASP_CACHE"] == f"/cache/{setting.name}"
        assert found["HOME"] == "/somewhere"


def test_settings_differ_from_the_reference_in_one_thing_each() -> None:
    assert len({setting.name for setting in SETTINGS}) == len(SETTINGS)
    assert SETTINGS[0] == REFERENCE
    assert (REFERENCE.environment, REFERENCE.options) == ({}, ())
    assert all(len(s.environment) + len(s.options) // 2 == 1 for s in SETTINGS[1:])


def test_the_hash_of_sources_follows_content_and_names(tmp_path: Path) -> None:
    file = tmp_path / "a.py"
    file.write_text("x = 1\n")
    before = source_hash(tmp_path)
    assert source_hash(tmp_path) == before
    file.write_text("x = 2\n")
    changed = source_hash(tmp_path)
    file.rename(tmp_path / "b.py")
    assert len({before, changed, source_hash(tmp_path)}) == 3


def test_every_setting_plays_the_same_episodes_by_the_benchmarks_command_line(
    bench: Bench, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert same_bits.main(["--episodes", "4", "--seed", "3", "--out", str(tmp_path)]) == 0
    assert len(bench.told) == len(SETTINGS)
    for setting, (words, environment) in zip(SETTINGS, bench.told, strict=True):
        assert words[:9] == [
            "single", "--detector", "dhrnet", "--controller", "mppc_robust", "--episodes", "4", "--seed", "3",
        ]  # fmt: skip
        assert words[9:] == [*setting.options, "--out", str(tmp_path / "runs" / setting.name), "--quiet"]
        assert environment.items() >= dict(setting.environment).items()
    rows = {row["setting"]: row for row in json.loads((tmp_path / "same-bits.json").read_text())["rows"]}
    assert set(rows) == {setting.name for setting in SETTINGS[1:]}
    assert rows["blas-haswell"]["equal"]["count"] == 4
    assert rows["runtime-torch"]["equal"]["count"] == 0
    assert rows["runtime-torch"]["other_outcome"]["count"] == 1
    assert rows["runtime-torch"]["changes"][0]["episode"] == 3
    assert (rows["camera-ray"]["n"], rows["camera-ray"]["errors"]) == (3, 1)
    with (tmp_path / "same-bits.csv").open() as file:
        table = list(csv.DictReader(file))
    assert [row["setting"] for row in table] == list(rows)
    assert table[0]["equal_rate"] == "1.0"
    assert (tmp_path / "same-bits.png").read_bytes().startswith(b"\x89PNG")
    printed = capsys.readouterr().out
    (torch,) = (text for text in printed.splitlines() if text.startswith("runtime-torch"))
    assert "25.0 [4.6-69.9]" in torch


def test_some_settings_alone_are_played_beside_the_reference(bench: Bench, tmp_path: Path) -> None:
    words = ["thin", "--episodes", "4", "--settings", "camera-ray,runtime-torch", "--out", str(tmp_path)]
    assert same_bits.main(words) == 0
    assert len(bench.told) == 3
    rows = json.loads((tmp_path / "same-bits.json").read_text())["rows"]
    assert [row["setting"] for row in rows] == ["camera-ray", "runtime-torch"]
    varied = json.loads((tmp_path / "run.json").read_text())["varied"]
    assert [setting["name"] for setting in varied] == ["reference", "camera-ray", "runtime-torch"]


def test_what_is_kept_is_not_played_again_and_what_was_begun_is_resumed(bench: Bench, tmp_path: Path) -> None:
    command = ["--episodes", "4", "--out", str(tmp_path)]
    assert same_bits.main(command) == 0
    bench.told.clear()
    assert same_bits.main(command) == 0
    assert not bench.told
    (tmp_path / "settings" / "workers-1.json").unlink()
    (tmp_path / "settings" / "workers-2.json").unlink()
    (tmp_path / "runs" / "workers-2" / "run.json").unlink()
    assert same_bits.main(command) == 0
    (one, _), (two, _) = bench.told
    assert one == ["--resume", str(tmp_path / "runs" / "workers-1"), "--quiet"]
    assert two[-3:] == ["--out", str(tmp_path / "runs" / "workers-2"), "--quiet"]


def test_other_settings_or_other_code_are_refused_in_the_same_folder(
    bench: Bench, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    command = ["--episodes", "4", "--out", str(tmp_path)]
    assert same_bits.main(command) == 0
    bench.told.clear()
    assert same_bits.main([*command, "--seed", "1"]) == 2
    monkeypatch.setattr(same_bits, "source_hash", lambda package: "changed")
    assert same_bits.main(command) == 2
    assert capsys.readouterr().err.count("other settings") == 2
    assert not bench.told


def test_a_setting_that_the_machine_cannot_play_is_named_and_tried_again(
    bench: Bench, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(same_bits, "instruction_sets", lambda: EVERY_SET[:2])
    bench.refuses = "gl"
    command = ["--episodes", "4", "--out", str(tmp_path)]
    assert same_bits.main(command) == 0
    missing = json.loads((tmp_path / "same-bits.json").read_text())["not_played"]
    assert set(missing) == {"blas-skylakex", "camera-gl"}
    assert "X86_V4" in missing["blas-skylakex"]
    assert "no OpenGL here" in missing["camera-gl"]
    assert capsys.readouterr().out.count("not played") == 2
    bench.refuses = ""
    bench.told.clear()
    assert same_bits.main(command) == 0
    assert [words[9:11] for words, _ in bench.told] == [["--camera", "gl"]]


@pytest.mark.parametrize(
    ("bench_does", "code", "message"),
    [
        ({"refuses": "single"}, 2, "the benchmark refuses these episodes"),
        ({"ends": -9}, 2, "ended early"),
        ({"ends": 130}, 130, ""),
    ],
)
def test_a_reference_that_is_not_played_ends_the_study(
    bench: Bench, tmp_path: Path, capsys: pytest.CaptureFixture[str], bench_does: dict[str, Any], code: int,
    message: str,
) -> None:  # fmt: skip
    for key, value in bench_does.items():
        setattr(bench, key, value)
    assert same_bits.main(["--episodes", "4", "--out", str(tmp_path)]) == code
    assert message in capsys.readouterr().err
    assert len(bench.told) == 1
    assert not (tmp_path / "same-bits.json").exists()
    assert not list((tmp_path / "settings").iterdir())


@pytest.mark.parametrize(
    ("command", "message"),
    [
        (["thick"], "unknown suite"),
        (["--controller", "pid"], "unknown controller"),
        (["--episodes", "0"], "--episodes"),
        (["--seed", "-1"], "--seed"),
    ],
)
def test_unusable_input_is_one_line_and_exit_code_2(
    command: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert same_bits.main([*command, "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert message in error
    assert not (tmp_path / "out").exists()
