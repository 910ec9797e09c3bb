"""Ablation: MCSG with the exclusive form of the reward, in which a collision pays the same whatever its R_risk."""

from __future__ import annotations

from generation.baselines.otherwise import rewarded
from generation.problem import History, Problem
from generation.search import Settings


def search(problem: Problem, budget: int, seed: int) -> History:
    """MCSG by the exclusive reward."""
    return rewarded(problem, budget, seed, Settings(), form="exclusive")
