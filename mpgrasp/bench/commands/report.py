"""`python -m mpgrasp.bench report RUN ...`: draws the report of finished runs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from mpgrasp.bench.report.build import write_report
from mpgrasp.command_line import Parser

_EPILOG = """\
DIR is the folder of a run, or one whose folders are runs: they are put into one report then, and their
cells are compared over the episodes that both played. A run writes its report when it ends; this command
makes it again, and plays nothing.

exit code: 0 written, 2 unusable input or output.
"""


def make_parser() -> Parser:
    """The command line's options."""
    parser = Parser(
        prog="python -m mpgrasp.bench report",
        description="Write DIR/report.html and DIR/report.md from what runs have left.",
        epilog=_EPILOG,
    )
    parser.add_argument("folders", metavar="DIR", nargs="+", type=Path, help="folder of a run, or of runs")
    parser.add_argument("--out", metavar="OUT", type=Path, help="one report of all of them, in this folder")
    return parser


def main(command: Sequence[str]) -> int:
    """Write the reports, print where they are and return the exit code.

    Raises:
        MpgraspError: runs that cannot be read, or a folder that cannot be written.
    """
    arguments = make_parser().parse_args(command)
    if arguments.out:
        print(f"Report: {write_report(arguments.folders, arguments.out)}")
        return 0
    for folder in arguments.folders:
        print(f"Report: {write_report([folder], folder)}")
    return 0
