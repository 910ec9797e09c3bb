"""CCSF: REINFORCE with an LSTM on criticality, without regard to how plausible the scenarios are."""

from __future__ import annotations

from generation.mcsg.search import Settings
from generation.search.problem import History, Problem
from generation.study.strategies.rewarded import rewarded


def search(problem: Problem, budget: int, seed: int) -> History:
    """MCSG's policy and stages, with edits of single parameters, always from real scenarios, rewarded for criticality alone."""
    return rewarded(problem, budget, seed, Settings(coordinated=False, elite=0.0), weight=0.0)
