"""Detectors and controllers by registry name, or by import path `module:Class` for your own.

A class given by import path is called with its settings by keyword, if any are given for it, and, where
weights are given for it, with `weights=Path(...)`. It must offer the methods of `GraspDetector` or of
`Controller`. What its module or its constructor does beyond that, such as exit or hang, becomes an error
(`foreign_code`).
"""

from __future__ import annotations

import importlib
import inspect
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mpgrasp.brought import brought_names, brought_object
from mpgrasp.controllers.controller import Controller
from mpgrasp.detectors.detector import GraspDetector
from mpgrasp.exceptions import ConfigError, MpgraspError, WeightsError
from mpgrasp.foreign_code import contained
from mpgrasp.plugin_names import SB3, base_name, canonical, detectors_of

if TYPE_CHECKING:
    from mpgrasp.controllers.config import ReachConfig
    from mpgrasp.detectors import DetectorConfig

_Calls = Mapping[str, Sequence[str]]

_DETECTOR_CALLS: _Calls = {"reset": ["truth"], "predict": ["frame"]}
_CONTROLLER_CALLS: _Calls = {
    "reset": ["seed"],
    "update": ["observation"],
    "final_grasp": [],
    "diagnostics": [],
}
_OPTIONAL_CALLS: _Calls = {"remember_failure": ["position"], "warm_up": []}
"""Methods that a plug-in may offer, and what they are called with."""

_IMPORT_PATH = re.compile(r"[^\W\d]\w*(\.[^\W\d]\w*)*:[^\W\d]\w*")


def detector_names() -> tuple[str, ...]:
    """Return the names in the registry of detectors, and of objects that were brought."""
    from mpgrasp.detectors import DETECTORS

    return (*DETECTORS, *brought_names("detector"))


def controller_names() -> tuple[str, ...]:
    """Return the names in the registry of controllers, and of objects that were brought."""
    from mpgrasp.controllers import CONTROLLERS

    return (*CONTROLLERS, *brought_names("controller"))


def check_name(kind: str, name: str, known: Iterable[str]) -> None:
    """Raise ConfigError unless the name is in the registry, with weights perhaps, or an import path."""
    known, separator = tuple(known), ":" in name
    if kind == "controller" and name.startswith(SB3):
        return  # its file is looked at when it is made
    if not separator:
        if (base_name(name) if kind == "detector" else name) in known:
            return
        raise ConfigError(
            f"unknown {kind}", got=name, allowed=[*known, f"your own {kind} as module:Class or FILE.py:Class"]
        )
    if not _IMPORT_PATH.fullmatch(name):
        raise ConfigError(
            f"{kind} plug-in has no such name", got=name, allowed="module:Class, package.module:Class"
        )


def load_detector(
    name: str,
    weights: Path | None = None,
    runtime: str = "auto",
    settings: DetectorConfig | Mapping[str, Any] | None = None,
) -> GraspDetector:
    """Return a detector, ready to use.

    Args:
        name: in the registry, an import path, a file, or an entry point (`plugin_names`).
        weights: file in place of the shipped one.
        runtime: what computes a network of the registry: auto, torch or openvino; a plug-in's is its
            own affair.
        settings: config of a detector of the registry, keyword arguments of a plug-in; None for its own.

    Raises:
        ConfigError: an unknown name, or a plug-in that cannot be imported or made.
        WeightsError: weights that are missing, unreadable or another network's.
    """
    theirs: GraspDetector | None = brought_object("detector", name)
    if theirs is not None:
        if weights is not None:
            raise ConfigError("an object has weights of its own", got=f"{name}={weights}", allowed="none")
        _check_calls("detector", name, theirs, _DETECTOR_CALLS)
        return theirs
    if weights is None:
        (name,), own = detectors_of(name)
        weights = own.get(name)
    name = canonical("detector", name)
    check_name("detector", name, detector_names())
    if weights is not None:
        _check_readable(weights)
    if ":" not in name:
        from mpgrasp.detectors import make_detector

        try:
            assert not isinstance(settings, Mapping)
            return make_detector(base_name(name), weights, runtime, settings)
        except MpgraspError:
            raise
        except Exception as error:  # a damaged file makes its reader fail in any way
            raise WeightsError(
                f"weights of {name} cannot be used ({type(error).__name__}: {error})",
                got="the shipped ones" if weights is None else str(weights),
                allowed=f"a weights file of {name}",
            ) from error
    assert settings is None or isinstance(settings, Mapping)
    arguments = {**(settings or {}), **({} if weights is None else {"weights": weights})}
    plug_in: GraspDetector = _make("detector", name, arguments, _DETECTOR_CALLS)
    return plug_in


