"""Expressions as OpenSCENARIO XML defines them."""

from __future__ import annotations

import math
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from schemas.common.errors import ToolchainError
from schemas.expressions import (
    FUNCTIONS,
    ExpressionError,
    evaluate,
    evaluate_columns,
    functions,
    is_expression,
    literal,
    references,
    substitute,
)

VALUES = {
    "a": 3,
    "b": 2.5,
    "yes": True,
    "text": "Ego",
    "number_text": "5",
    "inf": math.inf,
    "nan": math.nan,
    "huge": 10**400,
}


def lookup(name: str) -> float | int | bool | str:
    return VALUES[name]


@pytest.mark.parametrize(
    "text,expected",
    [
        ("${1 + 2 * 3}", 7),
        ("${(1 + 2) * 3}", 9),
        ("${2 - 3 - 4}", -5),
        ("${8 / 4 / 2}", 1),
        ("${7 / 2}", 3.5),
        ("${250/3.6}", 250 / 3.6),
        ("${7 % 3}", 1),
        ("${-7 % 3}", -1),
        ("${7.5 % 2}", 1.5),
        ("${-$a}", -3),
        ("${$a*-1*pi/2}", -1.5 * math.pi),
        ("${--$a}", 3),
        ("${+$a}", 3),
        ("${pow($b, 2)}", 6.25),
        ("${sqrt(9)}", 3),
        ("${round(2.5)}", 3),
        ("${round(-2.5)}", -3),
        ("${round(0.49999999999999994)}", 0),
        ("${floor(-0.5)}", -1),
        ("${ceil(0.5)}", 1),
        ("${abs(-3)}", 3),
        ("${sign(-2.5)}", -1),
        ("${sign(0)}", 0),
        ("${max($a, $b)}", 3),
        ("${min($a, $b)}", 2.5),
        ("${2*cos(pi/4)*sin(0.5/2)}", 2 * math.cos(math.pi / 4) * math.sin(0.25)),
        ("${acos(0) + asin(1) + atan(1) + tan(0)}", math.pi * 1.25),
        ("${e}", math.e),
        ("${not $yes}", False),
        ("${true or false and false}", True),
        ("${not false and true}", True),
        ("${$text}", "Ego"),
        ("${2.1E-7}", 2.1e-7),
        ("${.5 + 1.}", 1.5),
        ("$a + 1", 4),
    ],
)
def test_value(text, expected):
    result = evaluate(text, lookup)
    assert result == pytest.approx(expected) if isinstance(expected, float) else result == expected
    assert isinstance(result, bool) == isinstance(expected, bool)


@pytest.mark.parametrize(
    "text,reason",
    [
        ("${}", "a value is expected at the end"),
        ("${1 +}", "a value is expected at the end"),
        ("${(1}", r"'\)' is expected at the end"),
        ("${1 2}", "an operator is expected before '2'"),
        ("${1 < 2}", "'<' has no meaning"),
        ("${2 ** 3}", r"a value is expected before '\*'"),
        ("${2 ^ 3}", r"'\^' has no meaning"),
        ("${__import__('os')}", "has no meaning|neither a function"),
        ("${speed}", r"written \$speed"),
        ("${sqrt}", r"'\(' is expected"),
        ("${pow(2)}", "pow takes 2 arguments, not 1"),
        ("${sqrt(1, 2)}", "sqrt takes 1 argument, not 2"),
        ("${1 / 0}", "divides by zero"),
        ("${1 % 0}", "divides by zero"),
        ("${sqrt(-1)}", "has no finite value"),
        ("${acos(2)}", "has no finite value"),
        ("${pow(10, 400)}", "has no finite value"),
        ("${1e308 * 10}", "too large"),
        ("${1e999}", "too large"),
        ("${$inf + 1}", "finite"),
        ("${$nan * 2}", "finite"),
        ("${floor($inf)}", "finite"),
        ("${$huge + 1}", "finite"),
        ("${$text + 1}", "'Ego'"),
        ("${$number_text + 1}", r"needs a number, not '5', the value of \$number_text"),
        ("${$yes + 1}", r"needs a number, not 'true', the value of \$yes"),
        ("${not 1}", "needs true or false, not '1'"),
        ("${1 and true}", "needs true or false"),
        ("${$unknown}", "no parameter 'unknown'"),
        ("${" + "(" * 5000 + "1" + ")" * 4000 + "}", "nest deeper"),
        ("${" + "1+" * 6000 + "1}", "longer than"),
        ("${٣}", "has no meaning"),
    ],
)
def test_error_says_why(text, reason):
    with pytest.raises(ExpressionError, match=reason) as caught:
        evaluate(text, lookup)
    assert len(str(caught.value)) < 500


