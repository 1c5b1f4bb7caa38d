"""Run time of each network on each runtime, of all of predict() and of the network alone.

    python benchmarks/run_time.py

The paper's Fig. 5, whose line at 100 ms is where a detector begins to hold up a 10 Hz controller. All are
timed in turn, in a new order every round, so that whatever else the machine does hits all of them alike; the
first call of each turn is not counted. Run time does not depend on the weights: networks without a shipped
file, and DHRNet as wide as the authors', are timed with random ones. "torch f32, plain" is the network layer
by layer as it was trained, which the ratios refer to. The first call, compiling included, is timed apart:
with an empty cache, and with what that left in it.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import study
from timed_network import WIDE, Entry, available_runtimes, make_entry, network_size, time_all, weights_for

from mpgrasp.camera.backends import BACKENDS
from mpgrasp.camera.wrist_camera import WristCamera
from mpgrasp.command_line import COUNT, SEED, THREADS
from mpgrasp.depth import CROP, DepthFrame
from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import looking_down
from mpgrasp.scene.scene import build_scene
from mpgrasp.suite import episode_seed, load_suite
from mpgrasp.workspace import WORKSPACE_CENTRE

if TYPE_CHECKING:
    from matplotlib.figure import Figure


LIMIT_MS = 100.0
"""The paper's: below it a run time "does not affect motion planning" [ms]."""
SUITE = "thin"
"""Whose scenes the images show."""
CAMERA_HEIGHTS = (0.24, 0.57)
"""Lowest and highest camera over the table [m]."""
PLAIN = "torch f32, plain"
SPREAD = (5, 95)
"""Percentiles of the range beside the median."""


def frames(count: int, camera: str, seed: int) -> list[DepthFrame]:
    """Images of the suite's scenes from all heights, noise included."""
    suite, made = load_suite(SUITE), []
    for k, height in enumerate(np.linspace(*CAMERA_HEIGHTS, count)):
        scene_seed = episode_seed(suite.name, seed, k)
        scene = build_scene(suite.scene_config(k), scene_seed, robot=False)
        eye = WristCamera(scene.model, camera, crop=CROP)
        pose = looking_down([*WORKSPACE_CENTRE, height])
        made.append(eye.render(scene.data(), pose, np.random.default_rng(scene_seed)))
        eye.close()
    return made


def summarise(entries: Sequence[Entry], sizes: Mapping[str, Mapping[str, Any]]) -> list[dict[str, Any]]:
    """A row per entry: milliseconds, how many times faster than plain torch, first calls, size of network."""
    plain = {e.network: e for e in entries if e.timed.name == PLAIN}
    rows = []
    for e in entries:
        reference = plain[e.network]
        rows.append(
            {
                "network": e.network,
                "runtime": e.timed.name,
                "predict_ms": _spread(e.predict),
                "network_ms": _spread(e.alone),
                "speed_up": {
                    "predict": float(np.median(reference.predict) / np.median(e.predict)),
                    "network": float(np.median(reference.alone) / np.median(e.alone)),
                },
                "first_call_s": e.first_call,
                **sizes[e.network],
            }
        )
    return rows


def _spread(seconds: Sequence[float]) -> dict[str, float]:
    low, high = np.percentile(seconds, SPREAD)
    return {"median": 1e3 * float(np.median(seconds)), "p5": 1e3 * float(low), "p95": 1e3 * float(high)}


