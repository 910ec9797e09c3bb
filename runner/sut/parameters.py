"""Parameters of systems under test: given with the name, as `cas:sensor_range=60,brake=6`, and read back for results.

The parameters of a system are the arguments of its class. What is given is checked against these: their names, and the
types that they are declared with or that their defaults have.
"""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Callable, Collection
from typing import Any

from schemas.common.errors import UsageError

SENSOR_RANGE = "sensor_range"
"""Parameter for the range (m) of a system's sensor, if it has one; failed verdicts mention it."""

Value = float | int | bool | str
_BOOLEANS = {"true": True, "false": False}
FIRST = ""
"""Name of a value that is given without one: that of the first parameter"""
_ARGUMENTS = re.compile(r":(?=\w+=)")


def split(text: str, known: Collection[str] = ()) -> tuple[str, dict[str, str]]:
    """Split a text into the name of a system and the texts of its parameters.

    Args:
        known: names of systems, after which the first value may stand without a name: `fmu:ego.fmu` is its first parameter.

    Raises:
        UsageError: what follows the name is not of the form NAME=VALUE,NAME=VALUE.
    """
    name, colon, values = text.partition(":")
    if name not in known or not colon:
        name, *rest = _ARGUMENTS.split(text, maxsplit=1)
        values = rest[0] if rest else ""
    given: dict[str, str] = {}
    for number, pair in enumerate(values.split(",") if values else ()):
        parameter, equals, value = pair.partition("=")
        if equals and parameter.isidentifier():
            given[parameter] = value
        elif number == 0 and name in known and pair:
            given[FIRST] = pair
        else:
            raise UsageError(f"the system under test {text!r}: NAME=VALUE is expected, not {pair!r}")
    return name, given


def arguments(factory: Callable[..., Any], given: dict[str, str], name: str) -> dict[str, Value]:
    """The arguments of a class of that name, from texts.

    Raises:
        UsageError: it has no such parameter, or a text is no value of its type.
    """
    declared = _declared(factory)
    values: dict[str, Value] = {}
    for parameter, text in given.items():
        if parameter == FIRST and declared:
            parameter = next(iter(declared))
        if parameter not in declared:
            there = ", ".join(declared) or "none"
            raise UsageError(f"the system under test {name!r} has no parameter {parameter!r}; there are {there}")
        values[parameter] = _value(text, _kind(declared[parameter]), f"the parameter {parameter} of {name!r}")
    return values


def parameters_of(system: Any) -> dict[str, Value]:
    """The parameters of a system and the values that it has, as far as these are numbers and texts."""
    found = {name: getattr(system, name, None) for name in _declared(type(system))}
    return {name: value for name, value in found.items() if isinstance(value, Value)}


def _declared(factory: Callable[..., Any]) -> dict[str, inspect.Parameter]:
    try:
        parameters = inspect.signature(factory).parameters.values()
    except (TypeError, ValueError):
        return {}
    named = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
    return {each.name: each for each in parameters if each.kind in named}


def _kind(parameter: inspect.Parameter) -> str:
    """Name of a parameter's type: as declared, or that of its default."""
    if parameter.annotation is not inspect.Parameter.empty:
        return str(getattr(parameter.annotation, "__name__", parameter.annotation))
    return type(parameter.default).__name__ if parameter.default is not inspect.Parameter.empty else "str"


def _value(text: str, kind: str, what: str) -> Value:
    if kind == "bool":
        if text.lower() not in _BOOLEANS:
            raise UsageError(f"{what} is true or false, not {text!r}")
        return _BOOLEANS[text.lower()]
    if kind not in ("float", "int"):
        return text
    try:
        number = int(text) if kind == "int" else float(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise UsageError(f"{what} is {'a whole' if kind == 'int' else 'a'} number, not {text!r}")
    return number
