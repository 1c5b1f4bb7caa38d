"""Assignments such as `controller.gamma=4/3`, as the option `--set` takes them."""

from __future__ import annotations

import ast
import math
import operator
import re
import tomllib
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from mpgrasp.exceptions import ConfigError

Tables = dict[str, dict[str, Any]]
"""Tables of settings by group, nested where keys are."""

_FORM = "--set GROUP.KEY=VALUE, such as --set controller.gamma=4/3"
_VALUES = "a TOML value, a text, none, or arithmetic of numbers and pi, such as 4/3 or [0, pi/2]"
_CONSTANTS: Mapping[str, Any] = {"pi": math.pi, "none": None, "true": True, "false": False}
_OPERATIONS: Mapping[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}


def parse_assignments(texts: Sequence[str]) -> Tables:
    """Return the tables that assignments add up to; of two for one key, the last one counts.

    Raises:
        ConfigError: a text that is no assignment, or that takes a value for a table.
    """
    tables: Tables = {}
    for text in texts:
        setting, value = split_assignment(text)
        *tables_above, last = setting.split(".")
        place: dict[str, Any] = tables
        for key in tables_above:
            place = place.setdefault(key, {})
            if not isinstance(place, dict):
                raise ConfigError(f"--set {setting}: {key} has a value already", got=text, allowed=_FORM)
        found = parse_value(value, f"--set {setting}")
        if isinstance(place.get(last), dict) and not isinstance(found, dict):
            raise ConfigError(f"--set {setting}: keys within {last} are set already", got=text, allowed=_FORM)
        place[last] = found
    return tables


def split_assignment(text: str) -> tuple[str, str]:
    """Return the setting and the value of an assignment, as texts without blanks around them.

    Raises:
        ConfigError: a text that is no assignment.
    """
    path, separator, value = text.partition("=")
    keys = [key.strip() for key in path.split(".")]
    if not separator or len(keys) < 2 or not all(keys):
        raise ConfigError("unusable --set", got=text, allowed=_FORM)
    return ".".join(keys), value.strip()


def parse_value(text: str, where: str) -> Any:
    """Return the value of a text: TOML, arithmetic, or the text itself where it is one word.

    Args:
        text: of the value.
        where: place of the value, for error messages.

    Raises:
        ConfigError: none of the three.
    """
    try:
        read = tomllib.loads(f"value = {text}")
        if list(read) == ["value"]:
            return read["value"]
    except tomllib.TOMLDecodeError:
        pass
    if text in _CONSTANTS:
        return _CONSTANTS[text]
    if re.fullmatch(r"[A-Za-z_][\w-]*", text):
        return text
    try:
        return _computed(ast.parse(text, mode="eval").body)
    except (SyntaxError, ValueError, ArithmeticError, RecursionError, MemoryError) as error:
        raise ConfigError(f"{where} is unusable", got=text, allowed=_VALUES) from error


def _computed(node: ast.expr) -> Any:
    """Return the value of a number, a list, or the four operations; nothing else is evaluated."""
    if isinstance(node, ast.Constant) and isinstance(node.value, int | float | str):
        return node.value
    if isinstance(node, ast.Name) and node.id in _CONSTANTS:
        return _CONSTANTS[node.id]
    if isinstance(node, ast.List | ast.Tuple):
        return [_computed(item) for item in node.elts]
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        return -_number(node.operand)
    if isinstance(node, ast.BinOp) and type(node.op) in _OPERATIONS:
        return _OPERATIONS[type(node.op)](_number(node.left), _number(node.right))
    raise ValueError("neither a number nor a list")


def _number(node: ast.expr) -> int | float:
    value = _computed(node)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError("arithmetic is done with numbers")
    return value
