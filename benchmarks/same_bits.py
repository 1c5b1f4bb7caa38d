"""How often do other kernels, runtimes, cameras or numbers of workers change an episode, or its outcome?

    python benchmarks/same_bits.py

The same episodes are played under each setting, in a process of its own and by the benchmark's own command
line. The reference has nothing set; of `workers-1` and `workers-2`, the one that equals its number of
workers is its repetition. The runtime that played is told: where OpenVINO cannot compile for a limited
instruction set, torch plays. An episode is equal if its whole line in episodes.jsonl, hash of the final
state included, is the same but for the timing. Settings that the machine cannot play are named and left
out. Finished settings are kept in `settings/`, runs in `runs/`: the same command goes on where it was
interrupted.
"""

from __future__ import annotations

import hashlib
import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bit_settings import REFERENCE, SETTINGS, NotHere, Setting, play_if_here, source_hash
from study import (
    RESULTS,
    Parser,
    about,
    begin,
    error_bars,
    figure,
    kept,
    percent,
    publish,
    rate,
    run_command,
    style,
    track,
    weights_hashes,
)

import mpgrasp
from mpgrasp.bench.results.plug_in_source import source_hash as plug_in_hash
from mpgrasp.bench.results.processor import instruction_sets
from mpgrasp.bench.results.provenance import provenance
from mpgrasp.command_line import COUNT, SEED
from mpgrasp.exceptions import ConfigError
from mpgrasp.files.json_values import json_value
from mpgrasp.plugins import load_controller, load_detector
from mpgrasp.suite import load_suite

if TYPE_CHECKING:
    from matplotlib.figure import Figure

OUT = RESULTS / "same-bits"
ERROR = "error"
Played = Mapping[str, Any]
"""What is kept of a setting: see `bit_settings.digest`."""


def compare(reference: Mapping[str, Any], other: Mapping[str, Any]) -> dict[str, Any]:
    """Counts and rates of a detector's episodes under another setting against the reference.

    Episodes that either could not play are counted apart, as `errors`.

    Raises:
        ConfigError: the two have other episodes, or other scenes.
    """
    scenes = [{k: episode["scene_seed"] for k, episode in some.items()} for some in (reference, other)]
    if scenes[0] != scenes[1]:
        raise ConfigError(
            "episodes of two settings have other scenes",
            got=len(scenes[1]),
            allowed=f"{len(scenes[0])} alike",
        )
    pairs = {k: (reference[k], other[k]) for k in sorted(reference, key=int)}
    pairs = {k: two for k, two in pairs.items() if ERROR not in (two[0]["outcome"], two[1]["outcome"])}
    changed = {k: (a["outcome"], b["outcome"]) for k, (a, b) in pairs.items() if a["outcome"] != b["outcome"]}
    turned = sum("success" in two for two in changed.values())
    return {
        "n": len(pairs),
        "errors": len(reference) - len(pairs),
        "equal": rate(sum(a["line"] == b["line"] for a, b in pairs.values()), len(pairs)),
        "other_outcome": rate(len(changed), len(pairs)),
        "other_success": rate(turned, len(pairs)),
        "changes": [{"episode": int(k), "reference": a, "here": b} for k, (a, b) in changed.items()],
    }


def evaluate(played: Mapping[str, Played]) -> list[dict[str, Any]]:
    """A row per setting but the reference, and detector."""
    reference = played[REFERENCE.name]
    return [
        {
            "setting": name,
            "detector": detector,
            "runtime": result["runtimes"].get(detector),
            "blas": ", ".join(result["blas"]),
            **compare(episodes, result["episodes"].get(detector, {})),
        }
        for name, result in played.items()
        if name != REFERENCE.name
        for detector, episodes in reference["episodes"].items()
    ]


def table(rows: Sequence[Mapping[str, Any]], missing: Mapping[str, str]) -> str:
    """A line per row: episodes that are equal bit for bit, and outcomes that differ, in % with intervals."""
    head = f"{'setting':<18}{'detector':<12}{'runtime':<16}{'n':>5}{'errors':>8}  "
    lines = [head + f"{'equal %':<24}{'other outcome %':<24}other success %"]
    for row in rows:
        cells = (percent(row[key]) + "  " for key in ("equal", "other_outcome", "other_success"))
        start = f"{row['setting']:<18}{row['detector']:<12}{row['runtime'] or '':<16}"
        lines.append((start + f"{row['n']:>5}{row['errors']:>8}  " + "".join(cells)).rstrip())
    return "\n".join([*lines, *(f"{name:<18}not played: {why}" for name, why in missing.items())])


def draw(rows: Sequence[Mapping[str, Any]]) -> Figure:
    """A panel of the episodes that are not equal bit for bit, and one of the outcomes that differ."""
    settings, detectors = (list(dict.fromkeys(row[key] for row in rows)) for key in ("setting", "detector"))
    picture, panels = figure(2, width=4.8, height=1.8 + 0.36 * len(settings))
    for axes, key in zip(panels, ("equal", "other_outcome"), strict=True):
        for k, detector in enumerate(detectors):
            mine = [row for row in rows if row["detector"] == detector]
            rates = [row[key] for row in mine]
            if key == "equal":
                rates = [rate(found["n"] - found["count"], found["n"]) for found in rates]
            x, bars = error_bars(rates)
            y = [settings.index(row["setting"]) + 0.14 * (k - (len(detectors) - 1) / 2) for row in mine]
            axes.errorbar(x, y, xerr=bars, linestyle="", capsize=2, label=detector, **style(k))
        axes.set(yticks=range(len(settings)), ylim=(len(settings) - 0.5, -0.5))
        axes.set_yticklabels(settings if axes is panels[0] else [])
        axes.set_xlim(left=-1 if key == "equal" else None)
    panels[0].set_xlabel("not equal bit for bit [%]")
    panels[1].set_xlabel("other outcome [%]; bars: 95 % Wilson")
    panels[1].legend(loc="best")
    return picture


