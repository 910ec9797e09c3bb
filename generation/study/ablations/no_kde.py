"""Ablation No-KDE: MCSG without the realism term."""

from __future__ import annotations

from generation.mcsg.search import Settings
from generation.search.problem import History, Problem
from generation.study.strategies.rewarded import rewarded


def search(problem: Problem, budget: int, seed: int) -> History:
    """MCSG, rewarded for criticality alone."""
    return rewarded(problem, budget, seed, Settings(), weight=0.0)
