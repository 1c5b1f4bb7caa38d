"""`mpgrasp COMMAND ...`: one door to all commands, the same as `python -m mpgrasp.COMMAND ...`."""

from __future__ import annotations

import runpy
import sys
from collections.abc import Sequence

from mpgrasp.command_line import run_command
from mpgrasp.exceptions import ConfigError

COMMANDS = {
    "bench": "play suites, ladders, races and sweeps; compare, replay, report",
    "check": "whether a detector or a controller of your own may be believed",
    "detectors": "what detectors see, how exact they are, what made them",
    "evaluate": "score detectors on Cornell, Jacquard, or images of your own",
    "offline": "show a detector and a controller a recording of a real camera",
    "scene": "write the scene of an episode as a file",
    "view": "watch an episode while it is played",
    "training": "make training data, and train networks on them",
}
"""Commands with what they are for."""
_ALIASES = {"train": ("training", "train"), "generate": ("training", "generate")}


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command line (`sys.argv` if not given) and return its exit code; 2 for unusable input."""
    words = list(sys.argv[1:] if argv is None else argv)
    if not words or words[0] in ("-h", "--help"):
        print(_help())
        return 0
    if words[0] == "--version":
        from mpgrasp import __version__

        print(f"mpgrasp {__version__}")
        return 0
    return run_command(lambda: _run(words))


def _run(words: list[str]) -> int:
    name, *rest = words
    name, *more = _ALIASES.get(name, (name,))
    if name not in COMMANDS:
        raise ConfigError("unknown command", got=name, allowed=(*COMMANDS, *_ALIASES))
    before = sys.argv
    sys.argv = [f"mpgrasp {name}", *more, *rest]
    try:
        runpy.run_module(f"mpgrasp.{name}", run_name="__main__", alter_sys=False)
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else int(end.code is not None)
    finally:
        sys.argv = before
    return 0


def _help() -> str:
    width = max(map(len, COMMANDS)) + 2
    lines = [
        "usage: mpgrasp COMMAND ...",
        "",
        "Closed-loop robotic grasping in simulation.",
        "",
        *(f"  {name:<{width}}{text}" for name, text in COMMANDS.items()),
        "",
        "`mpgrasp train` and `mpgrasp generate` are those of training. Every command",
        "has a --help; `mpgrasp --version` prints the version.",
        "",
        "examples:",
        "  mpgrasp bench thin --detector dhrnet,heuristic --episodes 20",
        "  mpgrasp check detector my_net:MyDetector",
        "  mpgrasp evaluate frames my_frames --detector dhrnet --out out/frames",
    ]
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
