"""CCSF: REINFORCE with an LSTM on criticality, without regard to how plausible the scenarios are."""

from __future__ import annotations

from dataclasses import replace

from generation.problem import History, Problem
from generation.search import Settings
from generation.search import search as mcsg


def search(problem: Problem, budget: int, seed: int) -> History:
    """MCSG's policy and stages, with edits of single parameters, always from real scenarios, rewarded for criticality alone."""
    blind = replace(problem, reward=replace(problem.reward, weight=0.0))
    found = mcsg(blind, budget, seed, Settings(coordinated=False, elite=0.0))
    return found._replace(rewards=problem.reward(found.theta, found.outcomes))
