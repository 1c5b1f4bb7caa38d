"""Shared parts of the studies: command lines, rates, paired tests, results on disk and the look of figures.

Every study leaves `run.json` (command, settings, versions, weights), `<study>.json` (results), `<study>.csv`
(the same as a table) and `<study>.png` in its folder.
"""

from __future__ import annotations

import csv
import json
import math
import os
import shlex
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from mpgrasp import command_line
from mpgrasp.bench.results.provenance import provenance, sha256
from mpgrasp.detectors.detector import GraspDetector
from mpgrasp.exceptions import ConfigError, OutputError
from mpgrasp.files.atomic import replace_file
from mpgrasp.files.json_values import json_value
from mpgrasp.paths import WEIGHTS
from mpgrasp.plugin_names import detectors_of
from mpgrasp.plugins import load_detector
from mpgrasp.statistics import holm, mcnemar, wilson_interval

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Item = TypeVar("Item")
RESULTS = Path(__file__).resolve().parent / "results"
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000")
"""Okabe and Ito's palette: told apart by colour-blind readers too."""
MARKERS = ("o", "s", "^", "D", "v", "P", "X")


Parser = command_line.Parser
"""Command line of a study; unusable arguments raise ConfigError."""


def run_command(study: Callable[[Sequence[str]], None], command: Sequence[str] | None) -> int:
    """Run a study's command line (`sys.argv` if None) and return the exit code; 2 for unusable input."""
    os.environ.setdefault("OMP_NUM_THREADS", "1")  # before torch is loaded, as in the benchmark

    def run() -> int:
        study(sys.argv[1:] if command is None else command)
        return 0

    return command_line.run_command(run)


def positive(name: str, *values: float) -> None:
    """Raise ConfigError unless all values are finite and above 0."""
    for value in values:
        if not 0 < value < math.inf:
            raise ConfigError(f"unusable {name}", got=value, allowed="above 0")


def not_negative(name: str, value: int) -> None:
    """Raise ConfigError unless the value is 0 or more."""
    if value < 0:
        raise ConfigError(f"negative {name}", got=value, allowed="0, 1, 2, ...")


def track(things: Iterable[Item], what: str, total: int) -> Iterable[Item]:
    """The things one after the other, with a progress bar on a terminal."""
    from rich.console import Console
    from rich.progress import track as rich_track

    hidden = not sys.stderr.isatty()
    return rich_track(things, what, total=total, console=Console(stderr=True), disable=hidden)


def about(script: str, command: Sequence[str], **settings: Any) -> dict[str, Any]:
    """Content of run.json: the command, the study's settings, and what it was made with."""
    return {
        "command": shlex.join(["python", f"benchmarks/{script}.py", *command]),
        **settings,
        "made_with": provenance(),
    }


def weights_hashes(detectors: Iterable[str]) -> dict[str, str | None]:
    """SHA-256 of each detector's shipped weights; None where it has no such file."""
    return {name: sha256(WEIGHTS / f"{name}.safetensors") for name in detectors}


def load_detectors(names: str) -> tuple[dict[str, GraspDetector], dict[str, Any]]:
    """Detectors by comma-separated names, NETWORK@FILE among them, and what run.json tells of them: runtimes
    and weights.

    Raises:
        MpgraspError: one of them cannot be had.
    """
    known, own = detectors_of(names)
    detectors = {name: load_detector(name, own.get(name)) for name in known}
    runtimes = {name: getattr(detector, "runtime", None) for name, detector in detectors.items()}
    hashes = {**weights_hashes(detectors), **{name: sha256(file) for name, file in own.items()}}
    return detectors, {"runtimes": runtimes, "weights_sha256": hashes}


