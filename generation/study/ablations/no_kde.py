"""Ablation No-KDE: MCSG without the realism term."""

from __future__ import annotations

from generation.mcsg.search import search as mcsg
from generation.search.problem import History, Problem
from generation.study.strategies.rewarded import rewarded

METHOD = {"title": "No-KDE", "meaning": "MCSG without the realism term", "realistic": False}


def search(problem: Problem, budget: int, seed: int) -> History:
    """MCSG, rewarded for criticality alone."""
    return rewarded(mcsg, problem, budget, seed, weight=0.0)
