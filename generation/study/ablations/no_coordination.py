"""Ablation No-Coordination: MCSG whose edits change one parameter each."""

from __future__ import annotations

from generation.mcsg.search import Settings
from generation.mcsg.search import search as mcsg
from generation.search.problem import History, Problem


def search(problem: Problem, budget: int, seed: int) -> History:
    """MCSG with edits that no other parameter follows."""
    return mcsg(problem, budget, seed, Settings(coordinated=False))
