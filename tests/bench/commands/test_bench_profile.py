"""Laws of `bench profile`: a table for each cell whose parts add up, and nothing is left behind."""

from __future__ import annotations

from pathlib import Path

import pytest

from mpgrasp.bench.__main__ import main
from mpgrasp.bench.commands.profile import table
from mpgrasp.bench.profiling.cost import Cost
from mpgrasp.bench.profiling.stages import EXECUTION, PARTS, REACH
from mpgrasp.bench.record import Cell

ORACLE = ["profile", "thin", "--detector", "oracle", "--camera", "ray", "--episodes", "1"]


def test_every_cell_has_a_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main([*ORACLE, "--controller", "open_loop,mppc"]) == 0
    out = capsys.readouterr().out
    for controller in ("open_loop", "mppc"):
        assert f"thin, oracle, {controller}: " in out
    for stage in ("physics", "grid map", "inverse kinematics", "the rest"):
        assert out.count(stage) == 2
    assert "ready to play after" in out
    assert max(map(len, out.splitlines())) <= 80
    assert not [*tmp_path.iterdir()]


def test_times_of_a_part_of_a_stage_and_of_all_add_up() -> None:
    times = {"physics": {REACH: 1.0, EXECUTION: 2.0}, "network": {REACH: 4.0}}
    cost = Cost(cell=Cell("s", "d", "c"), episodes=1, ticks=2.0, milliseconds=times)
    assert cost.of() == 7.0
    assert cost.of(part=REACH) == 5.0
    assert cost.of(stage="physics") == 3.0
    assert cost.of(part=EXECUTION, stage="network") == 0.0
    shown = [[*column.cells] for column in table(cost).columns]
    assert shown[1 + PARTS.index(REACH)] == ["1", "4"]
    assert shown[-2:] == [["3", "4"], ["43 %", "57 %"]]


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["--episodes", "0"], "unusable number; got '0'; allowed: 1 to 1000"),
        (["--runtime", "magic"], "unknown runtime; got 'magic'"),
        (["--camera", "eye"], "unknown camera backend; got 'eye'"),
        (["--set", "controller.gama=1"], "controller.gama: no setting of"),
        (["--out", "x"], "unrecognized arguments: --out x"),
    ],
)
def test_what_cannot_be_profiled_is_refused_in_a_line(
    more: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*ORACLE, *more]) == 2
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1


def test_an_episode_that_breaks_off_is_told_in_a_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "broken.py").write_text(
        "from fakes import FakeDetector\n"
        "class Broken(FakeDetector):\n"
        "    def predict(self, frame):\n"
        "        raise RuntimeError('it is broken')\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    assert main(["profile", "thin", "--detector", "broken:Broken", "--camera", "ray"]) == 2
    assert "broke off: RuntimeError: it is broken" in capsys.readouterr().err
