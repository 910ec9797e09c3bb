"""The expressions of OpenSCENARIO XML: `${$speed / 3.6}`, and parameter references `$speed`.

Source: OpenSCENARIO XML 1.3.1, section 9.2. Operators, from the strongest: unary minus, functions
and `not`; `*`, `/` and `%`; `+` and `-`; `and`; `or`. There are numbers and booleans, no
comparisons and no text. Angles are in radians. Where the standard leaves it open: `/` is never an
integer division, `%` has the sign of its left operand, `round` rounds halves away from zero. A
result that is no finite number is an error.

Modules:

- `columns`: a number in many parameter sets at once
- `values`: the types of parameters and variables: reading their values from text

Example::

    evaluate("${$speed / 3.6}", {"speed": 36.0}.get)  # 10.0
"""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

from schemas.common.errors import ExitCode, ToolchainError, similar
from schemas.expressions.values import quoted

# vocabulary: values, functions, constants, operators --------------------------------------------


Value = float | int | bool | str
Number = float | int

FIRST_VERSION = (1, 1)
"""OpenSCENARIO 1.0 knows parameters, but no expressions."""
EXACT_INTEGERS = 2**53
"""A double holds all integers below it exactly."""
LARGEST = sys.float_info.max


class UnknownParameter(KeyError):
    """A name that no parameter has; its text has the most similar one.

    Args:
        name: as it was written. known: names of parameters.
    """

    def __init__(self, name: str, known: Iterable[str]) -> None:
        super().__init__(name)
        self._text = "; ".join(filter(None, (repr(name), similar(name, known))))

    def __str__(self) -> str:
        return self._text


class ExpressionError(ToolchainError):
    """An expression that is malformed, or that has no value."""

    exit_code = ExitCode.INVALID


class Function(NamedTuple):
    """A function of the standard: how many arguments, what it does, and the version that introduced
    it.

    Args:
        columns: the same of numbers of many parameter sets, to the last bit; None where numpy has
            no such function. A result that is no number stands for an argument that is refused.
    """

    arity: int
    apply: Callable[..., Number]
    since: tuple[int, int]
    columns: Callable[..., Any] | None = None


def _round(value: Number) -> int:
    # Not floor(x + 0.5), which makes 1 of the double below 0.5; nor round(), which takes halves to
    # even.
    whole = math.floor(abs(value))
    return int(math.copysign(whole + (abs(value) - whole >= 0.5), value))


def _by_numpy(name: str) -> Callable[..., Any]:
    """A function of numpy, which is imported where it is called."""

    def apply(value: Any) -> Any:
        import numpy as np

        return getattr(np, name)(value)

    return apply


def _chosen(is_second: Any, first: Any, second: Any) -> Any:
    """The second of two columns where that is said, as `max` and `min` choose of equal ones."""
    import numpy as np

    return np.where(is_second, second, first)


# numpy's sines and powers differ from those of `math` in their last bits: they are left out.
FUNCTIONS: dict[str, Function] = {
    "round": Function(1, _round, FIRST_VERSION),
    "floor": Function(1, math.floor, FIRST_VERSION, _by_numpy("floor")),
    "ceil": Function(1, math.ceil, FIRST_VERSION, _by_numpy("ceil")),
    "sqrt": Function(1, math.sqrt, FIRST_VERSION, _by_numpy("sqrt")),
    "pow": Function(2, math.pow, FIRST_VERSION),
    "sin": Function(1, math.sin, (1, 3)),
    "cos": Function(1, math.cos, (1, 3)),
    "tan": Function(1, math.tan, (1, 3)),
    "asin": Function(1, math.asin, (1, 3)),
    "acos": Function(1, math.acos, (1, 3)),
    "atan": Function(1, math.atan, (1, 3)),
    "sign": Function(1, lambda value: (value > 0) - (value < 0), (1, 3), _by_numpy("sign")),
    "abs": Function(1, abs, (1, 3), abs),
    "max": Function(2, max, (1, 3), lambda left, right: _chosen(right > left, left, right)),
    "min": Function(2, min, (1, 3), lambda left, right: _chosen(right < left, left, right)),
}
CONSTANTS: dict[str, Value] = {"pi": math.pi, "e": math.e, "true": True, "false": False}


