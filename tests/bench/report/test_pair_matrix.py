"""Laws of the matrix of paired tests: it says what the tests say, from both sides."""

from __future__ import annotations

from itertools import combinations

from mpgrasp.bench.analysis.summary import PairedTest
from mpgrasp.bench.record import Method
from mpgrasp.bench.report.pair_matrix import MOST, pair_matrices


def paired(count: int, suite: str = "thin") -> list[PairedTest]:
    methods = [Method(f"d{k}", "mppc") for k in range(count)]
    return [
        PairedTest(
            suite=suite, a=a, b=b, n=9, both=1, a_alone=k + 2, b_alone=k, p=0.1, p_holm=0.04 + 0.02 * k
        )
        for k, (a, b) in enumerate(combinations(methods, 2))
    ]


def test_both_sides_of_the_diagonal_say_the_same_turned_round() -> None:
    (matrix,) = pair_matrices(paired(4))
    names = list(matrix.headings[1:])
    assert [row[0] for row in matrix.rows] == names
    for i, j in combinations(range(4), 2):
        here, there = matrix.rows[i][j + 1], matrix.rows[j][i + 1]
        won, lost = here.removesuffix(" *").split(" : ")
        assert there.removesuffix(" *").split(" : ") == [lost, won]
        assert int(won) == int(lost) + 2
        assert here.endswith(" *") is there.endswith(" *")
    assert [row[k + 1] for k, row in enumerate(matrix.rows)] == [""] * 4
    starred = sum(cell.endswith(" *") for row in matrix.rows for cell in row)
    assert starred == 2, "one test of six is significant, and is told twice"


def test_two_methods_and_too_many_make_no_matrix_and_suites_have_their_own() -> None:
    assert pair_matrices(paired(2)) == []
    assert pair_matrices(paired(MOST + 1)) == []
    captions = [table.caption for table in pair_matrices(paired(3) + paired(3, "single"))]
    assert captions == ["thin: row against column", "single: row against column"]
