"""The least share of votes that a class needs: that of the greatest F1 of its windows."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
import pytest

from recognition.trfe.inputs.samples import BACKGROUND, UNKNOWN
from recognition.trfe.training.card import SiteWindows, least_shares
from recognition.trfe.trfe import TRFE
from tests.recognition.trfe.training.test_agreement import windows

EVENTS, QUIET = 10, 20


class Voting:
    """A model that gives labels with given shares: first at events, then at the stride."""

    def __init__(
        self, events: list[tuple[int, float]], regular: list[tuple[int, float]], classes: list[int]
    ) -> None:
        self.answers = {len(events): events, len(regular): regular}
        self.known = type("Known", (), {"classes": np.array(classes)})()

    def recognise(self, inputs: np.ndarray) -> Any:
        labels, shares = (
            np.array(values) for values in zip(*self.answers[len(inputs)], strict=True)
        )
        return type("Recognition", (), {"labels": labels, "share": shares})()


def chosen(
    events: list[tuple[int, float]], regular: list[tuple[int, float]], classes: list[int]
) -> dict[int, float]:
    site = SiteWindows("here", windows([3] * len(events)), windows([BACKGROUND] * len(regular)))
    return least_shares(cast("TRFE", Voting(events, regular, classes)), [site])


def test_classes_that_quiet_windows_get_with_few_votes_need_more() -> None:
    events = [(3, 0.5)] * 8 + [(3, 0.2), (UNKNOWN, 0.1)]
    regular = [(3, 0.3)] * 10 + [(4, 0.15)] * 5 + [(BACKGROUND, 0.9)] * 5
    found = chosen(events, regular, [3, 4, BACKGROUND])
    assert found == {
        3: pytest.approx(0.4),
        4: pytest.approx(0.52),
    }  # between both; between quiet windows and the greatest


def test_events_that_would_be_lost_keep_the_share_low() -> None:
    events = [(3, 0.2)] * 8 + [(3, 0.5)] * 2
    regular = [(3, 0.1)] * 2 + [(3, 0.3)] * 10 + [(BACKGROUND, 0.9)] * 8
    assert chosen(events, regular, [3, BACKGROUND]) == {3: pytest.approx(0.15)}


def test_a_class_that_is_always_right_needs_half_of_what_it_gets_and_one_that_is_always_wrong_more_than_it_gets() -> (
    None
):
    found = chosen([(3, 0.4)] * 5 + [(4, 0.5)] * 5, [(BACKGROUND, 0.9)] * QUIET, [3, 4, BACKGROUND])
    assert found == {
        3: pytest.approx(0.2),
        4: pytest.approx(0.7),
    }  # to the rules, events of class 4 are of class 3


def test_a_class_that_no_window_gets_has_none() -> None:
    assert 4 not in chosen([(3, 0.4)] * EVENTS, [(3, 0.1)] * QUIET, [3, 4, BACKGROUND])


def test_without_a_background_nothing_can_be_taken_for_nothing() -> None:
    assert not chosen([(3, 0.5)] * EVENTS, [(3, 0.1)] * QUIET, [3, 4])
