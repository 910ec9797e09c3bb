"""Ablation No-Elite: MCSG whose episodes all start from real scenarios."""

from __future__ import annotations

from generation.mcsg.search import search as mcsg
from generation.mcsg.starts import RealStarts
from generation.search.problem import History, Problem

METHOD = {"title": "No-Elite", "meaning": "MCSG that starts from real scenarios throughout", "realistic": True}


def search(problem: Problem, budget: int, seed: int) -> History:
    """MCSG that carries no scenario on."""
    return mcsg(problem, budget, seed, starts=RealStarts)
