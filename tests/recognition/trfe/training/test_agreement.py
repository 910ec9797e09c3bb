"""Agreement with the rules: shares of events and of quiet windows, and a δ that
other sites choose.
"""

from __future__ import annotations

from typing import Any, cast

import numpy as np
import pytest

from recognition.trfe.inputs.samples import BACKGROUND, UNKNOWN
from recognition.trfe.inputs.tokens import Tokens
from recognition.trfe.training.card import SiteWindows, accept, agreement, table
from recognition.trfe.training.windows import Windows
from recognition.trfe.trfe import TRFE

TOKENS = Tokens(others=1)


def windows(labels: list[int]) -> Windows:
    names, times = np.full(len(labels), "r"), np.arange(len(labels), dtype=float)
    return Windows(
        np.zeros((len(labels), *TOKENS.shape), np.float16),
        np.array(labels, np.int64),
        names,
        names,
        times,
    )


def test_shares_are_of_events_and_of_quiet_windows() -> None:
    found = {
        4: np.array([3, 3, BACKGROUND, UNKNOWN]),
        5: np.array([BACKGROUND, UNKNOWN, 3, 3, BACKGROUND]),
    }
    seen = SiteWindows(
        "here", windows([3, 4, 3, 4]), windows([BACKGROUND, BACKGROUND, BACKGROUND, 3, 3])
    )
    row = agreement(lambda part: found[len(part)], seen)
    assert (row.events, row.agree, row.nothing, row.unknown, row.wrong) == (
        4,
        0.25,
        0.25,
        0.25,
        0.25,
    )
    assert (row.quiet, row.still, row.odd) == (3, pytest.approx(1 / 3), pytest.approx(1 / 3))
    assert row.confirmed == 0.5
    assert row.classes == ((3, 2, 1), (4, 2, 0))
    assert "| here | 4 | 25.0% | 25.0% | 25.0% | 25.0% | 3 | 33.3% | 33.3% | 50.0% |" in table(
        [row]
    )


class Scored:
    """A model whose scores are given, with a threshold."""

    def __init__(self, scores: np.ndarray, threshold: float) -> None:
        self.scores = scores
        self.known = type(
            "Known", (), {"screening": type("Screening", (), {"threshold": threshold})()}
        )()

    def recognise(self, inputs: np.ndarray) -> Any:
        return type("Recognition", (), {"score": self.scores[: len(inputs)]})()


@pytest.mark.parametrize(("threshold", "expected"), [(0.5, 0.9), (0.95, 0.95)])
def test_at_most_a_tenth_of_events_elsewhere_is_unknown_and_never_more_than_before(
    threshold: float, expected: float
) -> None:
    model = Scored(np.linspace(0.0, 1.0, 101), threshold)
    accept(cast("TRFE", model), [windows([3] * 101)])
    assert model.known.screening.threshold == pytest.approx(expected)
    accept(cast("TRFE", model), [])
    assert model.known.screening.threshold == pytest.approx(expected)


def test_at_each_site_at_most_a_tenth_of_events_is_unknown() -> None:
    model = Scored(np.linspace(0.0, 1.0, 101), 0.1)
    accept(cast("TRFE", model), [windows([3] * 101), windows([3] * 11)])
    assert model.known.screening.threshold == pytest.approx(0.9)
