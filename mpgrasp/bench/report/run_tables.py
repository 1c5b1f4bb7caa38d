"""Tables of the runs themselves: failures and how to play them again, commands, versions, physics card."""

from __future__ import annotations

import json
from collections.abc import Mapping
from itertools import islice
from typing import Any

from mpgrasp.bench.record import ClearingLine, ErrorLine, Line
from mpgrasp.bench.report.document import Table
from mpgrasp.bench.report.names import name_of
from mpgrasp.bench.report.shell_commands import replay_command
from mpgrasp.bench.results.runs import Run, Runs
from mpgrasp.files.json_values import Difference, difference

CARD = ("physics", "camera", "motion", "ik", "reflex")
"""Attributes of a run's description that make up the physics card."""
MOST_FAILURES = 2000
"""Failures that are listed in a report; all of them stand in episodes.jsonl."""
_ALIKE = ("seed", "camera", "noise", "episode")  # of the configurations of runs in one report


def failure_table(runs: Runs) -> Table | None:
    """Failures and error rows, with the commands that play them again; None where there are none."""
    lost = ((run, line) for run in runs.runs for line in run.lines if not line.success)
    rows = [
        (
            line.suite,
            name_of(line.task.cell.method),
            str(line.episode),
            str(line.scene_seed),
            "-" if isinstance(line, ErrorLine) else line.object,
            _what_happened(line, run),
            f"`{replay_command(run.folder, line.task)}`",
        )
        for run, line in islice(lost, MOST_FAILURES)
    ]
    if not rows:
        return None
    more = sum(1 for _ in lost)
    return Table(
        caption=f"Failures and errors: {len(rows) + more}" + (f", the first {len(rows)}" if more else ""),
        headings=("suite", "cell", "episode", "scene seed", "object", "what happened", "play it again"),
        rows=rows,
        note="The command plays the episode again, records it for rerun and as GIF, and says whether it is "
        "the same bit for bit.",
    )


def run_table(runs: Runs) -> Table:
    """Folder, state, seed, date and commit of every run."""
    rows = []
    for run in runs.runs:
        git = run.about.made_with.git
        commit = "-" if git is None else git.commit[:12] + (" and changes" if git.modified else "")
        state = {True: "complete", False: "not complete", None: "still running or cut short"}[run.complete]
        seed, episodes = str(run.configuration.seed), str(len(run.lines))
        rows.append((str(run.folder), episodes, state, seed, run.about.started, commit))
    return Table(
        caption="Runs", headings=("folder", "episodes", "state", "seed", "started", "commit"), rows=rows
    )


def configuration_differences(runs: Runs) -> list[str]:
    """Differences of the settings of the runs from those of the first one."""
    first, *others = runs.runs
    return [
        _words(found, first, run)
        for run in others for key in _ALIKE
        if (found := difference(getattr(first.configuration, key), getattr(run.configuration, key), key))
    ]  # fmt: skip


def card_tables(runs: Runs) -> list[Table]:
    """Physics, camera and limits of the first run, a table each; empty where it has no card."""
    tables = []
    for key in CARD:
        content = dict(getattr(runs.runs[0].about, key))
        geoms = content.pop("geoms", None) or {}
        if content:
            rows = [(name, _value(value)) for name, value in _flat(content)]
            tables.append(Table(caption=key, headings=("setting", "value"), rows=rows))
        if geoms:
            tables.append(_contact_table(geoms))
    return tables


def card_differences(runs: Runs) -> list[str]:
    """The first difference of each run's card from that of the first run."""
    first, *others = runs.runs
    differences = []
    for run in others:
        found = (difference(getattr(first.about, key), getattr(run.about, key), key) for key in CARD)
        differences += [_words(place, first, run) for place in found if place][:1]
    return differences


def _words(found: Difference, first: Run, run: Run) -> str:
    return found.words(f"in `{first.folder}`", f"in `{run.folder}`")


def _contact_table(geoms: Mapping[str, Any]) -> Table:
    """Contact settings, geoms with the same ones in one row."""
    alike: dict[str, list[str]] = {}
    for name, settings in geoms.items():
        alike.setdefault(json.dumps(settings), []).append(name)
    keys = list(dict.fromkeys(key for settings in geoms.values() for key in settings))
    rows = [
        (", ".join(names), *(_value(json.loads(settings).get(key)) for key in keys))
        for settings, names in alike.items()
    ]
    return Table(caption="contacts", headings=("geoms", *keys), rows=rows)


def _what_happened(line: Line, run: Run) -> str:
    if isinstance(line, ErrorLine):
        return f"error: {line.error}" + (f", see `{run.folder / line.traceback}`" if line.traceback else "")
    if isinstance(line, ClearingLine) and line.left:
        return f"{line.outcome}: {len(line.left)} objects left"
    if isinstance(line, ClearingLine) and line.knocked_off:
        return f"{line.outcome}: {len(line.knocked_off)} objects beside the basket"
    return f"{line.outcome}" + (f": {line.reflex.text}" if line.reflex else "")


def _flat(content: Mapping[str, Any], before: str = "") -> list[tuple[str, Any]]:
    found: list[tuple[str, Any]] = []
    for key, value in content.items():
        if isinstance(value, Mapping):
            found += _flat(value, f"{before}{key}.")
        else:
            found.append((f"{before}{key}", value))
    return found


def _value(value: Any) -> str:
    if isinstance(value, list):
        return ", ".join(_value(item) for item in value)
    return f"{value:g}" if isinstance(value, float) else str(value)
