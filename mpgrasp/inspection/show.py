"""`python -m mpgrasp.detectors show`: what detectors make of a scene of the benchmark, side by side."""

from __future__ import annotations

import argparse

from PIL import Image

from mpgrasp.detectors.detector import prepare
from mpgrasp.exceptions import ConfigError, OutputError
from mpgrasp.files.atomic import replacing
from mpgrasp.inspection.pictures import side_by_side
from mpgrasp.inspection.viewpoint import Viewpoint, look
from mpgrasp.plugin_names import detectors_of
from mpgrasp.plugins import load_detector, parse_weights
from mpgrasp.recording.recorder import claim_file
from mpgrasp.settings.changes import with_assignments
from mpgrasp.settings.grid import canonical_assignment
from mpgrasp.settings.sharing import detector_settings
from mpgrasp.suite import Suite, load_suite

GROUPS = ("scene", "sensor", "camera", "detector")
"""Groups of settings that a single look depends on."""


def run(options: argparse.Namespace) -> int:
    """Draw what detectors make of one frame, and say it in a line for each; return the exit code."""
    names, own = detectors_of(options.detector)
    if not all(names) or len(set(names)) < len(names):
        raise ConfigError("unusable list of detectors", got=options.detector, allowed="different detectors")
    suite = _suite(options)
    viewpoint = Viewpoint(
        suite=suite,
        seed=options.seed,
        episode=options.episode,
        height=options.height,
        above=options.above_object,
        camera=options.camera,
        noise=not options.no_noise,
    )
    weights = parse_weights(options.weights, names, own)
    settings = detector_settings(names, suite.detector)
    detectors = {
        name: load_detector(name, weights.get(name), options.runtime, settings[name]) for name in names
    }
    for line in filter(None, map(prepare, detectors.values())):
        print(line)
    frame, predictions = look(viewpoint, detectors)
    picture = side_by_side(frame, predictions, viewpoint.caption())
    try:
        with replacing(claim_file(options.out, (".png",))) as file:
            Image.fromarray(picture).save(file, optimize=True)
    except OSError as error:
        raise OutputError(f"a picture cannot be written: {error}", got=str(options.out)) from error
    for shown in predictions:
        name, *rest = shown.lines()
        print(f"{name}: {', '.join(rest).replace(',  ', ', ')}; first call {shown.first_milliseconds:.0f} ms")
    print(f"Picture: {options.out}")
    return 0


def _suite(options: argparse.Namespace) -> Suite:
    """The suite with what `--set` changes of it."""
    for text in options.set:
        setting, value = canonical_assignment(text)
        if setting.partition(".")[0] not in GROUPS:
            raise ConfigError(f"--set {setting} has no effect on a single look", got=value, allowed=GROUPS)
    (suite,) = with_assignments((load_suite(options.suite),), options.set, noise=not options.no_noise)
    return suite
