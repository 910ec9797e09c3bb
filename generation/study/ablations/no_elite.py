"""Ablation No-Elite: MCSG whose episodes all start from real scenarios."""

from __future__ import annotations

from generation.mcsg.search import search as mcsg
from generation.search.problem import History, Problem
from generation.study.strategies.real_starts import RealStarts

METHOD = {"title": "No-Elite", "meaning": "MCSG that starts from real scenarios throughout", "realistic": True}


def search(problem: Problem, budget: int, seed: int) -> History:
    """MCSG that carries no scenario on."""
    return mcsg(problem, budget, seed, starts=RealStarts)
