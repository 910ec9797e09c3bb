"""Fuzzy rules over the relative state weigh the terms of an adversary's reward."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from schemas.common.errors import UsageError
from studies.generation.adversary.course import Course, Scene
from studies.generation.adversary.shape import fuzzy, nearness, probability, rule_weight, shape

seconds = st.floats(-1e6, 1e6, allow_nan=False)


@given(st.lists(st.tuples(seconds, seconds), min_size=1, max_size=5))
def test_weights_are_shares(states: list[tuple[float, float]]) -> None:
    weight = rule_weight(*np.array(states).T)
    assert weight.shape == (len(states),)
    assert ((weight >= 0.0) & (weight <= 1.0)).all()


def test_rules_hold_at_the_peaks_of_their_sets_and_are_mixed_between() -> None:
    closing = np.array([-50.0, -4.0, -2.0, 0.0, 4.0, 50.0])
    far = rule_weight(np.full(6, 10.0), closing)
    assert far[0] == far[1] == 0.5, (
        "opening: nearness counts as well, as the risk field is flat there"
    )
    assert far[2] == pytest.approx(0.5 * (far[1] + far[3]))
    assert far[4] == far[5] == 1.0, "closing: the risk field alone"
    assert (rule_weight(np.full(6, -5.0), closing) == 1.0).all(), "beside: the risk field alone"


def test_the_shape_lies_between_its_terms(scene: Scene, starts: np.ndarray) -> None:
    course = Course(scene, "none", starts, 0.05)
    terms = np.sort([probability(course), nearness(course)], axis=0)
    found = fuzzy(course)
    assert ((found >= terms[0] - 1e-12) & (found <= terms[1] + 1e-12)).all()


def test_an_unknown_shape_is_refused_with_the_names_of_all() -> None:
    with pytest.raises(
        UsageError, match="no objective 'luck'; objectives: risk-field, distance, fuzzy"
    ):
        shape("luck")
