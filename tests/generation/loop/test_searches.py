"""Failures of one search, and what they are worth to the next."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from generation.loop.searches import Failures, failures
from generation.search.methods.mcsg import mcsg
from generation.search.problem import SearchProblem
from generation.search.settings import Choice
from generation.space.space import diverse

ALIKE = Choice().apart


def second(problem: SearchProblem, first: Failures, fed: bool, seed: int) -> Failures:
    again = mcsg(replace(problem, found=first.theta) if fed else problem, 150, seed)
    return failures(problem.space, again, first.theta)


def test_failures_are_critical_and_unlike_each_other(problem: SearchProblem) -> None:
    found = failures(problem.space, mcsg(problem, 500, 0))
    assert len(found.theta) >= found.collisions == found.new > 0
    unit = problem.space.unit(found.theta)
    assert len(diverse(unit, ALIKE)) == len(unit)


def test_what_was_known_before_is_not_new(problem: SearchProblem) -> None:
    episodes = mcsg(problem, 500, 0)
    found = failures(problem.space, episodes)
    assert found.collisions > 0
    assert failures(problem.space, episodes, found.theta).new == 0


def test_a_round_that_starts_from_failures_finds_more_new_ones_than_one_that_does_not(
    problem: SearchProblem,
) -> None:
    first = failures(problem.space, mcsg(problem, 150, 0))
    fed, alone = (
        np.mean([second(problem, first, fed, seed).new for seed in (1, 2, 3)])
        for fed in (True, False)
    )
    assert fed > alone


def test_episodes_start_from_what_was_found(problem: SearchProblem) -> None:
    assert problem.starts is problem.real
    found = np.array(problem.real[:3])
    assert replace(problem, found=found).starts is found


@pytest.mark.parametrize("fed", [True, False])
def test_a_search_from_failures_is_the_same_each_time(problem: SearchProblem, fed: bool) -> None:
    given = replace(problem, found=problem.real[:20]) if fed else problem
    np.testing.assert_array_equal(mcsg(given, 60, 4).theta, mcsg(given, 60, 4).theta)
