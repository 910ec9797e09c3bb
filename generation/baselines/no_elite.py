"""Ablation No-Elite: MCSG whose episodes all start from real scenarios."""

from __future__ import annotations

from generation.problem import History, Problem
from generation.search import Settings
from generation.search import search as mcsg


def search(problem: Problem, budget: int, seed: int) -> History:
    """MCSG that carries no scenario on."""
    return mcsg(problem, budget, seed, Settings(elite=0.0))
