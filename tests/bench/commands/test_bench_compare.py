from __future__ import annotations

import json
from math import comb
from pathlib import Path
from typing import Any

import fakes
import pytest
from bench_runs import PLUG_INS, records

from mpgrasp.bench.__main__ import main
from mpgrasp.bench.analysis.pairing import pair
from mpgrasp.bench.commands.compare import compare_times
from mpgrasp.exceptions import ConfigError


def line(episode: int, success: bool, **other: Any) -> dict[str, Any]:
    common = {"suite": "s", "seed": 0, "scene_seed": episode, "detector": "d", "controller": "c"}
    how = {
        "outcome": "success" if success else "missed",
        "object": "o",
        "sim_time_s": 5.0,
        "reflex": None,
        "state_hash": f"{episode}{success}",
    }
    return {**common, **how, "episode": episode, "success": success, **other}


def lines(pattern: str, **other: Any) -> list[dict[str, Any]]:
    """A success for every 1, a failure for every 0, an error row for every x, nothing for a blank."""
    found = []
    for episode, letter in enumerate(pattern):
        if letter == "x":
            found.append(line(episode, False, outcome="error", error="a bug", **other))
        elif letter != " ":
            found.append(line(episode, letter == "1", **other))
    return found


def run_with(folder: Path, pattern: str, **other: Any) -> Path:
    folder.mkdir()
    configuration = {"suite": {"name": "s"}, "seed": 0}
    (folder / "run.json").write_text(json.dumps({"configuration": configuration}))
    text = "".join(json.dumps(item) + "\n" for item in lines(pattern, **other))
    (folder / "episodes.jsonl").write_text(text)
    return folder


def test_pairs_are_counted_over_common_worlds_without_error_rows() -> None:
    found = pair(lines("1101 1x11"), lines("10011100"))
    assert (found.n, found.both, found.a_alone, found.b_alone) == (6, 3, 2, 0)
    assert found.rate_a == 5 / 6
    assert found.rate_b == 3 / 6
    assert found.same_outcome == found.identical == 4


def test_p_is_the_two_sided_sign_test_over_the_pairs_that_differ() -> None:
    found = pair(lines("1" * 20), lines("0" * 8 + "1" * 12))
    assert found.p == pytest.approx(2 * 0.5**8)
    mixed = pair(lines("1111111100" + "1" * 5), lines("0000000011" + "1" * 5))
    assert mixed.p == pytest.approx(2 * sum(comb(10, k) for k in range(3)) / 2**10)


def test_times_are_compared_where_both_succeeded() -> None:
    found = pair(lines("110"), [line(k, True, sim_time_s=t) for k, t in enumerate([6.0, 8.0, 100.0])])
    assert found.time_difference_s == pytest.approx(2.0)
    assert found.time_low <= 2.0 <= found.time_high


def test_worlds_that_a_played_and_b_has_only_an_error_row_of_are_lost() -> None:
    found = pair(lines("101x 1xx"), lines("xx1xx0 1") + lines("1"))
    assert (found.n, found.errors_a, found.errors_b, found.lost) == (3, 3, 4, 1)


def test_another_scene_and_a_double_episode_are_refused() -> None:
    with pytest.raises(ConfigError, match="had another scene"):
        pair(lines("11"), lines("11", scene_seed=7))
    with pytest.raises(ConfigError, match="twice"):
        pair(lines("1") + lines("1"), lines("1"))


@pytest.mark.parametrize(
    ("a", "b", "code", "verdict"),
    [
        ("1" * 30, "1" * 24 + "0" * 6, 1, "B is worse"),
        ("1" * 24 + "0" * 6, "1" * 30, 0, "B is better"),
        ("1" * 30, "1" * 25 + "0" * 5, 0, "no significant difference"),
        ("10" * 15, "10" * 15, 0, "no significant difference"),
    ],
)
def test_the_exit_code_says_whether_b_is_significantly_worse(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], a: str, b: str, code: int, verdict: str
) -> None:
    folders = [str(run_with(tmp_path / name, pattern)) for name, pattern in (("a", a), ("b", b))]
    assert main(["compare", *folders]) == code
    assert verdict in capsys.readouterr().out


