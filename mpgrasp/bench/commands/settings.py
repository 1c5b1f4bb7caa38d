"""`python -m mpgrasp.bench settings [SUITE]`: every setting of a run, its value and what it means."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import is_dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

from mpgrasp.bench.commands.run import add_settings
from mpgrasp.command_line import Parser
from mpgrasp.files.field_docs import field_docs

if TYPE_CHECKING:
    from mpgrasp.bench.playing.plan import Plan
    from mpgrasp.suite import Suite

_WIDEST = 48
"""Columns of the assignments; a longer one moves its meaning to the right."""
_EPILOG = """\
What stands before # can be given to --set as it is; none stands for no value. A setting of the detector or of
the controller goes to every one that has it. A suite's declaration has a table for each group.
"""


class Row(NamedTuple):
    """A setting."""

    path: str
    """Its group and its keys, with dots between them."""
    value: Any
    meaning: str

    def __str__(self) -> str:
        assignment = f"{self.path}={_literal(self.value)}"
        return f"  {assignment:<{_WIDEST}} # {self.meaning}" if self.meaning else f"  {assignment}"


def make_parser() -> Parser:
    """The command line's options."""
    parser = Parser(
        prog="python -m mpgrasp.bench settings",
        description="Print every setting of a run with its value, its unit and its meaning.",
        epilog=_EPILOG,
    )
    add = parser.add_argument
    add("suite", metavar="SUITE", nargs="?", default="thin", help="as for a run (default: thin)")
    add("--suites", metavar="S[,S]", help="as for a run")
    add("--detector", metavar="D[,D]", help="whose settings are printed, as for a run")
    add("--controller", metavar="C[,C]", help="whose settings are printed, as for a run")
    add("--no-noise", action="store_true", help="a perfect depth camera, which has no settings")
    add_settings(parser)
    return parser


def main(command: Sequence[str]) -> int:
    """Print the settings and return the exit code.

    Raises:
        ConfigError: input that cannot be used.
    """
    from mpgrasp.bench.commands.run import make_parser as run_parser
    from mpgrasp.bench.playing.planning import make_plan

    given = vars(make_parser().parse_args(command))
    arguments = run_parser().parse_args([given["suite"]])
    vars(arguments).update(given)
    plan, _ = make_plan(arguments)
    for suite in plan.suites:
        for heading, rows in sections(plan, suite):
            print(heading, *rows, sep="\n")
    return 0


def sections(plan: Plan, suite: Suite) -> Iterator[tuple[str, list[Row]]]:
    """Return the settings of a suite's episodes under headings."""
    from mpgrasp.settings.tree import tree
    from mpgrasp.suite import CALLERS

    first, *others = suite.scenes
    yield f"[scene] of {suite.name}", list(_rows("scene", first, vars(first)))
    for turn, scene in enumerate(others, 1):
        changed = {key: value for key, value in vars(scene).items() if value != getattr(first, key)}
        yield f"[scene] of {suite.name}, turn {turn}", list(_rows("scene", scene, changed))
    config = suite.episode_config(camera=plan.camera, noise=plan.noise)
    played = plan.settings_of(suite.name)
    groups = tree(config, played.controllers, played.detectors)
    groups["episode"] = {key: value for key, value in groups["episode"].items() if key not in CALLERS}
    for name, settings in groups.pop("controller").items():
        yield f"[controller] of {name}", list(_rows("controller", played.controllers[name], settings))
    for name, settings in groups.pop("detector").items():
        yield f"[detector] of {name}", list(_rows("detector", settings, settings))
    for group, settings in groups.items():
        if settings is not None:
            yield f"[{group}]", list(_rows(group, config if group == "episode" else settings, settings))


def _rows(path: str, config: Any, settings: Any) -> Iterator[Row]:
    """Return the settings of a config or a table, those of the configs within it in their place.

    Args:
        path: of the config.
        config: what has the meanings of its settings.
        settings: those that are wanted: a table of them, or the config itself.
    """
    docs = field_docs(type(config)) if is_dataclass(config) else {}
    table: Mapping[str, Any] = settings if isinstance(settings, Mapping) else vars(settings)
    for key, value in table.items():
        if is_dataclass(value):
            yield from _rows(f"{path}.{key}", value, value)
        else:
            yield Row(f"{path}.{key}", value, docs.get(key, ""))


def _literal(value: Any) -> str:
    """Return a value as --set takes it."""
    return "none" if value is None else json.dumps(value, default=_plain)


def _plain(value: Any) -> Any:
    """Return what JSON has a form for: an array's list, an object's name."""
    return value.tolist() if hasattr(value, "tolist") else getattr(value, "name", str(value))