def chosen_settings(names: str | None) -> tuple[Setting, ...]:
    """The reference and the settings of those names; all where there is no choice.

    Raises:
        ConfigError: an unknown name.
    """
    if names is None:
        return SETTINGS
    known = {setting.name: setting for setting in SETTINGS}
    if unknown := [name for name in names.split(",") if name not in known]:
        raise ConfigError("unknown settings", got=unknown, allowed=list(known))
    return tuple(known[name] for name in dict.fromkeys((REFERENCE.name, *names.split(","))))


def play_all(
    told: Mapping[str, Any], command: Sequence[str], settings: Sequence[Setting], out: Path
) -> tuple[dict[str, Played], dict[str, str]]:
    """Play what is not kept yet; return all that is, and why the others cannot be played here.

    Raises:
        MpgraspError: results that are kept are of other settings, or the benchmark cannot play.
    """
    played: dict[str, Played] = {}
    missing: dict[str, str] = {}
    here = instruction_sets()
    for setting in track(settings, "settings", len(settings)):
        try:
            played[setting.name] = kept(
                out / "settings" / f"{setting.name}.json",
                {**told, "setting": asdict(setting)},
                lambda setting=setting: play_if_here(  # type: ignore[misc]
                    setting, here, command, out / "runs" / setting.name
                ),
            )
        except NotHere as error:
            missing[setting.name] = str(error)
    return played, missing


def _study(command: Sequence[str]) -> None:
    parser = Parser(description=__doc__)
    add = parser.add_argument
    add("suite", metavar="SUITE", nargs="?", default="single", help="default: %(default)s")
    add("--detector", metavar="D[,D]", default="dhrnet", help="default: %(default)s")
    add("--controller", metavar="C", default="mppc_robust", help="default: %(default)s")
    add("--episodes", metavar="N", type=COUNT, default=200, help="of each detector (default: 200)")
    add("--settings", metavar="S[,S]", help="play these alone, beside the reference (default: all)")
    add("--seed", metavar="S", type=SEED, default=0, help="0, 1, 2, ... (default: 0)")
    add("--out", metavar="DIR", type=Path, default=OUT, help="default: benchmarks/results/same-bits")
    options = parser.parse_args(command)
    settings = chosen_settings(options.settings)
    told = _settings(options.suite, options.detector, options.controller)
    told |= {"episodes": options.episodes, "seed": options.seed}
    run = about("same_bits", command, settings=told, varied=[asdict(setting) for setting in settings])
    begin(options.out, run)
    plays = [options.suite, "--detector", options.detector, "--controller", options.controller]
    plays += ["--episodes", str(options.episodes), "--seed", str(options.seed)]
    played, missing = play_all(told, plays, settings, options.out)
    rows = evaluate(played)
    if not rows:
        raise ConfigError("no setting but the reference can be played here", got=list(missing))
    results = {"rows": rows, "not_played": missing, "reference": _made_by(played[REFERENCE.name])}
    flat = [{key: value for key, value in row.items() if key != "changes"} for row in rows]
    publish(options.out, "same-bits", run, results, flat, draw(rows))
    print(
        f"Against the reference, {options.episodes} episodes of {options.suite} each; 95 % Wilson intervals."
    )
    print(f"{table(rows, missing)}\nResults: {options.out}")


def _made_by(result: Played) -> dict[str, Any]:
    return {key: value for key, value in result.items() if key != "episodes"}


def _settings(suite: str, detectors: str, controller: str) -> dict[str, Any]:
    """What decides the episodes beside the varied settings: a folder of results keeps it.

    Raises:
        MpgraspError: an unknown suite, detector or controller.
    """
    declared = json.dumps(json_value(load_suite(suite)), sort_keys=True)
    load_controller(controller)
    names = detectors.split(",")
    for name in names:
        load_detector(name)
    sources = {name: plug_in_hash("detector", name) for name in names}
    sources[controller] = plug_in_hash("controller", controller)
    made = provenance()
    return {
        "suite": suite,
        "suite_sha256": hashlib.sha256(declared.encode()).hexdigest(),
        "detectors": names,
        "controller": controller,
        "weights_sha256": weights_hashes(names),
        "source_sha256": source_hash(Path(mpgrasp.__file__).parent),
        "plug_ins_sha256": {name: found for name, found in sources.items() if found},
        "processor": made.processor,
        "packages": made.packages,
    }


def main(command: Sequence[str] | None = None) -> int:
    """Run the command line (`sys.argv` if not given) and return the exit code; 2 for unusable input."""
    return run_command(_study, command)


if __name__ == "__main__":
    sys.exit(main())
