"""Verdicts on failures during a search: few runs of judges, within the budget."""

from __future__ import annotations

import numpy as np

from generation.search.methods.judging import Judging, aside
from generation.search.outcomes import JUDGES, Outcomes
from generation.space.space import Space
from recognition.labels.maneuvers.parameters import Parameter
from schemas.common.array_types import FloatArray

SPACE = Space((Parameter("Other_A", 0.0, 1.0), Parameter("Other_B", 0.0, 1.0)))


def drivers(theta: FloatArray, sut: str) -> Outcomes:
    """The second judge survives where A is below a half, the first one nowhere."""
    return Outcomes.of(len(theta), collision=(theta[:, 0] > 0.5) | (sut == JUDGES[0]))


def test_failures_among_judged_ones_of_one_verdict_cost_no_run() -> None:
    judging, generator = Judging(SPACE, drivers), np.random.default_rng(0)
    for centre in (0.2, 0.8):
        theta = centre + 0.02 * generator.random((40, 2))
        assert judging(theta, 1000).tolist() == [centre < 0.5] * 40
    counts = judging.counts
    assert counts.judged + counts.assumed == 80 and counts.unprevented == 40
    assert counts.judged <= 10 and counts.runs == len(JUDGES) * counts.judged
    assert "40 that none of them prevents" in str(counts)


def test_failures_at_the_border_of_what_is_prevented_are_judged_each() -> None:
    theta = np.stack([0.5 + np.linspace(-0.05, 0.05, 20), np.full(20, 0.5)], axis=1)
    judging = Judging(SPACE, drivers)
    assert judging(theta, 1000).tolist() == (theta[:, 0] <= 0.5).tolist()
    assert judging.counts.judged == 20


def test_judges_drive_no_more_than_is_left() -> None:
    judging = Judging(SPACE, drivers)
    assert judging(np.random.default_rng(0).random((50, 2)), 7).shape == (50,)
    assert judging.runs <= 7
    assert judging(np.array([[0.1, 0.1]]), 0).shape == (1,) and judging.runs <= 7


def test_what_is_set_aside_is_neither_a_failure_nor_a_near_miss() -> None:
    found = Outcomes.of(2, collision=[True, True], max_drac=[8.0, 8.0], clearance=[0.0, 0.0])
    kept = aside(found, np.array([True, False]))
    assert kept.collision.tolist() == [False, True]
    assert (kept.max_drac.tolist(), kept.clearance.tolist()) == ([0.0, 8.0], [np.inf, 0.0])
