"""`mpgrasp.evaluate`: play a suite with any detectors and controllers, and get typed results back."""

from __future__ import annotations

import io
import os
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

from mpgrasp.api.players import Players
from mpgrasp.api.results import Results
from mpgrasp.brought import brought
from mpgrasp.command_line import EXIT_BAD_INPUT, EXIT_INTERRUPTED
from mpgrasp.exceptions import ConfigError, OutputError
from mpgrasp.plugins import controller_names, detector_names


def evaluate(
    detector: Any = "dhrnet",
    controller: Any = "mppc",
    suite: str = "thin",
    *,
    episodes: int | None = None,
    settings: Mapping[str, Any] | None = None,
    seed: int = 0,
    weights: Mapping[str, Path | str] | None = None,
    workers: int | None = None,
    record: int = 0,
    camera: str = "auto",
    noise: bool = True,
    runtime: str = "auto",
    out: Path | str | None = None,
    progress: bool = True,
) -> Results:
    """Play a suite and return the results: the same episodes, bit for bit, as `python -m mpgrasp.bench`.

    Args:
        detector: name as on the command line ("dhrnet", "./my_net.py:MyNet", "dhrnet@mine.safetensors"), an
            object with `reset` and `predict`, a list of such, or a table of objects by name.
        controller: the same of controllers.
        suite: name of a suite or a programme, or a path to a declaration that ends in `.toml`.
        episodes: of each detector with each controller; None for what the suite declares.
        settings: settings by name, such as `{"controller.gamma": 4 / 3, "sensor.subpixel": 0.12}`.
        seed: of the run.
        weights: weights files by name of the detector.
        workers: processes beside this one; None for one per core, or 0, this one alone, where objects
            play: they cannot be sent to another.
        record: episodes of each combination that are recorded, the first ones.
        camera: "auto", "gl" or "ray".
        noise: True if the depth camera is as noisy as a real one.
        runtime: what computes the networks.
        out: folder of the results; None for one that goes with them, unless they are saved.
        progress: show a progress bar, in a terminal or a notebook.

    Returns:
        Results with `table()`, `plot()`, `to_dataframe()` and `save(DIR)`.

    Raises:
        ConfigError, WeightsError: input that cannot be used.
        OutputError: results that cannot be written.
        KeyboardInterrupt: it was interrupted.
    """
    from mpgrasp.bench.commands.run import parse
    from mpgrasp.bench.playing.run import run

    detectors = Players.of("detector", detector, detector_names())
    controllers = Players.of("controller", controller, controller_names())
    objects = bool(detectors.objects or controllers.objects)
    if workers is None:
        workers = 0 if objects else len(os.sched_getaffinity(0))
    elif objects and workers:
        # a copy in another process would not be what the caller holds
        raise ConfigError("objects play in this process alone", got=f"workers={workers}", allowed="0 or None")
    kept = tempfile.TemporaryDirectory(prefix="mpgrasp-") if out is None else None
    folder = Path(kept.name, "run") if kept is not None else Path(str(out))
    words = [suite, "--detector", ",".join(detectors.names), "--controller", ",".join(controllers.names)]
    words += ["--seed", str(seed), "--workers", str(workers), "--camera", camera, "--runtime", runtime]
    words += ["--record", str(record), "--out", str(folder)]
    words += [] if episodes is None else ["--episodes", str(episodes)]
    words += [] if noise else ["--no-noise"]
    words += [] if progress else ["--quiet"]
    words += [word for text in assignments(settings) for word in ("--set", text)]
    words += [word for name, file in (weights or {}).items() for word in ("--weights", f"{name}={file}")]
    with brought(detectors.objects, controllers.objects), redirect_stdout(io.StringIO()):
        code = run(parse(words), words)
    if code == EXIT_INTERRUPTED:
        raise KeyboardInterrupt
    if code == EXIT_BAD_INPUT:
        raise OutputError("results could not be written", got=str(folder), allowed="see what was printed")
    return Results(folder, kept=kept)


def assignments(settings: Mapping[str, Any] | None) -> list[str]:
    """Return settings by name as `--set` takes them."""
    return [f"{key}={_text(value)}" for key, value in (settings or {}).items()]


def _text(value: Any) -> str:
    """Return a value as `--set` takes it."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key} = {_text(item)}" for key, item in value.items()) + "}"
    if isinstance(value, Sequence):
        return "[" + ", ".join(map(_text, value)) + "]"
    return repr(value)