def draw(rows: Sequence[Mapping[str, Any]]) -> Figure:
    """Bars of predict()'s median, a group per network, a colour per runtime; line at 100 ms."""
    networks, runtimes = (list(dict.fromkeys(row[k] for row in rows)) for k in ("network", "runtime"))
    figure, (axes,) = study.figure(width=9.5, height=1.6 + 0.22 * len(rows))
    thick = 0.8 / len(runtimes)
    for j, runtime in enumerate(runtimes):
        chosen = [row for row in rows if row["runtime"] == runtime]
        at = [networks.index(row["network"]) + (j - (len(runtimes) - 1) / 2) * thick for row in chosen]
        times = [row["predict_ms"] for row in chosen]
        middle = [t["median"] for t in times]
        bars = [[t["median"] - t["p5"] for t in times], [t["p95"] - t["median"] for t in times]]
        axes.barh(
            at, middle, thick, xerr=bars, color=study.COLOURS[j], label=runtime,
            error_kw={"elinewidth": 1, "capsize": 2},
        )  # fmt: skip
        for y, t in zip(at, times, strict=True):
            axes.annotate(
                f"{t['median']:.{1 if t['median'] < 100 else 0}f}",
                (t["p95"], y),
                (4, 0),
                textcoords="offset points",
                va="center",
                fontsize=9,
            )
    axes.axvline(LIMIT_MS, color="black", linestyle="--", label=f"{LIMIT_MS:.0f} ms")
    axes.set_xscale("log")
    axes.set_xlim(1, 2 * max(row["predict_ms"]["p95"] for row in rows))
    axes.xaxis.set_major_formatter("{x:g}")
    axes.set_yticks(range(len(networks)), networks)
    axes.invert_yaxis()
    axes.grid(axis="y", visible=False)
    axes.set(xlabel="all of predict() [ms]; medians with 5 - 95 %", title="run time per image")
    figure.legend(loc="outside lower center", ncols=len(runtimes) + 1, fontsize=10)
    return figure


def table(rows: Sequence[Mapping[str, Any]]) -> str:
    """One line per row: medians [ms] with range, speed-up, first calls [s]."""
    lines = [
        f"{'network':>16} {'runtime':<18} {'predict() [ms]':<24} network [ms]  times faster  first call [s]"
    ]
    for row in rows:
        p, first = row["predict_ms"], row["first_call_s"]
        cached = "" if first["cached"] is None else f", cached {first['cached']:.2f}"
        lines.append(
            f"{row['network']:>16} {row['runtime']:<18} {p['median']:7.1f} [{p['p5']:.1f}-{p['p95']:.1f}]"
            f"{row['network_ms']['median']:>16.1f} {row['speed_up']['network']:>14.2f}"
            f"   {first['cold']:.2f}{cached}"
        )
    return "\n".join(lines)


def _study(command: Sequence[str]) -> None:
    parser = study.Parser(description=__doc__)
    add = parser.add_argument
    add("--network", metavar="N[,N]", help=f"default: all, and {WIDE}")
    add("--rounds", metavar="N", type=COUNT, default=30, help="images for each (default: %(default)s)")
    add(
        "--threads",
        metavar="N",
        type=THREADS,
        default=os.cpu_count(),
        help="default: all cores (%(default)s)",
    )
    add("--camera", choices=BACKENDS, default="auto", help="default: %(default)s")
    add("--seed", metavar="S", type=SEED, default=0, help="of scenes and order (default: 0)")
    add("--out", metavar="DIR", type=Path, default=study.RESULTS / "run-time")
    options = parser.parse_args(command)
    study.positive("number of rounds or threads", options.rounds, options.threads)
    study.not_negative("seed", options.seed)
    study.prepare(options.out)
    import torch

    from mpgrasp.detectors.networks.registry import NETWORKS

    known = [*NETWORKS, WIDE]
    names = options.network.split(",") if options.network else known
    for name in names:
        if name not in known:
            raise ConfigError("unknown network", got=name, allowed=known)
    torch.set_num_threads(options.threads)
    images = frames(min(options.rounds, 10), options.camera, options.seed)
    runtimes, entries, sizes = available_runtimes(), [], {}
    for name in names:
        weights, shipped = weights_for(name)
        sizes[name] = network_size(weights, shipped)
        entries += [make_entry(name, weights, runtime) for runtime in runtimes]
        print(f"{name}: ready on {', '.join(runtimes)}", file=sys.stderr, flush=True)
    time_all(entries, images, options.rounds, np.random.default_rng(options.seed))
    rows = summarise(entries, sizes)
    about = study.about(
        "run_time", command, rounds=options.rounds, threads=options.threads, seed=options.seed,
        weights_sha256=study.weights_hashes(n for n in names if n != WIDE),
    )  # fmt: skip
    results = {"limit_ms": LIMIT_MS, "rows": rows}
    study.publish(options.out, "run-time", about, results, rows, draw(rows))
    print(f"{table(rows)}\n{options.threads} threads. Results: {options.out}")


def main(command: Sequence[str] | None = None) -> int:
    """Run the command line (`sys.argv` if not given) and return the exit code; 2 for unusable input."""
    return study.run_command(_study, command)


if __name__ == "__main__":
    sys.exit(main())
