"""Detectors and controllers of a run, each with the settings of the suite at hand."""

from __future__ import annotations

from typing import Any

from mpgrasp.bench.playing.plan import Plan
from mpgrasp.controllers.controller import Controller
from mpgrasp.detectors.detector import GraspDetector
from mpgrasp.plugins import load_controller, load_detector


class Cast:
    """Makes who plays, and makes them anew only where a suite has other settings than the one before.

    One of each is kept: a sweep comes to its suites one after the other, and networks take memory.
    """

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        self._detectors: dict[str, tuple[Any, GraspDetector]] = {}
        self._controllers: dict[str, tuple[Any, Controller]] = {}

    def detector(self, name: str, suite: str) -> GraspDetector:
        """Return a detector with the settings of a suite.

        Raises:
            ConfigError, WeightsError: it cannot be used.
        """
        settings = self._plan.settings_of(suite).detectors.get(name)
        if name not in self._detectors or self._detectors[name][0] != settings:
            made = load_detector(name, self._plan.weights.get(name), self._plan.runtime, settings)
            self._detectors[name] = settings, made
        return self._detectors[name][1]

    def controller(self, name: str, suite: str) -> Controller:
        """Return a controller with the settings of a suite.

        Raises:
            ConfigError: it cannot be used.
        """
        settings = self._plan.settings_of(suite).controllers.get(name)
        if name not in self._controllers or self._controllers[name][0] != settings:
            self._controllers[name] = settings, load_controller(name, settings)
        return self._controllers[name][1]

    def rehearse(self) -> None:
        """Make once, before the first episode, whatever may refuse the settings of a suite.

        Networks of the registry are left out: their settings are checked where they are read.

        Raises:
            ConfigError: a plug-in or a controller that refuses its settings.
        """
        for suite in self._plan.suites[1:]:
            for name in self._plan.controllers:
                self.controller(name, suite.name)
            for name in self._plan.detectors:
                if ":" in name:
                    self.detector(name, suite.name)
