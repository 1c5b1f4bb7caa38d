"""The same episodes in two ways that must not change a bit of them."""

from __future__ import annotations

import shutil
import time
from collections.abc import Mapping

from whole_runs import Bench, Way, different, fault_at_end, row_of

WAYS: Mapping[str, tuple[Way, Way]] = {
    "workers": (Way(options=("--workers", "1")), Way(options=("--workers", "2"))),
    "order": (
        Way(options=("--detector", "oracle,{detector}", "--controller", "mvp,mppc")),
        Way(options=("--detector", "{detector},oracle", "--controller", "mppc,mvp")),
    ),
    "hash seed": (Way(environment={"PYTHONHASHSEED": "1"}), Way(environment={"PYTHONHASHSEED": "2"})),
    "threads": (Way(environment={"OMP_NUM_THREADS": "1"}), Way(environment={"OMP_NUM_THREADS": "2"})),
}
"""What must not change a bit: how many processes play, in which order, with which hashes and threads."""
PAIRED = (
    ("thin", "dhrnet"),
    ("single", "tfgrasp"),
    ("unseen", "ggcnn"),
    ("thin_2mm", "ggcnn2"),
    ("single", "oracle"),
)
"""Suites and detectors of the pairs."""


def pair(bench: Bench, kind: str, suite: str, detector: str, episodes: int) -> dict[str, object]:
    """Play the same episodes in the two ways of a kind; return the row of the study."""
    clock, folders = time.monotonic(), []
    fault = ""
    for k, way in enumerate(WAYS[kind]):
        out = bench.folder / f"{kind}-{suite}-{detector}-{k}".replace(" ", "-")
        shutil.rmtree(out, ignore_errors=True)
        options = tuple(word.format(detector=_beside_oracle(detector)) for word in way.options)
        words = [suite, "--episodes", str(episodes), "--out", str(out)]
        if "--detector" not in options:
            words += ["--detector", detector, "--controller", "mppc"]
        ended = bench.play(words, Way(options=options, environment=way.environment))
        fault = fault or fault_at_end(ended)
        folders.append(out)
    fault = fault or different(*folders)
    return row_of("equal runs", f"{kind}: {suite}, {detector}", fault, time.monotonic() - clock)


def _beside_oracle(detector: str) -> str:
    return detector if detector != "oracle" else "dhrnet"
