"""`python benchmarks/agreement.py RUN_A RUN_B`: in how many common episodes two runs had the same outcome.

Serves "with and without GL": the same command once with `--camera gl` and once with `--camera ray`.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path

KEY = ("suite", "seed", "episode", "detector", "controller")


def outcomes(run: Path) -> dict[tuple, tuple[str, str]]:
    """(outcome, hash of the final state) by episode."""
    text = (run / "episodes.jsonl").read_text(encoding="utf-8")
    lines = [json.loads(line) for line in text.splitlines()]
    return {tuple(line[k] for k in KEY): (line["outcome"], line["state_hash"]) for line in lines}


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the counts; exit code 2 where the runs share no episode or cannot be read."""
    folders = list(sys.argv[1:] if arguments is None else arguments)
    try:
        a, b = (outcomes(Path(folder)) for folder in folders)
    except (OSError, ValueError, KeyError) as error:
        print(f"agreement: needs two folders of finished runs; got {folders}: {error}", file=sys.stderr)
        return 2
    common = sorted(a.keys() & b.keys())
    if not common:
        print(f"agreement: no common episode; got {folders}", file=sys.stderr)
        return 2
    same = [key for key in common if a[key][0] == b[key][0]]
    identical = sum(a[key] == b[key] for key in common)
    print(f"{len(common)} common episodes, {len(same)} with the same outcome, {identical} equal bit by bit")
    for key in common:
        if a[key][0] != b[key][0]:
            print(f"  {'/'.join(map(str, key))}: {a[key][0]} there, {b[key][0]} here")
    return 0


if __name__ == "__main__":
    sys.exit(main())
