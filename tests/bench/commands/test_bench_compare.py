from __future__ import annotations

import json
from math import comb
from pathlib import Path
from typing import Any

import pytest
from bench_runs import (
    Row,
    clearing_row,
    configuration_row,
    error_row,
    grasp_row,
    run_row,
    suite_row,
)

from mpgrasp.bench.__main__ import main
from mpgrasp.bench.analysis.pairing import pair
from mpgrasp.bench.commands.compare import compare_times
from mpgrasp.bench.record import Line, line_of
from mpgrasp.exceptions import ConfigError


def row(episode: int, success: bool, **other: Any) -> Row:
    world = {"episode": episode, "scene_seed": episode, "state_hash": f"{episode}{success}"}
    return grasp_row(**{**world, "success": success, **other})


def rows(pattern: str, **other: Any) -> list[Row]:
    """A success for every 1, a failure for every 0, an error row for every x, nothing for a blank."""
    found = []
    for episode, letter in enumerate(pattern):
        if letter == "x":
            found.append(error_row(episode=episode, scene_seed=episode, **other))
        elif letter != " ":
            found.append(row(episode, letter == "1", **other))
    return found


def lines(pattern: str, **other: Any) -> list[Line]:
    return list(map(line_of, rows(pattern, **other)))


def run_with(folder: Path, pattern: str, **other: Any) -> Path:
    folder.mkdir()
    (folder / "run.json").write_text(json.dumps(run_row()))
    return add(folder, rows(pattern, **other))


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
    found = pair(lines("110"), [line_of(row(k, True, sim_time_s=t)) for k, t in enumerate([6.0, 8.0, 100.0])])
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
        add(folder, rows(pattern, detector="other"))
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


def add(folder: Path, episodes: list[Row]) -> Path:
    with (folder / "episodes.jsonl").open("a") as file:
        file.writelines(json.dumps(item) + "\n" for item in episodes)
    return folder


def test_cells_that_only_one_side_has_are_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    a, b = (run_with(tmp_path / name, "1" * 9) for name in "ab")
    add(a, rows("0" * 9, detector="old"))
    add(add(b, rows("1" * 9, detector="new")), rows("1" * 9, detector="newer"))
    text = printed_by(capsys, a, b, code=0)
    assert "In A alone, so not compared: s/old/c\n" in text
    assert "In B alone, so not compared: s/new/c, s/newer/c\n" in text
    assert "alone, so" not in printed_by(capsys, a, a, code=0)


def clearings(*seconds: float | None, limit: float = 900.0) -> list[Row]:
    """Lines of tables that were cleared in so many seconds, or given up after one (None)."""
    return [
        clearing_row(
            episode=k, scene_seed=k, success=time is not None, sim_time_s=time or 1.0, time_limit_s=limit
        )
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
    tmp_path: Path, capsys: pytest.CaptureFixture[str], b: list[Row], code: int, verdict: str
) -> None:
    folders = [add(run_with(tmp_path / name, ""), own) for name, own in (("a", clearings(*TIMES)), ("b", b))]
    text = printed_by(capsys, *folders, code=code)
    assert verdict in text
    assert "235.0" in text  # A's mean


def test_the_time_to_clear_is_cut_off_at_the_limit_of_both_and_p_is_the_signed_rank_tests() -> None:
    sides = clearings(*TIMES, limit=250.0), clearings(*(time + 90 for time in TIMES))
    found = compare_times(*(list(map(line_of, side)) for side in sides))
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
            add(folder, rows("1" * 9, detector=f"other{k}"))
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
    (b / "run.json").write_text(json.dumps(run_row(configuration_row(noise=False))))
    main(["compare", str(a), str(b)])
    assert "Not the same in both: noise: true in A, false in B" in capsys.readouterr().out


def test_suites_are_compared_by_name_whether_a_programme_played_them_or_a_run_of_their_own(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def told(alone: Row, programme: list[Row]) -> list[str]:
        a, b = tmp_path / "a" / "run.json", tmp_path / "b" / "run.json"
        a.write_text(json.dumps(run_row(configuration_row(**alone))))
        b.write_text(json.dumps(run_row(configuration_row(suite="paper", suites=programme))))
        main(["compare", str(a.parent), str(b.parent)])
        return [text for text in capsys.readouterr().out.splitlines() if text.startswith("Not the same")]

    def played(name: str, limit: float) -> Row:
        return {
            "suite": suite_row(name, trial="clear"), "episode": {"time_limit": limit}, "episodes": 1,
        }  # fmt: skip

    for name in "ab":
        run_with(tmp_path / name, "1")
    assert told(played("s", 9.0), [played("t", 5.0), played("s", 9.0)]) == []
    changed = told(played("s", 9.0), [played("t", 5.0), played("s", 8.0)])
    assert changed == ["Not the same in both: s.episode.time_limit: 9.0 in A, 8.0 in B"]
