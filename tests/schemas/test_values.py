"""Types, literals and comparison rules."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from schemas.expressions.values import TYPES, holds, literal, meant, number, type_named, typed

RIGHT = [
    ("double", " 1.50 ", 1.5),
    ("double", "INF", math.inf),
    ("double", "-INF", -math.inf),
    ("double", ".5e-3", 0.0005),
    ("int", "-2147483648", -(2**31)),
    ("unsignedInt", "4294967295", 2**32 - 1),
    ("unsignedShort", "65535", 65535),
    ("boolean", "1", True),
    ("boolean", "false", False),
    ("string", " a ", " a "),
]
WRONG = [
    ("double", "NaN"),
    ("double", "nan"),
    ("double", "1_000"),
    ("double", "infinity"),
    ("double", "1e999"),
    ("double", "٣"),
    ("double", ""),
    ("int", "2.5"),
    ("int", "2.0"),
    ("int", "2147483648"),
    ("int", "INF"),
    ("unsignedInt", "-1"),
    ("unsignedShort", "65536"),
    ("boolean", "True"),
    ("boolean", "yes"),
    ("dateTime", "2024-05-31"),
    ("dateTime", "2024-13-31T12:00:00"),
    ("dateTime", "noon"),
]


@pytest.mark.parametrize(("kind", "text", "value"), RIGHT)
def test_values_are_read(kind, text, value):
    assert typed(kind, text) == value
    assert type(typed(kind, text)) is type(value)


@pytest.mark.parametrize(("kind", "text"), WRONG)
def test_wrong_values_are_refused(kind, text):
    with pytest.raises(ValueError):
        typed(kind, text)


def test_early_spelling_of_int_is_known():
    assert type_named("integer") == "int"
    with pytest.raises(ValueError, match="'float' is not a type"):
        type_named("float")


@given(st.floats(allow_nan=False))
def test_every_float_survives_its_text(value):
    text = repr(value).replace("inf", "INF")
    assert number(text) == value
    assert literal("double", value, text) == text


@given(st.sampled_from(TYPES), st.text(max_size=20))
def test_a_text_is_a_value_whose_literal_reads_the_same_or_a_value_error(kind, text):
    try:
        value = typed(kind, text)
    except ValueError:
        return
    assert typed(kind, literal(kind, value, text)) == value


@given(st.floats(allow_nan=False), st.floats(allow_nan=False))
def test_rules_compare_numbers(left, right):
    assert holds("equalTo", left, right) == (left == right)
    assert holds("notEqualTo", left, right) == (left != right)
    assert holds("greaterThan", left, right) == (left > right)
    assert holds("lessThan", left, right) == (left < right)
    assert holds("greaterOrEqual", left, right) == (left >= right)
    assert holds("lessOrEqual", left, right) == (left <= right)


def test_texts_have_an_order_only_as_numbers():
    assert holds("lessThan", "9", "10")
    assert holds("equalTo", "a", "a")
    with pytest.raises(ValueError, match="no meaning for the text 'a'"):
        holds("lessThan", "a", "10")
    with pytest.raises(ValueError, match="no meaning for booleans"):
        holds("lessThan", True, False)
    with pytest.raises(ValueError, match="is not a rule"):
        holds("sameAs", 1.0, 1.0)


def test_times_compare_across_zones():
    noon, same = (
        typed("dateTime", "2024-05-31T12:00:00"),
        typed("dateTime", "2024-05-31T14:00:00+02:00"),
    )
    assert holds("equalTo", noon, same)
    assert holds("lessThan", noon, typed("dateTime", "2024-05-31T12:00:00.500Z"))


@pytest.mark.parametrize(
    ("kind", "text", "fixed"),
    [
        ("int", "2.0", "2"),
        ("unsignedShort", " 7.00", "7"),
        ("boolean", "True", "true"),
        ("boolean", "FALSE", "false"),
        ("double", "inf", "INF"),
        ("double", "-Infinity", "-INF"),
        ("dateTime", "2024-05-31", "2024-05-31T00:00:00"),
        ("double", " 1.5", " 1.5"),
        ("string", "True", "True"),
    ],
)
def test_spellings_of_other_tools_are_known(kind, text, fixed):
    assert meant(kind, text) == fixed


@pytest.mark.parametrize(
    ("kind", "text"),
    [
        pair
        for pair in WRONG
        if pair
        not in (
            ("int", "2.0"),
            ("boolean", "True"),
            ("dateTime", "2024-05-31"),
            ("double", "infinity"),
        )
    ],
)
def test_what_has_no_meaning_is_not_guessed(kind, text):
    with pytest.raises(ValueError):
        meant(kind, text)


@given(st.sampled_from(TYPES), st.text(max_size=20))
def test_what_is_meant_is_typed_and_what_is_typed_is_meant(kind, text):
    try:
        fixed = meant(kind, text)
    except ValueError:
        with pytest.raises(ValueError):
            typed(kind, text)
        return
    typed(kind, fixed)
    assert meant(kind, fixed) == fixed
