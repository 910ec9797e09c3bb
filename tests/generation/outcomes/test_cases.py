"""Which episodes become edge cases."""

from __future__ import annotations

from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from generation.density.base import Density
from generation.outcomes.cases import Choice, choose
from generation.outcomes.outcomes import Episodes, Outcomes
from generation.search.space import Space
from recognition.maneuvers.parameters import Parameter

SPACE = Space((Parameter("A", 0.0, 10.0), Parameter("B", 0.0, 10.0)))


class First(Density):
    """Says that what has a large first parameter is likely."""

    def _learn(self, theta: Any, groups: Any) -> None:
        raise NotImplementedError

    def log_density(self, theta: Any) -> Any:
        return theta[:, 0]

    def sample(self, n: int, generator: Any) -> Any:
        raise NotImplementedError


def outcomes(collision: list[bool], risk: list[float], status: str = "completed") -> Outcomes:
    n = len(collision)
    return Outcomes(np.array(collision, bool), np.array(risk, float), np.ones(n), np.ones(n), np.full(n, status), np.full(n, ""))


def careful(theta: Any) -> Outcomes:
    """Collides where B is above 5."""
    return outcomes((theta[:, 1] > 5.0).tolist(), [0.0] * len(theta))


def test_only_critical_episodes_are_cases_the_best_first_the_likelier_first() -> None:
    theta = np.array([[1.0, 1.0], [2.0, 9.0], [9.0, 5.0], [5.0, 5.0]])
    found = outcomes([False, True, True, False], [0.5, 0.9, 1.0, 0.0])
    cases = choose(SPACE, Episodes(theta, found, np.array([0.0, 0.25, 0.25, 0.3])), First(), careful)
    np.testing.assert_array_equal(cases.theta, theta[[2, 1, 0]])
    told = cases.tags()
    assert told["Verdict"] == ["collision", "collision", "violation of RSS distances"]
    assert told["CarefulDriver"] == ["avoids a collision", "collision", "avoids a collision"]
    assert told["LogLikelihood"] == [9.0, 2.0, 1.0]


def test_failed_episodes_are_no_cases() -> None:
    found = outcomes([True, True], [1.0, 1.0], status="error")
    assert len(choose(SPACE, Episodes(np.ones((2, 2)), found, np.ones(2)), First(), careful)) == 0


def test_what_the_careful_driver_avoids_is_unknown_where_its_run_failed() -> None:
    theta = np.array([[3.0, 1.0], [6.0, 9.0], [9.0, 1.0]])
    hit = Episodes(theta, outcomes([True] * 3, [1.0] * 3), np.array([3.0, 2.0, 1.0]))
    judged = careful(theta)
    judged.status[0] = "error"
    cases = choose(SPACE, hit, First(), lambda theta: judged)
    assert cases.avoidable.tolist() == [False, False, True]
    assert cases.tags()["CarefulDriver"] == ["unknown: the run failed", "collision", "avoids a collision"]


@given(st.lists(st.tuples(st.floats(0, 10), st.floats(0, 10), st.floats(-1, 1)), min_size=1, max_size=30), st.integers(1, 9))
def test_cases_are_apart_and_no_more_than_asked_for(rows: list[tuple[float, float, float]], most: int) -> None:
    table = np.array(rows)
    n = len(table)
    episodes = Episodes(table[:, :2], outcomes([True] * n, [0.0] * n), table[:, 2])
    cases = choose(SPACE, episodes, First(), careful, Choice(most, 0.2))
    assert 1 <= len(cases) <= most
    assert (np.diff(cases.rewards) <= 0).all()
    unit = SPACE.unit(cases.theta)
    distance = np.sqrt(np.square(unit[:, None] - unit[None]).mean(axis=2))
    assert (distance[~np.eye(len(cases), dtype=bool)] >= 0.2).all()