def test_several_cells_are_matched_by_name_and_corrected_together(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    a, b = (run_with(tmp_path / name, "1" * 30) for name in "ab")
    for folder, pattern in ((a, "1" * 30), (b, "0" * 6 + "1" * 24)):
        add(folder, lines(pattern, detector="other"))
    # alone p = 0.031 is significant, as one of two tests 0.062 is not
    assert main(["compare", f"{a}/other/c", f"{b}/other/c"]) == 1
    assert main(["compare", str(a), str(b)]) == 0
    assert main(["compare", f"{a}/d/c", f"{b}/other/c"]) == 1
    assert "d/c" in capsys.readouterr().out


def printed_by(capsys: pytest.CaptureFixture[str], a: Path, b: Path, *, code: int) -> str:
    assert main(["compare", str(a), str(b)]) == code
    return capsys.readouterr().out


def test_who_crashes_in_episodes_that_the_other_played_is_worse(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    whole, torn = run_with(tmp_path / "whole", "1" * 100), run_with(tmp_path / "torn", "1" * 40 + "x" * 60)
    dead = run_with(tmp_path / "dead", "x" * 100)
    text = printed_by(capsys, whole, torn, code=1)
    assert "B is worse: episodes that A played are errors in B: 60 of 100 of s/d/c" in text
    assert "0, 60" in text
    assert "no significant difference" not in text
    assert "100 of 100 of s/d/c" in printed_by(capsys, whole, dead, code=1)
    for b in (whole, torn):  # that A crashed is said, and no reproach to B
        text = printed_by(capsys, torn, b, code=0)
        assert "60, " in text
        assert "no significant difference" in text
    assert main(["compare", str(dead), str(whole)]) == 2


def add(folder: Path, episodes: list[dict[str, Any]]) -> Path:
    with (folder / "episodes.jsonl").open("a") as file:
        file.writelines(json.dumps(item) + "\n" for item in episodes)
    return folder


def test_cells_that_only_one_side_has_are_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    a, b = (run_with(tmp_path / name, "1" * 9) for name in "ab")
    add(a, lines("0" * 9, detector="old"))
    add(add(b, lines("1" * 9, detector="new")), lines("1" * 9, detector="newer"))
    text = printed_by(capsys, a, b, code=0)
    assert "In A alone, so not compared: s/old/c\n" in text
    assert "In B alone, so not compared: s/new/c, s/newer/c\n" in text
    assert "alone, so" not in printed_by(capsys, a, a, code=0)


def clearings(*seconds: float | None, limit: float = 900.0) -> list[dict[str, Any]]:
    """Lines of tables that were cleared in so many seconds, or given up after one (None)."""
    of_clearing: dict[str, Any] = {
        "picks": [],
        "failures": {},
        "in_basket": [],
        "knocked_off": [],
        "left": [],
    }
    return [
        line(k, time is not None, sim_time_s=time or 1.0, time_limit_s=limit, **of_clearing)
        for k, time in enumerate(seconds)
    ]


TIMES = [200.0 + 10 * k for k in range(8)]


@pytest.mark.parametrize(
    ("b", "code", "verdict"),
    [
        (clearings(*(time + k + 1 for k, time in enumerate(TIMES))), 1, "B is slower"),
        (clearings(*(time - k - 1 for k, time in enumerate(TIMES))), 0, "B is faster"),
        (clearings(*(time + (-1) ** k for k, time in enumerate(TIMES))), 0, "no significant difference"),
        (clearings(None, None, *(time + 1 for time in TIMES[2:])), 1, "B is slower"),  # and n. s. in success
    ],
)
def test_who_clears_tables_significantly_more_slowly_is_worse(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], b: list[dict[str, Any]], code: int, verdict: str
) -> None:
    folders = [add(run_with(tmp_path / name, ""), own) for name, own in (("a", clearings(*TIMES)), ("b", b))]
    text = printed_by(capsys, *folders, code=code)
    assert verdict in text
    assert "235.0" in text  # A's mean


def test_the_time_to_clear_is_cut_off_at_the_limit_of_both_and_p_is_the_signed_rank_tests() -> None:
    found = compare_times(clearings(*TIMES, limit=250.0), clearings(*(time + 90 for time in TIMES)))
    assert found is not None
    assert found.mean_a == pytest.approx(sum(min(time, 250) for time in TIMES) / 8)
    assert found.mean_b == pytest.approx(250.0)
    # the last three are ties, and the other five all have one sign
    assert found.p == pytest.approx(2 / 2**5)
    assert found.slower
    assert compare_times(lines("11"), lines("11")) is None


def test_tests_of_success_and_of_times_are_corrected_together(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    slower = clearings(*(time + k + 1 for k, time in enumerate(TIMES)))
    cells = {"a": clearings(*TIMES), "b": slower}
    folders = [add(run_with(tmp_path / name, ""), own) for name, own in cells.items()]
    assert f"{2 * 2 / 2**8:.3g}" in printed_by(capsys, *folders, code=1)  # times and success: two tests
    for folder in folders:
        for k in range(5):
            add(folder, lines("1" * 9, detector=f"other{k}"))
    assert f"{7 * 2 / 2**8:.3g}" in printed_by(capsys, *folders, code=0)


@pytest.mark.parametrize(
    ("a", "b", "message"),
    [
        ("absent", "run", "no episodes there"),
        ("run/d/nobody", "run", "no such cell; got 'd/nobody'; allowed: s/d/c"),
        ("run", "other", "no episode in common"),
    ],
)
def test_what_cannot_be_compared_is_one_line_and_exit_code_2(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], a: str, b: str, message: str
) -> None:
    run_with(tmp_path / "run", "101")
    run_with(tmp_path / "other", "111", seed=1)
    assert main(["compare", str(tmp_path / a), str(tmp_path / b)]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1


def test_a_configuration_that_differs_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    a, b = (run_with(tmp_path / name, "1") for name in "ab")
    (b / "run.json").write_text(
        json.dumps({"configuration": {"suite": {"name": "s"}, "seed": 0, "noise": 0}})
    )
    main(["compare", str(a), str(b)])
    assert "Not the same in both: noise: null in A, 0 in B" in capsys.readouterr().out


def test_suites_are_compared_by_name_whether_a_programme_played_them_or_a_run_of_their_own(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def told(alone: dict[str, Any], programme: list[dict[str, Any]]) -> list[str]:
        a, b = tmp_path / "a" / "run.json", tmp_path / "b" / "run.json"
        a.write_text(json.dumps({"configuration": {"seed": 0, **alone}}))
        b.write_text(json.dumps({"configuration": {"seed": 0, "suite": "paper", "suites": programme}}))
        main(["compare", str(a.parent), str(b.parent)])
        return [text for text in capsys.readouterr().out.splitlines() if text.startswith("Not the same")]

    def played(name: str, limit: float) -> dict[str, Any]:
        return {"suite": {"name": name, "trial": "clear"}, "episode": {"time_limit": limit}}

    for name in "ab":
        run_with(tmp_path / name, "1")
    assert told(played("s", 9.0), [played("t", 5.0), played("s", 9.0)]) == []
    changed = told(played("s", 9.0), [played("t", 5.0), played("s", 8.0)])
    assert changed == ["Not the same in both: s.episode.time_limit: 9.0 in A, 8.0 in B"]


@pytest.fixture
def run(fake_world: object, tmp_path: Path) -> Path:
    cells = [*PLUG_INS[:3], "fakes:FakeController,fakes:OtherController", *PLUG_INS[4:]]
    assert main(["thin", *cells, "--episodes", "3", "--quiet", "--out", str(tmp_path / "run")]) == 0
    return tmp_path / "run"


CELL = ["--cell", "fakes:FakeDetector/fakes:OtherController"]


def test_a_replay_says_that_it_is_the_same(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = {file: file.read_bytes() for file in run.glob("*.json*")}
    capsys.readouterr()
    assert main(["replay", str(run), "--episode", "2", *CELL]) == 0
    expected = records(run)[-1]
    printed = capsys.readouterr().out
    assert "bit for bit the same" in printed
    assert expected["outcome"] in printed
    assert {file: file.read_bytes() for file in run.glob("*.json*")} == before


def test_a_replay_says_what_differs(
    run: Path, fake_world: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    fake_world.setattr("mpgrasp.episode.episode.run_episode", fakes.other_world)
    fake_world.setattr("mpgrasp.bench.results.provenance.PACKAGES", ())
    assert main(["replay", str(run), "--episode", "2", *CELL]) == 1
    printed = capsys.readouterr().out
    assert "not the same as in the run" in printed
    assert "ticks: 50 then, 51 now" in printed
    assert "state_hash" not in printed
    assert "Not made with the same: packages" in printed


def test_a_replay_names_a_configuration_that_has_changed(
    run: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = (run / "run.json").read_text()
    (run / "run.json").write_text(text.replace('"start_height": 0.5', '"start_height": 0.6'))
    assert main(["replay", str(run), "--episode", "0", *CELL]) == 0
    assert "episode.start_height: 0.6 then, 0.5 now" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--episode", "0"], "the run has several cells"),
        (["--episode", "9", *CELL], "the run has no episode 9"),
        (["--episode", "-1", *CELL], "episode out of range"),
        (["--episode", "0", "--cell", "oracle/mppc"], "no such cell; got 'oracle/mppc'"),
        (CELL, "required: --episode"),
    ],
)
def test_what_cannot_be_replayed_is_one_line_and_exit_code_2(
    run: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], message: str
) -> None:
    capsys.readouterr()
    assert main(["replay", str(run), *arguments]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1


def test_no_run_no_replay(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["replay", str(tmp_path), "--episode", "0"]) == 2
    assert "no run there" in capsys.readouterr().err
