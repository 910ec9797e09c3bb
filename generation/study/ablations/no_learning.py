"""Ablation No-Learning: MCSG whose policy stays untrained, so that only the elite and the shrinking ranges guide it."""

from __future__ import annotations

from generation.mcsg.search import search as mcsg
from generation.mcsg.settings import McsgSettings
from generation.search.problem import History, Problem

METHOD = {"title": "No-Learning", "meaning": "MCSG with an untrained policy", "realistic": True}


def search(problem: Problem, budget: int, seed: int) -> History:
    """MCSG with a learning rate of 0."""
    return mcsg(problem, budget, seed, McsgSettings(rate=0.0))
