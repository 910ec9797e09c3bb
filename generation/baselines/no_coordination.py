"""Ablation No-Coordination: MCSG whose edits change one parameter each."""

from __future__ import annotations

from generation.problem import History, Problem
from generation.search import Settings
from generation.search import search as mcsg


def search(problem: Problem, budget: int, seed: int) -> History:
    """MCSG with edits that no other parameter follows."""
    return mcsg(problem, budget, seed, Settings(coordinated=False))
