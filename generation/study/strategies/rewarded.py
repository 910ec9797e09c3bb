"""MCSG by another reward than the problem's, for the ablations that differ in nothing else."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from generation.mcsg.search import Settings
from generation.mcsg.search import search as mcsg
from generation.search.problem import History, Problem


def rewarded(problem: Problem, budget: int, seed: int, settings: Settings, **changes: Any) -> History:
    """Search by the problem's reward with some changes; the episodes are told with the problem's own rewards.

    Args:
        settings: of the search.
        changes: fields of `generation.search.reward.Reward`.
    """
    found = mcsg(replace(problem, reward=replace(problem.reward, **changes)), budget, seed, settings)
    return found._replace(rewards=problem.reward(found.theta, found.outcomes))
