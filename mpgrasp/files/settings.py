"""Tables of settings, as TOML files declare them, made into frozen config dataclasses."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Collection, Iterable, Mapping
from typing import TYPE_CHECKING, Any, Literal, TypeVar, get_args, get_origin, get_type_hints

import msgspec
import numpy as np

from mpgrasp.exceptions import ConfigError

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Config = TypeVar("Config", bound="DataclassInstance")

_IN_WORDS = {bool: "true or false", int: "a whole number", float: "a number", str: "a text"}


def from_table(kind: type[Config], table: object, where: str, defaults: Config | None = None) -> Config:
    """Return a config with the values of a table, and with defaults for what the table leaves out.

    A table within the table changes what it names of the config within the config, and nothing else: the
    rest stays as in the default of that field. Types are strict: true is no number, 2.0 is no whole number,
    but 2 is a number. Arrays become tuples, or numpy's where the default is one.

    Args:
        kind: class of the config, a dataclass.
        table: what was declared.
        where: place of the table, for error messages ("suite 'thin', [episode]").
        defaults: values of what the table leaves out; those of the class if None.

    Raises:
        ConfigError: a key that is unknown or missing, a value of another type, NaN or infinity, or values
            that the config itself refuses.
    """
    fields = {field.name: field for field in dataclasses.fields(kind) if field.init}
    if not isinstance(table, Mapping):
        raise ConfigError(f"{where} is not a table", got=table, allowed=fields)
    refuse_unknown(table, fields, where)
    hints = get_type_hints(kind)
    values = {} if defaults is None else {name: getattr(defaults, name) for name in fields}
    for key, value in table.items():
        default = values[key] if key in values else _default(fields[key])
        values[key] = _value(hints[key], value, f"{where}, {key}", default)
    for name, field in fields.items():
        if name not in values and _default(field) is dataclasses.MISSING:
            raise ConfigError(
                f"{where}, {name} is missing", allowed=_allowed(hints[name], dataclasses.MISSING)
            )
    try:
        return kind(**values)
    except (TypeError, ValueError) as error:
        raise ConfigError(f"{where}: {error}") from error


def refuse_unknown(table: Mapping[str, Any], allowed: Iterable[str], where: str) -> None:
    """Raise ConfigError for the first key of a table that is not allowed there."""
    allowed = list(allowed)
    for key in table:
        if key not in allowed:
            raise ConfigError(f"{where}: unknown key", got=key, allowed=allowed)


def merged(table: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return a table with the values of another one in place of its own, tables within them alike."""
    result = dict(table)
    for key, value in changes.items():
        both = isinstance(value, Mapping) and isinstance(result.get(key), Mapping)
        result[key] = merged(result[key], value) if both else value
    return result


def _default(field: dataclasses.Field[Any]) -> Any:
    """Return the default of a field; MISSING where there is none."""
    return field.default if field.default_factory is dataclasses.MISSING else field.default_factory()


def _value(hint: Any, value: Any, where: str, default: Any) -> Any:
    """Return the value of one field from what was declared for it."""
    if dataclasses.is_dataclass(default) and not isinstance(default, type):
        return from_table(type(default), value, where, default)
    if isinstance(default, np.ndarray):
        return np.array(_value(tuple[float, ...], value, where, tuple(default.tolist())))
    try:
        converted = msgspec.convert(value, hint, strict=True)
    except msgspec.ValidationError as error:
        raise ConfigError(f"{where} is unusable", got=value, allowed=_allowed(hint, default)) from error
    if not _is_finite(converted):
        raise ConfigError(f"{where} is not finite", got=value, allowed=_allowed(hint, default))
    return converted


def _is_finite(value: Any) -> bool:
    """True if no number in a value is NaN or infinite."""
    if isinstance(value, tuple):
        return all(map(_is_finite, value))
    return not isinstance(value, float) or math.isfinite(value)


def _allowed(hint: Any, default: Any) -> str | Collection[object]:
    """Return what a field takes: a list of values, a value such as its default, or words."""
    if get_origin(hint) is Literal:
        return get_args(hint)
    telling = default not in (None, (), dataclasses.MISSING) and not _holds_tables(hint)
    return f"a value such as {default!r}" if telling else _in_words(hint)


def _in_words(hint: Any) -> str:
    """Return the words for a type in a settings file."""
    inner = [kind for kind in get_args(hint) if kind not in (type(None), ...)]
    if _holds_tables(hint):
        return "a table" if get_origin(hint) is dict else "a list of tables"
    if get_origin(hint) is tuple:
        return "a list" if ... in get_args(hint) else f"a list of {len(inner)}, each {_in_words(inner[0])}"
    return " or ".join(map(_in_words, inner)) if inner else _IN_WORDS.get(hint, "a table")


def _holds_tables(hint: Any) -> bool:
    """True for a table, and for a list of tables."""
    return dict in (get_origin(hint), *(get_origin(kind) for kind in get_args(hint)))
