"""Laws of the study of mutants."""

from __future__ import annotations

from pathlib import Path

import mutation
import pytest

SOURCE = """\
def area(width: "int | None", height: float = 2.0) -> "float | None":
    inner: "int | float" = 3
    return None if width is None else width * height + inner
"""


def test_annotations_are_found_where_they_stand() -> None:
    lines = SOURCE.splitlines()
    found = {lines[low[0] - 1][low[1] : high[1]] for low, high in mutation.annotated(SOURCE)}
    assert found == {'"int | None"', "float", '"float | None"', '"int | float"'}


def test_a_sample_is_drawn_by_the_seed_and_keeps_its_order() -> None:
    every = list(range(100))
    one, same, other = (mutation.chosen(every, 10, seed) for seed in (0, 0, 1))
    assert one == same == sorted(one)
    assert len(set(one)) == 10
    assert other != one
    assert mutation.chosen(every, 200, 0) == every


def test_shares_are_of_each_module_and_of_all() -> None:
    tried = (("a", True), ("a", False), ("b", True))
    rows = [{"module": name, "killed": killed} for name, killed in tried]
    shares = mutation.by_module(rows)
    assert {name: (share["count"], share["n"]) for name, share in shares.items()} == {
        "a": (1, 2), "b": (1, 1), "all": (2, 3),
    }  # fmt: skip


def test_every_module_and_test_that_is_named_is_there() -> None:
    for module, tests in mutation.TESTS.items():
        assert (mutation.ROOT / "mpgrasp" / module).is_file()
        assert all((mutation.ROOT / "tests" / name).exists() for name in tests)


def test_a_change_that_a_test_notices_is_killed_and_another_survives(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("cosmic_ray")
    (tmp_path / "mpgrasp").mkdir()
    (tmp_path / "tests").mkdir()
    (tmp_path / "mpgrasp" / "toy.py").write_text(SOURCE)
    (tmp_path / "tests" / "test_toy.py").write_text(
        "import sys\nsys.path.insert(0, 'mpgrasp')\nfrom toy import area\n\n"
        "def test_area():\n    assert area(2, 5) == 13\n"
    )
    monkeypatch.chdir(tmp_path)
    found = mutation.mutations(Path("mpgrasp", "toy.py"))
    assert {m.start_pos[0] for m in found} == {1, 2, 3}
    number = next(m for m in found if "Number" in m.operator_name and m.start_pos[0] == 2)
    default = next(m for m in found if "Number" in m.operator_name and m.start_pos[0] == 1)
    tried = [mutation.try_out("toy.py", m, ["test_toy.py"]) for m in (number, default)]
    assert [mutant.killed for mutant in tried] == [True, False]
    assert (tried[0].line, tried[0].code) == (2, 'inner: "int | float" = 3')
    assert (tmp_path / "mpgrasp" / "toy.py").read_text() == SOURCE
