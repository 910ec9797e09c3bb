"""Ablation No-KDE: MCSG without the realism term."""

from __future__ import annotations

from dataclasses import replace

from generation.problem import History, Problem
from generation.search import search as mcsg


def search(problem: Problem, budget: int, seed: int) -> History:
    """MCSG, rewarded for criticality alone."""
    blind = replace(problem, reward=replace(problem.reward, weight=0.0))
    found = mcsg(blind, budget, seed)
    return found._replace(rewards=problem.reward(found.theta, found.outcomes))
