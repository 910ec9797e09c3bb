"""Which episodes become edge cases."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from generation.search.outcomes import (
    FULL_BRAKING,
    JUDGES,
    NEVER_BRAKED,
    REFERENCES,
    Cases,
    Episodes,
    Outcomes,
    choose,
    judges_of,
    matrix,
    remembering,
    survivors,
)
from generation.search.settings import Choice
from generation.space.space import Space
from recognition.labels.maneuvers.parameters import Parameter
from schemas.common.array_types import FloatArray
from schemas.common.errors import UsageError

SPACE = Space(
    (
        Parameter("Other_A", 0.0, 10.0),
        Parameter("Other_B", 0.0, 10.0),
        Parameter("Other_StartTime_s", 0.0, 10.0),
    )
)


def outcomes(collision: list[bool], status: str = "completed", risk: float = 0.0) -> Outcomes:
    n = len(collision)
    return Outcomes.of(
        n, collision=collision, r_risk=[risk] * n, risk=[risk] * n, status=[status] * n
    )


def judged(theta: FloatArray) -> Any:
    """Says that what has a large A is likely, and that none below 1 is foreseeable."""
    return theta[:, 0], theta[:, 0] >= 1.0


def drivers(theta: FloatArray, sut: str) -> Outcomes:
    """`r157-cc` collides where B is above 5, `fsm` above 8, all others everywhere."""
    limits = {"r157-cc": 5.0, "fsm": 8.0}
    return outcomes((theta[:, 1] > limits.get(sut, -1.0)).tolist())


def chosen(rows: list[list[float]], found: Outcomes, choice: Choice = Choice()) -> Cases:  # noqa: B008 - frozen
    theta = np.array(rows)
    return choose(SPACE, Episodes(theta, found, np.zeros(len(theta))), judged, drivers, choice)


def test_cases_are_foreseeable_and_preventable_failures_the_likelier_first() -> None:
    rows = [[3.0, 1.0, 0.0], [9.0, 7.0, 0.0], [6.0, 9.0, 0.0], [0.5, 1.0, 0.0], [8.0, 2.0, 0.0]]
    cases = chosen(rows, outcomes([True, True, True, True, False]))
    np.testing.assert_array_equal(
        cases.theta, np.array(rows)[[1, 0]]
    )  # the third is not preventable, the fourth not foreseeable
    tags = cases.tags()
    assert tags["CarefulDriver"] == ["collision", "avoids a collision"]
    assert tags["SurvivedBy"] == ["fsm", "r157-cc, fsm"]
    assert set(cases.drivers) == set(REFERENCES)
    assert cases.prevented_by() == {"both": 1, "fsm only": 1}
    assert chosen(rows, outcomes([False] * 5)).prevented_by() == {}


def test_the_judges_that_are_asked_for_decide() -> None:
    theta = np.array([[3.0, 1.0, 0.0], [9.0, 7.0, 0.0], [6.0, 9.0, 0.0]])
    every = Episodes(theta, outcomes([True] * 3), np.zeros(3))
    strict = choose(SPACE, every, judged, drivers, judges=judges_of(["r157-cc"]))
    assert strict.theta.tolist() == theta[:1].tolist()
    assert strict.prevented_by() == {"r157-cc": 1} and strict.take(np.array([0])).judges == (
        "r157-cc",
    )
    assert set(strict.drivers) == set(REFERENCES), "all reference drivers are shown in any case"
    none = choose(SPACE, every, judged, drivers, judges=judges_of(["aeb"]))
    assert len(none) == 0
    three = choose(SPACE, every, judged, drivers, judges=judges_of(["fsm", "r157-cc", "aeb"]))
    assert three.prevented_by() == {"fsm only": 1, "fsm and r157-cc only": 1}
    assert judges_of([], ["r157"]) == ("r157-cc", "r157-reg")
    assert judges_of(["fsm"], ["r157"]) == ("fsm",)
    assert judges_of([]) == JUDGES and judges_of(["fsm", "fsm"]) == ("fsm",)
    with pytest.raises(UsageError, match="--judge 'fms': did you mean 'fsm'"):
        judges_of(["fms"])


def test_violations_of_distances_are_cases_on_request_only() -> None:
    rows, found = [[3.0, 1.0, 0.0], [9.0, 9.0, 0.0]], outcomes([True, False], risk=0.5)
    assert chosen(rows, found).tags()["Verdict"] == ["collision"]
    assert chosen(rows, found, Choice(violations=True)).tags()["Verdict"] == [
        "collision",
        "violation of RSS distances",
    ]


def test_cases_that_differ_in_nothing_but_the_scene_are_one() -> None:
    assert len(chosen([[3.0, 1.0, 0.0], [3.0, 1.0, 10.0]], outcomes([True, True]))) == 1


def test_a_case_that_is_not_preventable_hides_no_neighbour() -> None:
    cases = chosen([[9.0, 8.05, 0.0], [8.9, 7.95, 0.0]], outcomes([True, True]))
    np.testing.assert_array_equal(cases.theta, [[8.9, 7.95, 0.0]])


def test_failed_episodes_are_no_cases_and_failed_judges_prevent_nothing() -> None:
    assert len(chosen([[9.0, 1.0, 0.0]] * 2, outcomes([True, True], status="error"))) == 0
    theta = np.array([[9.0, 1.0, 0.0]])
    assert not survivors(theta, lambda rows, sut: outcomes([False], status="error")).any()


def test_the_second_judge_is_asked_only_where_the_first_one_fails() -> None:
    asked: list[tuple[str, int]] = []

    def asking(theta: FloatArray, sut: str) -> Outcomes:
        asked.append((sut, len(theta)))
        return drivers(theta, sut)

    theta = np.array([[9.0, 1.0, 0.0], [9.0, 7.0, 0.0], [9.0, 9.0, 0.0]])
    assert survivors(theta, asking).tolist() == [True, True, False]
    assert asked == [(JUDGES[0], 3), (JUDGES[1], 2)]


def test_plays_that_agrees_on_the_judges_plays_the_other_drivers() -> None:
    ran: list[str] = []

    def running(theta: FloatArray, sut: str) -> Outcomes:
        ran.append(sut)
        return drivers(theta, sut)

    theta = np.tile([[9.0, 1.0, 0.0], [9.0, 7.0, 0.0]], (15, 1))
    found = matrix(theta, running, drivers)
    assert (ran, found.agreed) == (list(JUDGES), 60)
    few = matrix(theta[:2], running, drivers)
    assert few.agreed == 0 and "aeb" in ran, "a few runs take less time than a play"
    assert {name: each.collision.tolist() for name, each in found.drivers.items()} == {
        name: each.collision.tolist() for name, each in matrix(theta, drivers).drivers.items()
    }


def test_plays_that_differs_on_a_judge_plays_nobody() -> None:
    ran: list[str] = []

    def running(theta: FloatArray, sut: str) -> Outcomes:
        ran.append(sut)
        return drivers(theta, sut)

    found = matrix(
        np.tile([[9.0, 7.0, 0.0]], (30, 1)),
        running,
        lambda theta, sut: outcomes([sut != "r157-cc"] * len(theta)),
    )
    assert (sorted(ran), found.agreed) == (sorted([*REFERENCES.values(), "none"]), 0)


def test_full_braking_that_never_begins_is_no_bound() -> None:
    def driving(theta: FloatArray, sut: str) -> Outcomes:
        impact = (
            np.where(theta[:, 0] < 5.0, 10.0, 4.0)
            if sut == FULL_BRAKING
            else np.full(len(theta), 10.0)
        )
        return Outcomes.of(len(theta), collision=[True] * len(theta), impact_speed=impact)

    found = matrix(np.array([[1.0, 0.0, 0.0], [9.0, 0.0, 0.0]]), driving).drivers
    assert found["full braking"].executed.tolist() == [False, True]
    assert found["full braking"].error.tolist() == [NEVER_BRAKED, ""]
    assert found["full braking"].collision.tolist() == [False, True]
    assert found["aeb"].executed.all()


def test_no_case_is_run_twice_with_the_same_driver() -> None:
    asked: list[int] = []

    def running(theta: FloatArray, sut: str) -> Outcomes:
        asked.append(len(theta))
        return drivers(theta, sut)

    driving, theta = (
        remembering(running),
        np.array([[9.0, 1.0, 0.0], [9.0, 7.0, 0.0], [9.0, 1.0, 0.0]]),
    )
    assert driving(theta[:1], "fsm").collision.tolist() == [False]
    assert driving(theta, "r157-cc").collision.tolist() == [False, True, False]
    assert driving(theta, "fsm").collision.tolist() == [False, False, False]
    assert asked == [1, 2, 1]


@given(
    st.lists(st.tuples(st.floats(1, 10), st.floats(0, 8)), min_size=1, max_size=30),
    st.integers(1, 9),
)
def test_cases_are_apart_and_no_more_than_asked_for(
    rows: list[tuple[float, float]], most: int
) -> None:
    cases = chosen([[*row, 0.0] for row in rows], outcomes([True] * len(rows)), Choice(most, 0.2))
    assert 1 <= len(cases) <= most
    assert (np.diff(cases.log_likelihood) <= 0).all()
    unit = SPACE.unit(cases.theta)[:, :2]
    distance = np.sqrt(np.square(unit[:, None] - unit[None]).mean(axis=2))
    assert (distance[~np.eye(len(cases), dtype=bool)] >= 0.2).all()
