"""Programmes: several suites in one run, each method playing all of them, such as all trials of the paper."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain

from mpgrasp.bench.analysis.paper import Baseline, controllers_of
from mpgrasp.bench.playing.plan import every_method
from mpgrasp.bench.record import Method
from mpgrasp.exceptions import ConfigError
from mpgrasp.suite import Suite, load_suite, suite_names


@dataclass(frozen=True, kw_only=True)
class Programme:
    """Several suites under one name, which stands on the command line in the place of one suite."""

    title: str
    suites: tuple[str, ...]
    """In the order in which they are played, each with as many episodes as it declares."""
    detectors: tuple[str, ...]
    controllers: tuple[str, ...]
    references: tuple[Method, ...]
    """Played beside every detector with every controller, unless the command line names others."""

    def methods(
        self,
        detectors: Sequence[str] | None = None,
        controllers: Sequence[str] | None = None,
        baseline: Baseline | None = None,
    ) -> tuple[Method, ...]:
        """The methods that play.

        Args:
            detectors: in place of the programme's, and without its references; None: the programme's.
            controllers: likewise.
            baseline: whose controllers alone play of the programme's; None: all of them.
        """
        own = tuple(name for name in self.controllers if baseline is None or name in controllers_of(baseline))
        methods = every_method(detectors or self.detectors, controllers or own)
        return methods if detectors or controllers else (*methods, *self.references)


PROGRAMMES: dict[str, Programme] = {
    "paper": Programme(
        title="The paper's physical trials: Tables III, IV, V and VI",
        suites=("single", "unseen", "thin", "stacked"),
        detectors=("ggcnn", "tfgrasp", "dhrnet"),
        controllers=tuple(chain(*map(controllers_of, Baseline))),
        # the ceiling, and the floors: one look and no closed loop, nothing learned, no way to the side
        references=(
            Method("oracle", "mppc"),
            Method("dhrnet", "open_loop"),
            Method("heuristic", "mppc_robust"),
            Method("dhrnet", "straight_down"),
        ),
    ),
}
"""Programmes by name."""


def load_suites(name: str, only: Sequence[str] | None = None) -> tuple[Suite, ...]:
    """The suites of a programme, in its order, or the one suite of that name or path.

    Args:
        name: of a programme or a suite, or a path to a declaration.
        only: those suites of a programme that are wanted; None: all of them.

    Raises:
        ConfigError: no such programme or suite, or a declaration that cannot be used.
    """
    if name in PROGRAMMES:
        suites = PROGRAMMES[name].suites
        if only is not None and (not only or not set(only) <= set(suites)):
            raise ConfigError(f"unknown suite of {name}", got=",".join(only), allowed=suites)
        return tuple(load_suite(suite) for suite in suites if only is None or suite in only)
    if only is not None:
        raise ConfigError("--suites with a single suite", got=name, allowed=tuple(PROGRAMMES))
    known = suite_names()
    if name not in known and not name.endswith(".toml"):
        allowed = [*known, *PROGRAMMES, "a path that ends in .toml"]
        raise ConfigError("unknown suite", got=name, allowed=allowed)
    return (load_suite(name),)
