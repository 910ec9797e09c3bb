"""Searches by another reward than the problem's, for methods that differ in nothing else."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from generation.search.problem import History, Problem, Search


def rewarded(search: Search, problem: Problem, budget: int, seed: int, **changes: Any) -> History:
    """Search by the problem's reward with some changes; the history has the problem's own rewards.

    Args:
        search: the method.
        problem, budget, seed: what it is given.
        changes: fields of `generation.search.reward.Reward`.
    """
    found = search(replace(problem, reward=replace(problem.reward, **changes)), budget, seed)
    return found._replace(rewards=problem.reward(found.theta, found.outcomes))
