"""Ablation No-Elite: MCSG whose episodes all start from real scenarios."""

from __future__ import annotations

from generation.mcsg.search import Settings
from generation.mcsg.search import search as mcsg
from generation.search.problem import History, Problem


def search(problem: Problem, budget: int, seed: int) -> History:
    """MCSG that carries no scenario on."""
    return mcsg(problem, budget, seed, Settings(elite=0.0))