def kept(path: Path, settings: Mapping[str, Any], make: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """The result of a part of a study, from `path` where it is there already: so interrupted ones go on.

    Raises:
        ConfigError: the file holds a result of other settings.
        OutputError: the file cannot be written or read.
    """
    wanted = json.loads(json.dumps(json_value(settings)))
    try:
        if path.is_file():
            there = json.loads(path.read_text("utf-8"))
            if there["settings"] != wanted:
                raise ConfigError(
                    "a result of other settings is in the way", got=str(path), allowed="another --out"
                )
            return dict(there["result"])
        path.parent.mkdir(parents=True, exist_ok=True)
    except (OSError, KeyError, TypeError, json.JSONDecodeError) as error:
        raise OutputError(f"result cannot be kept: {error!r}", got=str(path)) from error
    result: dict[str, Any] = json.loads(json.dumps(json_value(make())))
    _write(path, json.dumps({"settings": wanted, "result": result}) + "\n")
    return result


def rate(successes: int, n: int) -> dict[str, float]:
    """Count, n, rate (0 of nothing) and 95 % Wilson interval."""
    low, high = wilson_interval(successes, n)
    return {
        "count": successes,
        "n": n,
        "rate": successes / n if n else 0.0,
        "wilson_low": low,
        "wilson_high": high,
    }


def percent(found: Mapping[str, float]) -> str:
    """A result of `rate` in a table's column: percent and interval, 22 characters."""
    low, high = 100 * found["wilson_low"], 100 * found["wilson_high"]
    return f"{100 * found['rate']:5.1f} [{low:.1f}-{high:.1f}]".ljust(22)


def paired(right: Mapping[str, Sequence[bool]]) -> list[dict[str, Any]]:
    """Exact McNemar test of every pair: names and answers (n,) to the same n questions.

    p is two-sided and not yet corrected for the number of tests; see `corrected`.
    """
    rows = []
    for a, b in combinations(right, 2):
        only_a = sum(x and not y for x, y in zip(right[a], right[b], strict=True))
        only_b = sum(y and not x for x, y in zip(right[a], right[b], strict=True))
        counts = {"n": len(right[a]), "only_a": only_a, "only_b": only_b}
        rows.append({"a": a, "b": b, **counts, "p": mcnemar(only_a, only_b)})
    return rows


def corrected(tests: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """All tests of a study, each with `p_holm`: its `p` corrected after Holm over all of them."""
    return [{**test, "p_holm": p} for test, p in zip(tests, holm([test["p"] for test in tests]), strict=True)]


def figure(panels: int = 1, *, width: float = 6.0, height: float = 4.6) -> tuple[Figure, list[Axes]]:
    """A figure with panels side by side, each `width` x `height` inches, in the studies' common look."""
    import matplotlib
    from matplotlib.figure import Figure

    matplotlib.rcParams.update(
        {
            "font.size": 12,
            "axes.grid": True,
            "grid.color": "#dddddd",
            "axes.axisbelow": True,
            "axes.spines.top": False,
            "axes.spines.right": False,
            "legend.frameon": False,
        }
    )
    # not pyplot: a Figure of its own draws with Agg and needs no display
    made = Figure(figsize=(panels * width, height), dpi=120, layout="constrained")
    return made, list(made.subplots(1, panels, squeeze=False)[0])


def style(k: int) -> dict[str, Any]:
    """Colour and marker of the k-th thing in a figure."""
    return {"color": COLOURS[k % len(COLOURS)], "marker": MARKERS[k % len(MARKERS)]}


def error_bars(rates: Sequence[Mapping[str, float]]) -> tuple[list[float], list[list[float]]]:
    """Heights [%] and the (2, n) bars down and up [%] of results of `rate`, as matplotlib wants them."""
    heights = [100 * r["rate"] for r in rates]
    down = [100 * (r["rate"] - r["wilson_low"]) for r in rates]
    up = [100 * (r["wilson_high"] - r["rate"]) for r in rates]
    return heights, [[max(0.0, d) for d in down], [max(0.0, u) for u in up]]


def publish(
    out: Path,
    name: str,
    run: Mapping[str, Any],
    results: Mapping[str, Any],
    rows: Sequence[Mapping[str, Any]],
    picture: Figure,
) -> None:
    """Write run.json, and `name`.json with the results, `name`.csv with the rows and `name`.png.

    Raises:
        OutputError: the folder or a file cannot be written.
    """
    prepare(out)
    _write(out / "run.json", json.dumps(json_value(run), indent=1) + "\n")
    _write(out / f"{name}.json", json.dumps(json_value(results), indent=1) + "\n")
    flat = [_flat(row) for row in rows]
    try:
        with (out / f"{name}.csv").open("w", encoding="utf-8", newline="") as file:
            writer = csv.DictWriter(file, list(dict.fromkeys(key for row in flat for key in row)))
            writer.writeheader()
            writer.writerows(flat)
        picture.savefig(out / f"{name}.png", metadata={"Software": None})
    except OSError as error:
        raise OutputError(f"results cannot be written: {error}", got=str(out)) from error


def begin(out: Path, run: Mapping[str, Any]) -> None:
    """Write run.json before the first episode is played; `run` has `settings`, which a folder keeps.

    Raises:
        ConfigError: the folder holds a run of other settings.
        OutputError: it cannot be written or read.
    """
    prepare(out)
    path = out / "run.json"
    try:
        there = json.loads(path.read_text("utf-8")) if path.is_file() else None
        if there is not None and there["settings"] != json.loads(json.dumps(json_value(run["settings"]))):
            raise ConfigError("a run of other settings is in the way", got=str(out), allowed="another --out")
    except (OSError, KeyError, TypeError, json.JSONDecodeError) as error:
        raise OutputError(f"run.json cannot be read: {error!r}", got=str(path)) from error
    _write(path, json.dumps(json_value(run), indent=1) + "\n")


def prepare(out: Path) -> None:
    """Make the folder of the results, before hours are spent on them.

    Raises:
        OutputError: it cannot be made.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"results cannot be written: {error}", got=str(out)) from error


def _flat(row: Mapping[str, Any], before: str = "") -> dict[str, Any]:
    """One level of keys: {"hit": {"rate": 1}} becomes {"hit_rate": 1}."""
    flat: dict[str, Any] = {}
    for key, value in row.items():
        flat |= _flat(value, f"{before}{key}_") if isinstance(value, Mapping) else {before + key: value}
    return flat


def _write(path: Path, text: str) -> None:
    try:
        replace_file(path, text)
    except OSError as error:
        raise OutputError(f"results cannot be written: {error}", got=str(path)) from error
