"""Runs with recordings on disks that are too small for them, and that go on once there is room."""

from __future__ import annotations

import shutil
import time
from collections import Counter
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from refusals import BENCH, LIMIT, Ended, run
from whole_runs import PLAY_LIMIT, Bench, different, fault_at_end, results, row_of

from mpgrasp.bench.results.reader import EPISODES, RUN

_ON_A_SMALL_DISK = """
mount -t tmpfs -o size=$1 none "$2" || exit 99
shift; disk=$1; shift; more=$1; shift
"$@" --out "$disk/run"; echo $? > "$more/code"
mount -o remount,size=256m "$disk" || exit 99
cp -r "$disk" "$more/as-it-was"
"""
"""Plays a command on a disk of $1 bytes mounted at $2, and copies into $3 its exit code and what is left."""


@dataclass(frozen=True, kw_only=True)
class SmallDisk:
    """A run with recordings on a disk that is too small for it."""

    bench: Bench
    episodes: int

    @property
    def words(self) -> list[str]:
        """Command line of the run, without its folder."""
        plays = ["thin", "--detector", "oracle", "--controller", "open_loop", "--record", str(self.episodes)]
        return [*plays, "--episodes", str(self.episodes), "--workers", "1", "--quiet"]

    @cached_property
    def whole(self) -> Path:
        """Folder of the same run with room for all."""
        out = self.bench.folder / "roomy"
        shutil.rmtree(out, ignore_errors=True)
        return self.bench.play_whole([*self.words, "--out", str(out)], out)

    def sizes(self, number: int) -> list[int]:
        """Sizes [bytes] up to just too small, a page at least, each a fixed factor above the last."""
        full = sum(path.stat().st_size for path in self.whole.rglob("*") if path.is_file())
        low, high = 4096.0, 0.9 * full
        steps = max(1, number - 1)
        return [round(low * (high / low) ** (k / steps)) // 4096 * 4096 for k in range(number)]

    def play(self, size: int) -> dict[str, object]:
        """Play on a disk of `size` bytes, then go on with room; return the row of the study."""
        clock = time.monotonic()
        disk, more = (self.bench.folder / f"{name}-{size}" for name in ("disk", "beside"))
        for folder in (disk, more):
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir()
        small = ["unshare", "-rm", "sh", "-c", _ON_A_SMALL_DISK, "sh", str(size), str(disk), str(more)]
        ended = run(
            [*small, *BENCH, *self.words],
            self.bench.folder,
            {"MPGRASP_CACHE": str(self.bench.cache)},
            PLAY_LIMIT,
        )
        fault = fault_at_end(ended) or self._first(more, ended) or self._second(more / "as-it-was" / "run")
        return row_of("full disk", f"{size // 1024} KiB", fault, time.monotonic() - clock)

    def _first(self, more: Path, ended: Ended) -> str:
        code = (more / "code").read_text().strip()
        left = more / "as-it-was" / "run"
        parts = [path.name for path in left.rglob("*") if path.is_file() and not path.stat().st_size]
        names = [path for path in left.rglob("*") if path.suffix in {".rrd", ".gif", ".mp4"}]
        whole = {path: self.whole / path.relative_to(left) for path in names}
        cut = [path.name for path in names if not holds_the_same(path, whole[path])]
        if code not in ("1", "2"):
            return f"exit code {code} though the disk was full"
        if "No space left" not in ended.err:
            return f"does not say that the disk was full: {ended.err.strip()[-200:]}"
        if cut:
            return f"a recording that is cut off has its final name: {cut}"
        if [name for name in parts if name != EPISODES]:
            return f"empty files: {parts}"
        return ""

    def _second(self, left: Path) -> str:
        before = results(left) if (left / EPISODES).is_file() else []
        begun = (left / RUN).is_file()
        words = ["--resume", str(left)] if begun else [*self.words, "--out", str(left)]
        ended = self.bench.play(words)
        if fault := fault_at_end(ended):
            return fault
        lost = set(before) - set(results(left))  # error rows are tried again
        if any('"outcome": "error"' not in line for line in lost):
            return "finished episodes are lost"
        return different(left, self.whole)


def holds_the_same(path: Path, whole: Path) -> bool:
    """True if a recording holds what a whole one of the same episode does."""
    try:
        return _content(path) == _content(whole)
    except Exception:  # of the reader: the file has no end
        return False


def _content(path: Path) -> object:
    """Bytes; of a .rrd, whose bytes tell the time of day, the number of rows of each entity."""
    if path.suffix != ".rrd":
        return path.read_bytes()
    from rerun.chunk import RrdReader

    rows: Counter[str] = Counter()
    for chunk in RrdReader(path).stream():
        rows[chunk.entity_path] += chunk.num_rows
    return rows


def small_disks_here(folder: Path) -> str:
    """Return why no small disk can be mounted here; "" if one can."""
    try:
        ended = run(
            ["unshare", "-rm", "mount", "-t", "tmpfs", "-o", "size=4096", "none", str(folder)],
            folder,
            {},
            LIMIT,
        )
    except OSError as error:
        return str(error)
    return "" if ended.code == 0 else ended.err.strip() or f"exit code {ended.code}"
