"""Settings of the study of bits: what is varied, how a setting is played, what is kept of its episodes."""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mpgrasp.bench.record import ErrorLine, Line
from mpgrasp.bench.results.reader import RUN, read_lines, read_run
from mpgrasp.exceptions import ConfigError, MpgraspError, OutputError

UNUSABLE, INTERRUPTED = 2, 130
"""Exit codes of the benchmark that leave nothing to compare; 0 and 1 (with error rows) do."""
_DIGITS = 16
"""Hexadecimal digits that are kept of a line's hash."""
_SHOWN = 300
"""Last characters of what a command said that go into a message."""


@dataclass(frozen=True, kw_only=True)
class Setting:
    """One way to play the same episodes."""

    name: str
    environment: Mapping[str, str] = field(default_factory=dict)
    options: tuple[str, ...] = ()
    """Options of the benchmark's command line."""
    needs: str = ""
    """Instructions without which it would crash, as numpy names them."""


REFERENCE = Setting(name="reference")
SETTINGS = (
    REFERENCE,
    Setting(name="blas-haswell", environment={"OPENBLAS_CORETYPE": "Haswell"}, needs="X86_V3"),
    Setting(name="blas-skylakex", environment={"OPENBLAS_CORETYPE": "SkylakeX"}, needs="X86_V4"),
    Setting(name="blas-nehalem", environment={"OPENBLAS_CORETYPE": "Nehalem"}, needs="X86_V2"),
    Setting(name="runtime-torch", options=("--runtime", "torch")),
    Setting(name="runtime-openvino", options=("--runtime", "openvino")),
    Setting(name="onednn-avx2", environment={"ONEDNN_MAX_CPU_ISA": "AVX2"}),
    Setting(name="camera-gl", options=("--camera", "gl")),
    Setting(name="camera-ray", options=("--camera", "ray")),
    Setting(name="workers-1", options=("--workers", "1")),
    Setting(name="workers-2", options=("--workers", "2")),
)
CLEARED = ("OPENBLAS_CORETYPE", "ONEDNN_MAX_CPU_ISA", "DNNL_MAX_CPU_ISA", "ATEN_CPU_CAPABILITY")
"""Variables of the user's own that choose kernels: no setting inherits them."""


class NotHere(Exception):
    """A setting that this machine cannot play; its text says why."""


def environment_of(setting: Setting, cache: str) -> dict[str, str]:
    """Environment of a setting's process; `cache` is a folder of its own.

    Compiled networks are cached by processor, which a limit of instructions does not change: from a shared
    cache a setting would read what another one has compiled.
    """
    inherited = {key: value for key, value in os.environ.items() if key not in CLEARED}
    return inherited | {"MPGRASP_CACHE": cache} | dict(setting.environment)


def bench(arguments: Sequence[str], environment: Mapping[str, str]) -> subprocess.CompletedProcess[str]:
    """Run the benchmark's command line in a process of its own."""
    command = [sys.executable, "-m", "mpgrasp.bench", *arguments]
    return subprocess.run(command, env=dict(environment), capture_output=True, text=True, check=False)


def play(setting: Setting, command: Sequence[str], folder: Path) -> dict[str, Any]:
    """Play a setting, or go on with what `folder` holds of it, and return what is kept of it.

    Raises:
        NotHere: the benchmark refuses the setting.
        OutputError: it ended in another way than with all episodes played.
        KeyboardInterrupt: it was interrupted.
    """
    begun = (folder / RUN).is_file()
    arguments = ["--resume", str(folder)] if begun else [*command, *setting.options, "--out", str(folder)]
    with tempfile.TemporaryDirectory(prefix="mpgrasp-bits-") as cache:
        done = bench([*arguments, "--quiet"], environment_of(setting, cache))
    said = " ".join((done.stderr or "").split())[-_SHOWN:]
    if done.returncode == UNUSABLE:
        raise NotHere(said)
    if done.returncode == INTERRUPTED:
        raise KeyboardInterrupt
    if done.returncode not in (0, 1):
        raise OutputError(
            f"{setting.name}: the benchmark ended early: {said}", got=f"exit code {done.returncode}"
        )
    return digest(folder)


def play_if_here(
    setting: Setting, here: Sequence[str], command: Sequence[str], folder: Path
) -> dict[str, Any]:
    """Play a setting whose instructions are among those that are `here`; see `play`.

    Raises:
        NotHere, OutputError, KeyboardInterrupt: as `play`.
        ConfigError: the benchmark refuses the reference, without which there is nothing to compare.
    """
    if setting.needs and setting.needs not in here:
        raise NotHere(f"this processor has no {setting.needs}")
    try:
        return play(setting, command, folder)
    except NotHere as error:
        if setting == REFERENCE:
            raise ConfigError(f"the benchmark refuses these episodes: {error}") from error
        raise


def digest(folder: Path) -> dict[str, Any]:
    """Outcome and hash of every line of a run without its timing, by detector, and what has computed them."""
    run = read_run(folder)
    episodes: dict[str, dict[str, Any]] = {}
    for line in read_lines(folder).lines:
        episodes.setdefault(line.detector, {})[str(line.episode)] = {
            "scene_seed": line.scene_seed,
            "outcome": str(line.outcome),
            "line": None if isinstance(line, ErrorLine) else hash_of(line),
        }
    return {
        "episodes": episodes,
        "blas": list(run.made_with.blas),
        "runtimes": {card.name: card.runtime for card in run.configuration.detectors},
        "camera": run.configuration.camera,
    }


def hash_of(line: Line) -> str:
    """Start of the SHA-256 of a line without its timing; the hash of the final state is part of the line."""
    row = {key: value for key, value in line.as_row().items() if key != "timing"}
    return hashlib.sha256(json.dumps(row, sort_keys=True).encode()).hexdigest()[:_DIGITS]


def source_hash(package: Path) -> str:
    """SHA-256 of all Python files of a package: a study that goes on must go on with the same code.

    Raises:
        MpgraspError: there are none.
    """
    files = sorted(package.rglob("*.py"))
    if not files:
        raise MpgraspError(f"no sources in {package}")
    found = hashlib.sha256()
    for file in files:
        found.update(file.relative_to(package).as_posix().encode() + b"\0")
        found.update(hashlib.sha256(file.read_bytes()).digest())
    return found.hexdigest()
