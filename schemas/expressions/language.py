"""Vocabulary of expressions: values, and the functions, constants and operators of the standard."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from typing import NamedTuple

from schemas.common.errors import ExitCode, ToolchainError

Value = float | int | bool | str
Number = float | int

FIRST_VERSION = (1, 1)
"""OpenSCENARIO 1.0 knows parameters, but no expressions."""
EXACT_INTEGERS = 2**53
"""A double holds all integers below it exactly."""
LARGEST = sys.float_info.max


class ExpressionError(ToolchainError):
    """An expression that is malformed, or that has no value."""

    exit_code = ExitCode.INVALID


class Function(NamedTuple):
    """A function of the standard: how many arguments, what it does, and the version that introduced it."""

    arity: int
    apply: Callable[..., Number]
    since: tuple[int, int]


def _round(value: Number) -> int:
    whole = math.floor(abs(value))
    return int(math.copysign(whole + (abs(value) - whole >= 0.5), value))


FUNCTIONS: dict[str, Function] = {
    "round": Function(1, _round, FIRST_VERSION),
    "floor": Function(1, math.floor, FIRST_VERSION),
    "ceil": Function(1, math.ceil, FIRST_VERSION),
    "sqrt": Function(1, math.sqrt, FIRST_VERSION),
    "pow": Function(2, math.pow, FIRST_VERSION),
    "sin": Function(1, math.sin, (1, 3)),
    "cos": Function(1, math.cos, (1, 3)),
    "tan": Function(1, math.tan, (1, 3)),
    "asin": Function(1, math.asin, (1, 3)),
    "acos": Function(1, math.acos, (1, 3)),
    "atan": Function(1, math.atan, (1, 3)),
    "sign": Function(1, lambda value: (value > 0) - (value < 0), (1, 3)),
    "abs": Function(1, abs, (1, 3)),
    "max": Function(2, max, (1, 3)),
    "min": Function(2, min, (1, 3)),
}
CONSTANTS: dict[str, Value] = {"pi": math.pi, "e": math.e, "true": True, "false": False}


def _modulo(left: Number, right: Number) -> Number:
    if right == 0:
        raise ZeroDivisionError
    rest = math.fmod(left, right)
    return int(rest) if isinstance(left, int) and isinstance(right, int) else rest


OPERATORS: dict[str, Callable[[Number, Number], Number]] = {
    "+": lambda left, right: left + right,
    "-": lambda left, right: left - right,
    "*": lambda left, right: left * right,
    "/": lambda left, right: left / right,
    "%": _modulo,
}


def literal(value: Value) -> str:
    """A value as it is written in a file: `true`, `5`, `0.1`; reading it back gives the same number."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return str(int(value)) if abs(value) < EXACT_INTEGERS and value.is_integer() else repr(value)
    return str(value)


def finite(value: Number, operator: str) -> Number:
    """Integers beyond those that a double holds exactly become doubles, which bounds their size."""
    if isinstance(value, int):
        return value if -EXACT_INTEGERS < value < EXACT_INTEGERS else float(value)
    if not -LARGEST <= value <= LARGEST:
        raise ExpressionError(f"the result of {operator!r} is too large")
    return value
