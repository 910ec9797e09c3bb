"""Ablation No-KDE: MCSG without the realism term."""

from __future__ import annotations

from generation.baselines.otherwise import rewarded
from generation.problem import History, Problem
from generation.search import Settings


def search(problem: Problem, budget: int, seed: int) -> History:
    """MCSG, rewarded for criticality alone."""
    return rewarded(problem, budget, seed, Settings(), weight=0.0)