def _modulo(left: Number, right: Number) -> Number:
    if right == 0:
        raise ZeroDivisionError
    # The sign of the left operand; Python's `%` has that of the right one.
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
    """A value as it is written in a file: `true`, `5`, `0.1`; reading it back gives the same
    number."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return (
            str(int(value)) if abs(value) < EXACT_INTEGERS and value.is_integer() else repr(value)
        )
    return str(value)


def finite(value: Number, operator: str) -> Number:
    """Integers that a double does not hold exactly become doubles, which bounds their size."""
    if isinstance(value, int):
        return value if -EXACT_INTEGERS < value < EXACT_INTEGERS else float(value)
    if isinstance(value, float):
        bounded = -LARGEST <= value <= LARGEST
    else:  # numbers of many parameter sets
        bounded = bool((abs(value) <= LARGEST).all())
    if not bounded:
        raise ExpressionError(f"the result of {operator!r} is too large")
    return value


# from text to a function that gives the value ---------------------------------------------------


Lookup = Callable[[str], Value]
"""Value of the parameter with that name (without `$`); raises KeyError, or a ToolchainError that
says more."""

MAX_LENGTH = 10_000
MAX_NESTING = 50

_TOKEN = re.compile(
    r"\s*(?:(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)|\$(?P<parameter>[A-Za-z_]\w*)"
    r"|(?P<name>[A-Za-z_]\w*)|(?P<symbol>[-+*/%(),]))",
    re.ASCII,
)

Node = Callable[[Lookup], Value]


class Expression(NamedTuple):
    """A parsed expression: its value by a look-up of parameters, and the names of the parameters
    and functions in it."""

    node: Node
    parameters: frozenset[str]
    functions: frozenset[str]


@lru_cache(maxsize=8192)
def parse(body: str) -> Expression:
    """Parse the text between `${` and `}`.

    Raises:
        ExpressionError: it is malformed.
    """
    parser = _ExpressionParser(_tokens(body))
    node = parser.expression()
    parser.expect_end()
    return Expression(node, frozenset(parser.parameters), frozenset(parser.functions))


def _tokens(body: str) -> list[tuple[str, str]]:
    if len(body) > MAX_LENGTH:
        raise ExpressionError(
            f"an expression of {len(body)} characters is longer than the {MAX_LENGTH} allowed"
        )
    # Blanks at the end are no token, and none has to match them.
    tokens, position, end = [], 0, len(body.rstrip())
    while position < end:
        match = _TOKEN.match(body, position)
        if match is None:
            character = body[position:].lstrip()[0]
            raise ExpressionError(f"{character!r} has no meaning in an expression")
        kind = str(match.lastgroup)
        tokens.append((kind, match[kind]))
        position = match.end()
    return tokens


class _ExpressionParser:
    """Recursive descent; chains of equal operators become one node, so that only brackets and
    functions nest."""

    def __init__(self, tokens: list[tuple[str, str]]) -> None:
        self.tokens = [*tokens, ("end", "")]
        self.position = 0
        self.nesting = 0
        self.parameters: set[str] = set()
        self.functions: set[str] = set()

    def accept(self, *texts: str) -> str | None:
        kind, text = self.tokens[self.position]
        if kind in ("symbol", "name") and text in texts:
            self.position += 1
            return text
        return None

    def expect(self, text: str) -> None:
        if self.accept(text) is None:
            raise ExpressionError(f"{text!r} is expected {self._here()}")

    def expect_end(self) -> None:
        if self.tokens[self.position][0] != "end":
            raise ExpressionError(f"an operator is expected {self._here()}")

    def _here(self) -> str:
        kind, text = self.tokens[self.position]
        return "at the end" if kind == "end" else f"before {'$' * (kind == 'parameter') + text!r}"

    def expression(self) -> Node:
        """Parse the longest expression that begins at the next token; `or` binds weakest.

        Raises:
            ExpressionError: there is none, or its brackets nest too deep.
        """
        self.nesting += 1
        if self.nesting > MAX_NESTING:
            raise ExpressionError(f"brackets nest deeper than the {MAX_NESTING} levels allowed")
        node = self._logical("or", lambda: self._logical("and", self._sum))
        self.nesting -= 1
        return node

    def _logical(self, word: str, operand: Callable[[], Node]) -> Node:
        nodes = [operand()]
        while self.accept(word):
            nodes.append(operand())
        if len(nodes) == 1:
            return nodes[0]
        combine = any if word == "or" else all
        # A list, no generator: every operand is evaluated, so that one of another type is an error
        # also where the others decide.
        return lambda lookup: combine([_boolean(node(lookup), word, node) for node in nodes])

    def _sum(self) -> Node:
        return self._chain(("+", "-"), lambda: self._chain(("*", "/", "%"), self._unary))

    def _chain(self, symbols: tuple[str, ...], operand: Callable[[], Node]) -> Node:
        first = operand()
        rest = []
        while symbol := self.accept(*symbols):
            rest.append((symbol, OPERATORS[symbol], operand()))
        if not rest:
            return first

        def node(lookup: Lookup) -> Value:
            value = _number(first(lookup), rest[0][0], first)
            for symbol, apply, right in rest:
                value = finite(apply(value, _number(right(lookup), symbol, right)), symbol)
            return value

        return node

    def _unary(self) -> Node:
        # In a loop: a row of prefixes does not nest, so MAX_NESTING would not bound recursion.
        prefixes = []
        while prefix := self.accept("-", "+", "not"):
            prefixes.append(prefix)
        operand = self._primary()
        if not prefixes:
            return operand

        def node(lookup: Lookup) -> Value:
            value = operand(lookup)
            for prefix in reversed(prefixes):
                if prefix == "not":
                    value = not _boolean(value, prefix, operand)
                else:
                    value = _number(value, prefix, operand) * (-1 if prefix == "-" else 1)
            return value

        return node

    def _primary(self) -> Node:
        kind, text = self.tokens[self.position]
        if kind == "symbol" and text == "(":
            self.position += 1
            node = self.expression()
            self.expect(")")
            return node
        # Before the token is taken: the error names the place where the value is missing.
        if kind in ("end", "symbol") or text in ("and", "or"):
            raise ExpressionError(f"a value is expected {self._here()}")
        self.position += 1
        if kind == "number":
            number = _literal_number(text)
            return lambda lookup: number
        if kind == "parameter":
            self.parameters.add(text)
            return _Parameter(text)
        return self._named(text)

    def _named(self, name: str) -> Node:
        if name in CONSTANTS:
            value = CONSTANTS[name]
            return lambda lookup: value
        if name not in FUNCTIONS:
            raise ExpressionError(
                f"{name!r} is neither a function nor a constant (a parameter is written ${name})"
            )
        self.functions.add(name)
        arity, apply, _, in_columns = FUNCTIONS[name]
        self.expect("(")
        arguments = [self.expression()]
        while self.accept(","):
            arguments.append(self.expression())
        self.expect(")")
        if len(arguments) != arity:
            raise ExpressionError(
                f"{name} takes {arity} argument{'s'[: arity - 1]}, not {len(arguments)}"
            )

        def node(lookup: Lookup) -> Value:
            values = [_number(argument(lookup), name, argument) for argument in arguments]
            if any(hasattr(value, "dtype") for value in values):
                # The caller then works out each set by itself.
                if in_columns is None:
                    raise TypeError(f"{name} is worked out for one number at a time")
                return finite(in_columns(*values), name)
            try:
                return finite(apply(*values), name)
            except (ValueError, OverflowError):
                raise ExpressionError(
                    f"{name}({', '.join(map(literal, values))}) has no finite value"
                ) from None

        return node


def _literal_number(text: str) -> Number:
    value = float(text)
    if not math.isfinite(value):
        raise ExpressionError(f"the number {text[:40]} is too large")
    return int(value) if text.isdigit() and value < EXACT_INTEGERS else value


@dataclass(frozen=True, slots=True)
class _Parameter:
    """The node of a parameter, which errors name."""

    name: str

    def __call__(self, lookup: Lookup) -> Value:
        return lookup(self.name)


def _shown(value: Value, node: Node) -> str:
    origin = f", the value of ${node.name}" if isinstance(node, _Parameter) else ""
    return f"{quoted(literal(value))}{origin}"


def _number(value: Value, operator: str, node: Node) -> Number:
    # First bool, which Python counts as a number: `true + 1` is an error.
    if isinstance(value, bool) or not isinstance(value, int | float):
        if hasattr(value, "dtype"):  # numbers of many parameter sets
            return value  # type: ignore[return-value]
        raise ExpressionError(f"{operator!r} needs a number, not {_shown(value, node)}")
    if not -LARGEST <= value <= LARGEST:
        raise ExpressionError(f"{operator!r} needs a finite number")
    return value


def _boolean(value: Value, operator: str, node: Node) -> bool:
    if not isinstance(value, bool):
        raise ExpressionError(f"{operator!r} needs true or false, not {_shown(value, node)}")
    return value


# values and references of attributes ------------------------------------------------------------


_QUOTED_LENGTH = 120
_REFERENCE = re.compile(r"\$([A-Za-z_][A-Za-z0-9_]*)")


def evaluate(text: str, lookup: Lookup) -> Value:
    """Value of an expression, given with its `${` and `}` or without.

    Args:
        text: the expression.
        lookup: gives the parameters' values.

    Raises:
        ExpressionError: it is malformed, uses a parameter that `lookup` does not know, mixes types,
            divides by zero, or its value is no finite number.
    """
    try:
        return parse(_strip(text)).node(lookup)
    except KeyError as error:
        raise ExpressionError(f"{_quoted(text)}: there is no parameter {error}") from None
    except ZeroDivisionError:
        raise ExpressionError(f"{_quoted(text)} divides by zero") from None
    except ExpressionError as error:
        raise ExpressionError(f"{_quoted(text)}: {error.message}") from None


def evaluate_columns(text: str, lookup: Callable[[str], Any]) -> Any:
    """Values of an expression in many parameter sets (n,); None where they can't be worked out at
    once.

    Args:
        text: the expression.
        lookup: gives the parameters' values: as of `evaluate`, or arrays of numbers (n,).
    """
    import numpy as np

    try:
        with np.errstate(all="ignore"):
            values = parse(_strip(text)).node(lookup)
    except (TypeError, ValueError, ArithmeticError, KeyError, ToolchainError):
        return None
    return values if isinstance(values, np.ndarray) else None


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
    return set(_parsed(text).parameters) if is_expression(text) else set()


def is_wellformed(text: str) -> bool:
    """Whether an attribute's value is a literal, a reference, or an expression
    that can be parsed.
    """
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
    return set(_parsed(text).functions)


def substitute(text: str, lookup: Lookup) -> str:
    """An attribute's value as a literal: `$name` and `${…}` are replaced by their values.

    Raises:
        ExpressionError: see `evaluate`.
    """
    if "$" not in text:
        return text
    reference = _REFERENCE.fullmatch(text)
    if reference:
        try:
            return literal(lookup(reference[1]))
        except KeyError as error:
            raise ExpressionError(f"there is no parameter {error}") from None
    return literal(evaluate(text, lookup)) if is_expression(text) else text


def is_expression(text: str) -> bool:
    """Whether an attribute's value is written as `${…}`."""
    return text.startswith("${") and text.endswith("}")


def _strip(text: str) -> str:
    return text[2:-1] if is_expression(text) else text


def _quoted(text: str) -> str:
    return repr(text if len(text) <= _QUOTED_LENGTH else f"{text[:_QUOTED_LENGTH]}…")


def _parsed(text: str) -> Expression:
    try:
        return parse(_strip(text))
    except ExpressionError as error:
        raise ExpressionError(f"{_quoted(text)}: {error.message}") from None
