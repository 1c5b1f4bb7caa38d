"""Paired tests of a suite as a matrix: who succeeded alone how often, and whether that is significant."""

from __future__ import annotations

from collections.abc import Sequence

from mpgrasp.bench.analysis.summary import PairedTest
from mpgrasp.bench.record import Method
from mpgrasp.bench.report.document import Table
from mpgrasp.bench.report.names import name_of
from mpgrasp.statistics import SIGNIFICANCE

LEAST, MOST = 3, 12
"""Methods that make a matrix: with fewer it says no more than the list, with more it is not readable."""


def pair_matrices(tests: Sequence[PairedTest]) -> list[Table]:
    """Return a matrix for each suite in which as many methods met as make one."""
    matrices = []
    for suite in dict.fromkeys(test.suite for test in tests):
        of_suite = [test for test in tests if test.suite == suite]
        methods = list(dict.fromkeys(method for test in of_suite for method in (test.a, test.b)))
        if LEAST <= len(methods) <= MOST:
            matrices.append(_matrix(suite, methods, of_suite))
    return matrices


def _matrix(suite: str, methods: Sequence[Method], tests: Sequence[PairedTest]) -> Table:
    cells: dict[tuple[Method, Method], str] = {}
    for test in tests:
        star = " *" if test.p_holm < SIGNIFICANCE else ""
        cells[test.a, test.b] = f"{test.a_alone} : {test.b_alone}{star}"
        cells[test.b, test.a] = f"{test.b_alone} : {test.a_alone}{star}"
    return Table(
        caption=f"{suite}: row against column",
        headings=("method", *map(name_of, methods)),
        rows=[(name_of(row), *(cells.get((row, column), "") for column in methods)) for row in methods],
        note="Common worlds in which the row's method alone succeeded : in which the column's alone did. "
        f"* significant: McNemar's exact test, Holm p < {SIGNIFICANCE:g} over all pairs of the suite.",
    )