def test_long_chains_are_no_nesting():
    assert evaluate("1" + "+1" * 4000, lookup) == 4001
    assert evaluate("-" * 4000 + "1", lookup) == 1


@pytest.mark.parametrize(
    "text,expected",
    [
        ("plain", "plain"),
        ("5.0", "5.0"),
        ("$a", "3"),
        ("$text", "Ego"),
        ("$yes", "true"),
        ("${$b * 2}", "5"),
        ("${$b}", "2.5"),
        ("${1 / 3}", repr(1 / 3)),
        ("US$", "US$"),
        ("a$b", "a$b"),
        ("$a and $b", "$a and $b"),
        ("${", "${"),
    ],
)
def test_substitute(text, expected):
    assert substitute(text, lookup) == expected


def test_substitute_of_an_unknown_parameter_is_an_error():
    with pytest.raises(ExpressionError, match="unknown"):
        substitute("$unknown", lookup)


def test_errors_of_the_lookup_reach_the_caller():
    def refuse(name: str) -> float:
        raise ToolchainError(f"{name} is cyclic")

    with pytest.raises(ToolchainError, match="a is cyclic"):
        evaluate("${$a + 1}", refuse)


def test_references_and_functions():
    assert references("plain") == set()
    assert references("$a") == {"a"}
    assert references("a$b") == set()
    assert references("${$a + max($b, -$a)}") == {"a", "b"}
    assert functions("${$a + max($b, sin(1))}") == {"max", "sin"}
    assert not is_expression("$a")


@given(st.one_of(st.integers(-(2**53), 2**53), st.floats(allow_nan=False, allow_infinity=False)))
def test_numbers_round_trip(value):
    assert float(literal(value)) == value
    assert evaluate("${$x}", lambda name: value) == value


_numbers = st.one_of(st.integers(0, 10**6), st.floats(0, 1e6, allow_nan=False)).map(literal)
_expressions = st.recursive(
    _numbers | st.sampled_from(["$a", "$b", "$yes", "pi", "true"]),
    lambda inner: (
        st.builds(
            "({} {} {})".format,
            inner,
            st.sampled_from(["+", "-", "*", "/", "%", "and", "or"]),
            inner,
        )
        | st.builds(
            "{}({})".format,
            st.sampled_from([name for name, each in FUNCTIONS.items() if each.arity == 1]),
            inner,
        )
        | st.builds("-{}".format, inner)
    ),
    max_leaves=12,
)


@given(_expressions)
def test_generated_expressions_have_a_finite_value_or_a_clear_error(text):
    try:
        value = evaluate("${" + text + "}", lookup)
    except ExpressionError:
        return
    assert isinstance(value, bool) or math.isfinite(value)
    assert evaluate(substitute("${" + text + "}", lookup), lookup) == value


@given(
    st.recursive(
        _numbers,
        lambda inner: st.builds("({} {} {})".format, inner, st.sampled_from("+-*"), inner),
        max_leaves=10,
    )
)
def test_arithmetic_agrees_with_python(text):
    expected = eval(text)
    assert evaluate(text, lookup) == pytest.approx(float(expected), rel=1e-12, abs=1e-9)


@pytest.mark.slow
@given(st.text(max_size=30))
def test_any_text_is_substituted_or_refused(text):
    for each in (text, "${" + text + "}"):
        with suppress(ExpressionError):
            assert isinstance(substitute(each, lookup), str)


def test_values_of_many_sets_are_those_of_each() -> None:
    columns = {"a": np.array([3.0, -0.1, 7.5]), "b": np.array([0.3, 5.0, 1e-3])}
    for text in (
        "${$a * 3 - $b / $a}",
        "${-($a + 2) * $b}",
        "${max($a, $b) + min($a, 3) * max(sign($a - $b), 0)}",
        "${sqrt(abs($a)) - floor($b) / ceil($a + 2)}",
    ):
        found = evaluate_columns(text, columns.__getitem__)
        for row, value in enumerate(found):
            assert value == evaluate(text, {name: each[row] for name, each in columns.items()}.get)
    for text in ("${$a % $b}", "${round($a)}", "${sin($a)}", "${sqrt($a)}"):
        assert evaluate_columns(text, columns.__getitem__) is None, "of single numbers"
    assert evaluate_columns("${1 / ($a - 3)}", columns.__getitem__) is None, "one divides by zero"
    assert evaluate_columns("${0 / (1e308 * 10 * $a)}", columns.__getitem__) is None
