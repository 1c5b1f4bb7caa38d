"""Loads what is to be tried, tries every law, and returns the verdict."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from mpgrasp.check import (
    controller_memory,
    controller_motion,
    detector_form,
    detector_grasps,
    detector_memory,
)
from mpgrasp.check.controller_subject import ControllerSubject
from mpgrasp.check.detector_subject import DetectorSubject
from mpgrasp.check.laws import Law, try_laws
from mpgrasp.check.verdict import Verdict
from mpgrasp.controllers.controller import Controller
from mpgrasp.detectors.detector import GraspDetector
from mpgrasp.plugin_names import canonical
from mpgrasp.plugins import check_name, controller_names, detector_names, load_controller, load_detector
from mpgrasp.settings.sharing import controller_settings, detector_settings

DETECTOR_LAWS: tuple[Law[DetectorSubject], ...] = (
    *detector_form.LAWS,
    *detector_grasps.LAWS,
    *detector_memory.LAWS,
)
CONTROLLER_LAWS: tuple[Law[ControllerSubject], ...] = (
    *controller_memory.FIRST,
    *controller_motion.LAWS,
    *controller_memory.LAWS,
)


def try_detector(
    name: str,
    settings: Mapping[str, Any] | None = None,
    weights: Path | None = None,
    runtime: str = "auto",
) -> Verdict:
    """Try a detector.

    Args:
        name: in the registry, or `module:Class`.
        settings: in which it departs from its defaults; keyword arguments of a plug-in.
        weights: file in place of the shipped one.
        runtime: what computes a network of the registry.

    Raises:
        MpgraspError: it cannot be loaded or made ready.
    """
    name = canonical("detector", name)
    check_name("detector", name, detector_names())
    own = detector_settings((name,), settings or {})[name]

    def make() -> GraspDetector:
        return load_detector(name, weights, runtime, own)

    findings = try_laws(DETECTOR_LAWS, DetectorSubject.of(make), name)
    return Verdict(kind="detector", name=name, findings=findings)


def try_controller(name: str, settings: Mapping[str, Any] | None = None) -> Verdict:
    """Try a controller.

    Args:
        name: in the registry, or `module:Class`.
        settings: in which it departs from its defaults; keyword arguments of a plug-in.

    Raises:
        MpgraspError: it cannot be loaded.
    """
    name = canonical("controller", name)
    check_name("controller", name, controller_names())
    own = controller_settings((name,), settings or {})[name]

    def make() -> Controller:
        return load_controller(name, own)

    findings = try_laws(CONTROLLER_LAWS, ControllerSubject.of(make), name)
    return Verdict(kind="controller", name=name, findings=findings)
