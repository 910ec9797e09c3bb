"""Expressions over arrays have the values that they have one by one."""

from __future__ import annotations

import numpy as np
import pytest

from generation.twin.motion import value
from schemas.common.errors import Unsupported
from schemas.expressions import evaluate

A, B = np.array([1.0, -2.0, 0.0]), np.array([3.0, 4.0, -5.0])


@pytest.mark.parametrize(
    "text",
    [
        "${$A + 2.5 * $B}",
        "${-($A - $B) / 4}",
        "${min($A, $B) + max($A, 0)}",
        "${sign($A)}",
        "${sqrt(pow($A, 2)) + abs($B)}",
        "$A",
    ],
)
def test_values_are_those_of_the_language(text: str) -> None:
    found = value(text, {"A": A, "B": B}, 3)
    one_by_one = [
        evaluate(text, dict(zip("AB", each, strict=True)).__getitem__)
        for each in zip(A.tolist(), B.tolist(), strict=True)
    ]
    np.testing.assert_allclose(found, np.array(one_by_one, float))


def test_a_literal_is_the_same_everywhere() -> None:
    assert value("4.5", {}, 3).tolist() == [4.5] * 3


@pytest.mark.parametrize(
    "text", ["${$A % 2}", "${$C}", "${not $A}", "true", "fast", "${round($A)}"]
)
def test_what_is_no_arithmetic_is_refused(text: str) -> None:
    with pytest.raises(Unsupported):
        value(text, {"A": A, "B": B}, 3)
