"""`python -m mpgrasp.bench merge SHARD ... --out DIR`: one run from its shards."""

from __future__ import annotations

import shlex
import shutil
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import msgspec

from mpgrasp.bench.playing.conclusion import conclude
from mpgrasp.bench.playing.plan import Shard
from mpgrasp.bench.playing.roster import Roster
from mpgrasp.bench.record import Method
from mpgrasp.bench.results.reader import RUN, read_run
from mpgrasp.bench.results.run_card import Configuration, Resumption, RunDescription
from mpgrasp.bench.results.writer import RunDirectory
from mpgrasp.bench.stored_lines import StoredLines
from mpgrasp.command_line import Parser
from mpgrasp.exceptions import ConfigError, OutputError
from mpgrasp.files.json_values import differences
from mpgrasp.processes import interrupts_wait
from mpgrasp.suite import episode_seed

_EPILOG = """\
SHARD is the folder of a run that was played with --shard K/N. All must have the same configuration but for K.
The result is the run that one machine would have played, line by line. Shards and episodes may be missing:
then the run in DIR is an unfinished one, and `--resume DIR` plays the rest.

exit code: 0 all episodes are there, 1 some are missing or could not be played, 2 unusable input or output.
"""
EXIT_UNFINISHED = 1
_FOLDERS = ("errors", "traces", "recordings")


@dataclass(frozen=True, kw_only=True)
class Part:
    """One shard."""

    folder: Path
    about: RunDescription
    lines: StoredLines

    @classmethod
    def read(cls, folder: Path) -> Part:
        """Read the folder of a shard.

        Raises:
            OutputError: no run there, or one that cannot be read.
            ConfigError: a run that is no shard.
        """
        about = read_run(folder)
        if about.configuration.shard is None:
            raise ConfigError("a run that is no shard", got=str(folder), allowed="runs with --shard K/N")
        return cls(folder=folder, about=about, lines=RunDirectory(folder).episodes())

    @property
    def shard(self) -> str:
        """K/N of the shard."""
        return str(self.about.configuration.shard)


def make_parser() -> Parser:
    """The command line's options."""
    parser = Parser(
        prog="python -m mpgrasp.bench merge",
        description="Put the shards of a run together.",
        epilog=_EPILOG,
    )
    parser.add_argument("folders", metavar="SHARD", nargs="+", type=Path, help="folder of a shard")
    parser.add_argument("--out", metavar="DIR", type=Path, required=True, help="folder of the whole run")
    return parser


def main(command: Sequence[str]) -> int:
    """Merge the shards, print the table and return the exit code.

    Raises:
        MpgraspError: runs that cannot be read or do not belong together, or a folder that cannot be written.
    """
    arguments = make_parser().parse_args(command)
    parts = [Part.read(folder) for folder in dict.fromkeys(arguments.folders)]
    _refuse_strangers(parts)
    run = merged(parts, arguments.out)
    every = planned(run.configuration)
    for part in parts:
        _refuse_stray_lines(part, every)
    missing = len(every) - sum(len(part.lines) for part in parts)
    directory = RunDirectory.create(arguments.out, run)
    with interrupts_wait():
        _copy_files(parts, arguments.out)
        directory.settle(line for part in parts for line in part.lines)
        lines = directory.episodes().in_order(every.place)
        code = conclude(directory, lines, run.configuration, finished=not missing)
    others = sum(entry.made_with is not None for entry in run.resumed)
    if others:
        print(
            f"mpgrasp: note: {others} of the parts were made with other versions or on other machines "
            f"than the first, see `resumed` in {arguments.out / RUN}",
            file=sys.stderr,
        )
    if missing:
        print(
            f"mpgrasp: {missing} of {len(every)} episodes are missing; --resume {arguments.out} plays them",
            file=sys.stderr,
        )
    return code or (EXIT_UNFINISHED if missing else 0)


def _refuse_strangers(parts: Sequence[Part]) -> None:
    """Raise ConfigError unless all are different shards of one run."""
    first = parts[0]
    seen: dict[str, Part] = {}
    for part in parts:
        found = _whole(first.about.configuration).difference(_whole(part.about.configuration))
        if found:
            raise ConfigError(
                f"shards of different runs ({found.words(str(first.folder), str(part.folder))})",
                got=str(part.folder),
                allowed="shards of one configuration",
            )
        if part.shard.partition("/")[2] != first.shard.partition("/")[2]:
            raise ConfigError(
                "shards of different sizes", got=[first.shard, part.shard], allowed="the same N in all K/N"
            )
        if part.shard in seen:
            raise ConfigError(
                f"shard {part.shard} twice",
                got=[str(seen[part.shard].folder), str(part.folder)],
                allowed="each once",
            )
        seen[part.shard] = part


def _refuse_stray_lines(part: Part, every: Roster) -> None:
    """Raise OutputError where a line is of no episode of a shard."""
    shard, seed = Shard.parse(part.shard), part.about.configuration.seed
    for line in part.lines:
        there = line.task in every and shard.has(line.episode) and line.seed == seed
        if not there or line.scene_seed != episode_seed(line.suite, seed, line.episode):
            raise OutputError(
                f"a line of {part.folder} is of no episode of shard {shard}",
                got=f"{line.task}, seed {line.seed}, scene_seed {line.scene_seed}",
                allowed="lines of this run alone; was the file edited?",
            )


def _whole(configuration: Configuration) -> Configuration:
    return msgspec.structs.replace(configuration, shard=None)


def merged(parts: Sequence[Part], out: Path) -> RunDescription:
    """Return the whole's run.json: a command without shard, and what other machines made it with."""
    first = parts[0].about
    others = [
        Resumption(
            started=part.about.started,
            made_with=part.about.made_with
            if any(differences(first.made_with.as_row(), part.about.made_with.as_row()))
            else None,
        )
        for part in parts[1:]
    ]
    later = [entry for part in parts for entry in part.about.resumed]
    return msgspec.structs.replace(
        first,
        command=_whole_command(first.command, out),
        configuration=_whole(first.configuration),
        resumed=(*others, *later),
    )


def _whole_command(command: str, out: Path) -> str:
    """The command of a shard, without the shard and with another folder."""
    words, kept = iter(shlex.split(command)), []
    for word in words:
        name, equals, _ = word.partition("=")
        if name in ("--shard", "--out"):
            if not equals:
                next(words, None)
            continue
        kept.append(word)
    return shlex.join([*kept, "--out", str(out)])


def planned(configuration: Configuration) -> Roster:
    """Every episode of a run, in the order of the plan."""
    return Roster(
        suites={part.suite.name: part.episodes for part in configuration.parts},
        methods=[Method(*cell.split("/", 1)) for cell in configuration.cells],
    )


def _copy_files(parts: Sequence[Part], out: Path) -> None:
    """Copy tracebacks, traces and recordings, whose names tell episodes apart.

    Raises:
        OutputError: one cannot be copied.
    """
    try:
        for part in parts:
            for name in _FOLDERS:
                if (part.folder / name).is_dir():
                    shutil.copytree(part.folder / name, out / name, dirs_exist_ok=True)
    except OSError as error:
        raise OutputError(f"files cannot be copied: {error.strerror or error}", got=str(out)) from error
