"""`python -m mpgrasp.evaluate DATASET PATH`: detectors on real and generated datasets."""

from __future__ import annotations

import argparse
import os
import shlex
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from mpgrasp.command_line import run_command
from mpgrasp.evaluate.options import check, make_detectors, make_parser, reader_of

if TYPE_CHECKING:
    from mpgrasp.datasets.reader import Reader
    from mpgrasp.detectors.detector import GraspDetector
    from mpgrasp.evaluate.scoring import Scored


def main(command: Sequence[str] | None = None) -> int:
    """Run the command line (`sys.argv` if not given) and return the exit code."""
    os.environ.setdefault("OMP_NUM_THREADS", str(len(os.sched_getaffinity(0))))
    return run_command(lambda: _run(sys.argv[1:] if command is None else command))


def _run(command: Sequence[str]) -> int:
    options = make_parser().parse_args(command)
    check(options)
    reader = reader_of(options)
    words = shlex.join(["python", "-m", "mpgrasp.evaluate", *command])
    if options.train:
        scored, detectors = _trained(options, reader, words)
    else:
        scored, detectors = _as_they_are(options, reader)
    from mpgrasp.evaluate.written import results_table, summary_lines, write_results

    if options.out is not None:  # first: nobody who stops reading what is printed loses a result
        write_results(options, words, scored, detectors, reader.title)
    first, *others = summary_lines(scored, reader.title)
    print(first)
    _print(results_table(scored, options), others)
    if options.out is not None:
        print(f"Results: {options.out}")
    return 0


def _as_they_are(options: argparse.Namespace, reader: Reader) -> tuple[Scored, dict[str, GraspDetector]]:
    """Score detectors with the weights that they have."""
    from mpgrasp.datasets.reader import Subset
    from mpgrasp.evaluate.scoring import Scored

    detectors, scored = make_detectors(options), Scored()
    folds = None if options.split is None else _folds(options, reader)
    scored.add(
        reader if folds is None else Subset(reader, list(folds)),
        detectors,
        side=options.side,
        limit=options.limit,
        strict=options.strict,
        levelled=options.level,
        folds=folds,
    )
    return scored, detectors


def _trained(
    options: argparse.Namespace, reader: Reader, command: str
) -> tuple[Scored, dict[str, GraspDetector]]:
    """Score networks on folds that they were not trained on; those of the last fold are told."""
    from mpgrasp.datasets.reader import Subset
    from mpgrasp.evaluate.cross_validation import trained_folds
    from mpgrasp.evaluate.scoring import Scored

    scored, last = Scored(), dict[str, "GraspDetector"]()
    folds = _folds(options, reader)
    chosen = Subset(reader, list(folds))
    for _, part, detectors in trained_folds(options, chosen, folds, command):
        scored.add(
            part,
            detectors,
            side=options.side,
            strict=options.strict,
            levelled=options.level,
            folds=folds,
        )
        last = detectors
    return scored, last


def _folds(options: argparse.Namespace, reader: Reader) -> dict[str, int]:
    from mpgrasp.datasets.folds import assign

    names = list(reader.names)[: options.limit]
    return assign({name: reader.object_of(name) for name in names}, options.split, options.folds)


def _print(table: Sequence[Sequence[str]], lines: Sequence[str]) -> None:
    from rich.console import Console
    from rich.table import Table

    (first, *headings), *body = table
    grid = Table()
    grid.add_column(first, overflow="fold")
    for heading in headings:
        grid.add_column(heading, justify="right")
    for row in body:
        grid.add_row(*row)
    console = Console()
    console.print(grid)
    for line in lines:
        console.print(line, highlight=False)


if __name__ == "__main__":
    sys.exit(main())
