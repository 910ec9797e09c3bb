"""Ablation No-Coordination: MCSG whose edits change one parameter each."""

from __future__ import annotations

from generation.mcsg.edits import single
from generation.mcsg.search import search as mcsg
from generation.search.problem import History, Problem

METHOD = {"title": "No-Coordination", "meaning": "MCSG with edits of single parameters", "realistic": True}


def search(problem: Problem, budget: int, seed: int) -> History:
    """MCSG with edits that no other parameter follows."""
    return mcsg(problem, budget, seed, edits=single)
