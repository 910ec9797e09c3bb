"""Ablation: MCSG with the exclusive form of the reward, in which a collision pays the same whatever its R_risk."""

from __future__ import annotations

from generation.mcsg.search import Settings
from generation.search.problem import History, Problem
from generation.study.strategies.rewarded import rewarded


def search(problem: Problem, budget: int, seed: int) -> History:
    """MCSG by the exclusive reward."""
    return rewarded(problem, budget, seed, Settings(), form="exclusive")
