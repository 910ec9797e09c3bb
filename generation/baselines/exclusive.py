"""Ablation: MCSG with the exclusive form of the reward, in which a collision pays the same whatever its R_risk."""

from __future__ import annotations

from dataclasses import replace

from generation.problem import History, Problem
from generation.search import search as mcsg


def search(problem: Problem, budget: int, seed: int) -> History:
    """MCSG by the exclusive reward."""
    found = mcsg(replace(problem, reward=replace(problem.reward, form="exclusive")), budget, seed)
    return found._replace(rewards=problem.reward(found.theta, found.outcomes))
