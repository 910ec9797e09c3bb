"""The types of parameters and variables: reading their values from text, and comparing them.

The one truth of these types: checks name what `typed` refuses, and so does loading, unless `meant`
knows what it stands for.

Source: OpenSCENARIO XML 1.3.1, ParameterType and Rule; the value ranges are those of XML Schema's
types.
"""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable
from datetime import UTC, datetime
from functools import lru_cache

Value = float | int | str | bool | datetime

_INTEGERS = {
    "int": (-(2**31), 2**31 - 1),
    "unsignedInt": (0, 2**32 - 1),
    "unsignedShort": (0, 2**16 - 1),
}
_SPELLINGS = {"integer": "int"}
TYPES = ("double", *_INTEGERS, "boolean", "string", "dateTime")
"""Names of the types; `integer`, the name that versions 1.0 and 1.1 use, is read as `int`."""

RULES: dict[str, Callable[[Value, Value], bool]] = {
    "equalTo": operator.eq,
    "notEqualTo": operator.ne,
    "greaterThan": operator.gt,
    "lessThan": operator.lt,
    "greaterOrEqual": operator.ge,
    "lessOrEqual": operator.le,
}
_EQUALITY = ("equalTo", "notEqualTo")

_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
_INFINITY = {"INF": math.inf, "+INF": math.inf, "-INF": -math.inf}
_OTHER_SPELLINGS = {
    "true": "true", "false": "false",
    "inf": "INF", "+inf": "INF", "-inf": "-INF", "infinity": "INF", "+infinity": "INF",
    "-infinity": "-INF",
}  # fmt: skip
_INTEGER = re.compile(r"[+-]?\d+", re.ASCII)
_BOOLEANS = {"true": True, "1": True, "false": False, "0": False}
_DATE = re.compile(r"\d{4}-\d\d-\d\d", re.ASCII)
_DATE_TIME = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(?:\.\d+)?(?:Z|[+-]\d\d:\d\d)?", re.ASCII)
_QUOTED_LENGTH = 80


MARK = "\u27e8"
"""Beginning of a text that stands for a number in many parameter sets
(`schemas.expressions.columns`); no literal begins so"""


def type_named(name: str) -> str:
    """The type of that name, one of `TYPES`.

    Raises:
        ValueError: there is no such type.
    """
    kind = _SPELLINGS.get(name, name)
    if kind not in TYPES:
        raise ValueError(f"{quoted(name)} is not a type, {', '.join(TYPES)} are")
    return kind


def typed(kind: str, text: str) -> Value:
    """The value that a text has as a `kind`; a date without a time zone is taken as UTC.

    Raises:
        ValueError: the text is no such value, or out of the type's range.
    """
    if kind == "string":
        return text
    if kind == "double":
        return number(text)
    if kind == "boolean":
        return boolean(text)
    return _date_time(text.strip()) if kind == "dateTime" else _integer(kind, text)


def meant(kind: str, text: str) -> str:
    """Return a text in the spelling of its type: itself, or a spelling of other tools put right.

    These are integers with a fraction of zeros (`2.0`), booleans and infinities in other spellings
    (`True`, `inf`), and dates without a time, which are midnight.

    Raises:
        ValueError: the text stands for no value of this type.
    """
    try:
        typed(kind, text)
    except ValueError:
        fixed = _OTHER_SPELLINGS.get(text.strip().lower(), text)
        if kind in _INTEGERS and number(text).is_integer():
            fixed = str(int(number(text)))
        if kind == "dateTime" and _DATE.fullmatch(text.strip()):
            fixed = f"{text.strip()}T00:00:00"
        # Once more by the strict rule: a spelling that is put right may be out of the type's range.
        typed(kind, fixed)
        return fixed
    return text


_REFERENCE = re.compile(r"\$\w+")
_ARITHMETIC = re.compile(r"(?=[^/*%+]*\d)[-+(\s]*[\d.][\d.eE\s()]*([-+*/%][\d.eE\s()]+)+")
"""Text of arithmetic with numbers, which is one only in an expression"""


