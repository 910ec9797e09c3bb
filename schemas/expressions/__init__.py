"""The expressions of OpenSCENARIO XML: `${$speed / 3.6}`, and parameter references `$speed`.

Source: OpenSCENARIO XML 1.3.1, section 9.2. Operators, from the strongest: unary minus, functions and `not`; `*`, `/`
and `%`; `+` and `-`; `and`; `or`. There are numbers and booleans, no comparisons and no text. Angles are in radians.
Where the standard leaves it open: `/` is never an integer division, `%` has the sign of its left operand, `round` rounds
halves away from zero. A result that is no finite number is an error.
"""

from __future__ import annotations

import re

from schemas.expressions.language import FIRST_VERSION as FIRST_VERSION
from schemas.expressions.language import FUNCTIONS as FUNCTIONS
from schemas.expressions.language import ExpressionError as ExpressionError
from schemas.expressions.language import Value as Value
from schemas.expressions.language import literal as literal
from schemas.expressions.parser import Expression, parse
from schemas.expressions.parser import Lookup as Lookup

_QUOTED_LENGTH = 120
_REFERENCE = re.compile(r"\$([A-Za-z_][A-Za-z0-9_]*)")


def evaluate(text: str, lookup: Lookup) -> Value:
    """Value of an expression, given with its `${` and `}` or without.

    Args:
        text: the expression.
        lookup: gives the parameters' values.

    Raises:
        ExpressionError: it is malformed, uses a parameter that `lookup` does not know, mixes types, divides by zero,
            or its value is no finite number.
    """
    try:
        return parse(_strip(text)).node(lookup)
    except KeyError as error:
        raise ExpressionError(f"{_quoted(text)}: there is no parameter {error}") from None
    except ZeroDivisionError:
        raise ExpressionError(f"{_quoted(text)} divides by zero") from None
    except ExpressionError as error:
        raise ExpressionError(f"{_quoted(text)}: {error.message}") from None


def references(text: str) -> set[str]:
    """Names of the parameters that an attribute's value refers to; empty for a literal.

    Raises:
        ExpressionError: it is an expression, and malformed.
    """
    if "$" not in text:
        return set()
    reference = _REFERENCE.fullmatch(text)
    if reference:
        return {reference[1]}
    return set(_parse(text).parameters) if is_expression(text) else set()


def is_wellformed(text: str) -> bool:
    """Whether an attribute's value is a literal, a reference, or an expression that can be parsed."""
    try:
        references(text)
    except ExpressionError:
        return False
    return True


def functions(text: str) -> set[str]:
    """Names of the functions that an expression calls.

    Raises:
        ExpressionError: the expression is malformed.
    """
    return set(_parse(text).functions)


def substitute(text: str, lookup: Lookup) -> str:
    """An attribute's value as a literal: what `$name` and `${…}` stand for, everything else as it is.

    Raises:
        ExpressionError: see `evaluate`.
    """
    if "$" not in text:
        return text
    reference = _REFERENCE.fullmatch(text)
    if reference:
        try:
            return literal(lookup(reference[1]))
        except KeyError:
            raise ExpressionError(f"there is no parameter {reference[1]!r}") from None
    return literal(evaluate(text, lookup)) if is_expression(text) else text


def is_expression(text: str) -> bool:
    """Whether an attribute's value is written as `${…}`."""
    return text.startswith("${") and text.endswith("}")


def _strip(text: str) -> str:
    return text[2:-1] if is_expression(text) else text


def _quoted(text: str) -> str:
    return repr(text if len(text) <= _QUOTED_LENGTH else f"{text[:_QUOTED_LENGTH]}…")


def _parse(text: str) -> Expression:
    try:
        return parse(_strip(text))
    except ExpressionError as error:
        raise ExpressionError(f"{_quoted(text)}: {error.message}") from None
