"""Expressions of OpenSCENARIO XML over arrays: the value of an attribute for many sets of parameters at once."""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from schemas.errors import Unsupported
from schemas.expressions import ExpressionError, is_expression, references
from xodr.array_types import FloatArray

_OPERATORS: dict[type, Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
}
_FUNCTIONS: dict[str, Callable[..., Any]] = {
    "min": np.minimum, "max": np.maximum, "abs": np.abs, "sign": np.sign, "sqrt": np.sqrt, "pow": np.power,
}  # fmt: skip


def value(text: str, parameters: Mapping[str, FloatArray], n: int) -> FloatArray:
    """The values (n,) of a literal, a reference or an expression.

    Args:
        parameters: values (n,) by name.

    Raises:
        Unsupported: it is no arithmetic of numbers, or refers to something else.
    """
    body = text[2:-1] if is_expression(text) else text
    try:
        unknown = references(text) - parameters.keys()
        found = _value(ast.parse(body.replace("$", "").strip(), mode="eval").body, parameters)
    except (ExpressionError, SyntaxError, KeyError):
        raise Unsupported(f"{text!r} can't be worked out for many points at once") from None
    if unknown:
        raise Unsupported(f"{text!r} refers to {min(unknown)}, which is no number")
    return np.broadcast_to(np.asarray(found, np.float64), (n,))


def _value(node: ast.expr, parameters: Mapping[str, FloatArray]) -> Any:
    match node:
        case ast.Constant(value=int() | float() as number):
            return float(number)
        case ast.Name(id=name):
            return parameters[name]
        case ast.UnaryOp(op=sign, operand=operand):
            return _OPERATORS[type(sign)](_value(operand, parameters))
        case ast.BinOp(left=left, op=sign, right=right):
            return _OPERATORS[type(sign)](_value(left, parameters), _value(right, parameters))
        case ast.Call(func=ast.Name(id=name), args=arguments):
            return _FUNCTIONS[name](*(_value(each, parameters) for each in arguments))
        case _:
            raise KeyError(node)