def _is_arithmetic(text: str) -> bool:
    return _ARITHMETIC.fullmatch(_REFERENCE.sub("0", text)) is not None


@lru_cache(maxsize=4096)
def number(text: str) -> float:
    """The number that a text is by the rules of XML Schema's double: `INF` is one, NaN is refused.

    Raises:
        ValueError: the text is not a number, or too large.
    """
    text = text.strip()
    if text in _INFINITY:
        return _INFINITY[text]
    if not _NUMBER.fullmatch(text):
        hint = f"; an expression is written ${{{text}}}" if _is_arithmetic(text) else ""
        if ".." in text or text.count(",") > 1:
            hint = "; several values are for a variation file: xosc new variation"
        raise ValueError(f"{quoted(text)} is not a number{hint}")
    value = float(text)
    # `1e999`: Python reads it as infinity, XML Schema as no value.
    if math.isinf(value):
        raise ValueError(f"{quoted(text)} is too large for a double")
    return value


def boolean(text: str) -> bool:
    """The boolean that a text is by the rules of XML Schema: true, false, 1 or 0.

    Raises:
        ValueError: the text is none of them.
    """
    value = _BOOLEANS.get(text.strip())
    if value is None:
        raise ValueError(f"{quoted(text)} is neither true nor false")
    return value


def literal(kind: str, value: Value, text: str) -> str:
    """Return a value, read from `text`, as an attribute of its type."""
    if kind in _INTEGERS:
        return str(value)
    return text if kind == "string" else text.strip()


def operand(value: Value, text: str) -> float | int | bool | str:
    """Return the operand of an expression for a value read from `text`. Dates stay text."""
    return text.strip() if isinstance(value, datetime) else value


def holds(rule: str, left: Value, right: Value) -> bool:
    """Whether `left rule right`, for values of the same type.

    Source: ParameterCondition and VariableCondition: order is defined between scalars, and between
    texts only where both can be converted to scalars.

    Raises:
        ValueError: there is no such rule, or no order between the values.
    """
    if rule not in RULES:
        raise ValueError(f"{quoted(rule)} is not a rule, {', '.join(RULES)} are")
    # Equality needs no order: texts and booleans have that too.
    if rule not in _EQUALITY:
        left, right = (_ordered(rule, value) for value in (left, right))
    return RULES[rule](left, right)


def quoted(text: str) -> str:
    """A text as it appears in messages, cut where it is long."""
    return repr(text if len(text) <= _QUOTED_LENGTH else f"{text[:_QUOTED_LENGTH]}…")


def _ordered(rule: str, value: Value) -> Value:
    if isinstance(value, bool):
        raise ValueError(f"{rule} has no meaning for booleans")
    if isinstance(value, str):
        try:
            return number(value)
        except ValueError:
            raise ValueError(f"{rule} has no meaning for the text {quoted(value)}") from None
    return value


def _integer(kind: str, text: str) -> int:
    if not _INTEGER.fullmatch(text.strip()):
        raise ValueError(f"{quoted(text)} is not an integer")
    value = number(text)  # int() would take its time with a million digits
    low, high = _INTEGERS[kind]
    if not low <= value <= high:
        raise ValueError(f"{quoted(text)} is out of the range of {kind}, {low} to {high}")
    return int(value)


def _date_time(text: str) -> datetime:
    try:
        # The pattern first: fromisoformat takes other forms of ISO 8601 too (20240531, week dates).
        value = datetime.fromisoformat(text) if _DATE_TIME.fullmatch(text) else None
    except ValueError:
        value = None
    if value is None:
        raise ValueError(f"{quoted(text)} is not a date and time such as 2024-05-31T12:00:00Z")
    return value if value.tzinfo else value.replace(tzinfo=UTC)