def load_controller(name: str, settings: ReachConfig | Mapping[str, Any] | None = None) -> Controller:
    """Return a controller, ready to use.

    Args:
        name: in the registry, an import path, a file, or an entry point (`plugin_names`).
        settings: config of a controller of the registry, keyword arguments of a plug-in; None for its own.

    Raises:
        ConfigError: an unknown name, or a plug-in that cannot be imported or made.
    """
    theirs: Controller | None = brought_object("controller", name)
    if theirs is not None:
        _check_calls("controller", name, theirs, _CONTROLLER_CALLS)
        return theirs
    name = canonical("controller", name)
    check_name("controller", name, controller_names())
    if ":" not in name:
        from mpgrasp.controllers import make_controller

        assert not isinstance(settings, Mapping)
        return make_controller(name, settings)
    assert settings is None or isinstance(settings, Mapping)
    plug_in: Controller = _make("controller", name, settings or {}, _CONTROLLER_CALLS)
    return plug_in


def _check_readable(weights: Path) -> None:
    if not weights.is_file():
        raise WeightsError("no such weights file", got=str(weights), allowed="a file that exists")
    try:
        with weights.open("rb") as file:
            file.read(1)
    except OSError as error:
        raise WeightsError(
            "unreadable weights file", got=str(weights), allowed=f"a readable file ({error.strerror})"
        ) from error


def plug_in_class(kind: str, path: str) -> Callable[..., Any]:
    """Return the class at `module:Class`.

    Raises:
        ConfigError: it cannot be imported.
    """
    check_name(kind, path, ())
    if kind == "controller" and path.startswith(SB3):
        from mpgrasp.policies import policy_factory

        return policy_factory(path)
    module_name, _, class_name = path.partition(":")
    try:
        with contained(f"the import of a {kind} plug-in", path):
            module = importlib.import_module(module_name)
    except MpgraspError:
        raise
    except Exception as error:
        raise ConfigError(
            f"{kind} plug-in cannot be imported ({type(error).__name__}: {error})",
            got=path,
            allowed="module:Class with the module in this directory or installed",
        ) from error
    factory = getattr(module, class_name, None)
    if not callable(factory):
        classes = {n: item for n, item in vars(module).items() if isinstance(item, type) and n[0] != "_"}
        names = [n for n, item in classes.items() if item.__module__ == module.__name__] or [*classes]
        raise ConfigError(
            f"{kind} plug-in's module has no class {class_name!r}", got=path, allowed=names or "a class"
        )
    found: Callable[..., Any] = factory
    return found


def _make(kind: str, path: str, arguments: Mapping[str, Any], calls: _Calls) -> Any:
    """Return an instance of the class at `module:Class`; what goes wrong in there becomes a ConfigError."""
    factory = plug_in_class(kind, path)
    try:
        with contained(f"the constructor of a {kind} plug-in", path):
            made = factory(**arguments)
    except MpgraspError:
        raise
    except Exception as error:
        call = f"{path.partition(':')[2]}({', '.join(f'{key}=...' for key in arguments)})"
        raise ConfigError(
            f"{kind} plug-in cannot be made ({type(error).__name__}: {error})",
            got=path,
            allowed=f"a class that can be called as {call}",
        ) from error
    _check_calls(kind, path, made, calls)
    return made


def _check_calls(kind: str, path: str, made: Any, calls: _Calls) -> None:
    """Raise ConfigError if an object lacks a method, or one cannot be called as it is."""
    missing = [name for name in calls if not callable(getattr(made, name, None))]
    if missing:
        raise ConfigError(
            f"{kind} plug-in lacks {', '.join(missing)}", got=path, allowed=f"methods {', '.join(calls)}"
        )
    for name, names in {**calls, **_OPTIONAL_CALLS}.items():
        _check_call(f"{kind} plug-in's {name}", path, getattr(made, name, None), names)


def _check_call(what: str, path: str, method: Any, arguments: Sequence[str]) -> None:
    """Raise ConfigError if a method cannot be called with so many arguments."""
    if method is None:
        return
    if not callable(method):
        raise ConfigError(f"{what} is no method", got=path, allowed=f"({', '.join(arguments)})")
    try:
        signature = inspect.signature(method)
    except (TypeError, ValueError):  # what is written in C may hide its parameters
        return
    try:
        signature.bind(*arguments)
    except TypeError as error:
        raise ConfigError(
            f"{what} cannot be called as it is ({error})",
            got=f"{path}: {method.__name__}{signature}",
            allowed=f"({', '.join(['self', *arguments])})",
        ) from error


def parse_weights(
    given: Sequence[str], detectors: Sequence[str], own: Mapping[str, Path] | None = None
) -> dict[str, Path]:
    """Return weights files by detector from `FILE` or `DETECTOR=FILE`, and those that they bring themselves.

    Raises:
        ConfigError: it is unclear or impossible whose weights they are.
    """
    weights = dict(own or {})
    for text in given:
        name, separator, file = text.partition("=")
        if not (separator and name in detectors):
            if len(detectors) > 1:
                raise ConfigError(
                    "--weights does not say whose they are",
                    got=text,
                    allowed=[f"{d}=FILE" for d in detectors],
                )
            name, file = detectors[0], text
        if name in weights:
            raise ConfigError("--weights given twice for one detector", got=name, allowed="one file each")
        weights[name] = Path(file)
    return weights
