"""CCSF: REINFORCE with an LSTM on criticality, without regard to how plausible the scenarios are."""

from __future__ import annotations

from functools import partial

from generation.mcsg.edits import single
from generation.mcsg.search import search as mcsg
from generation.mcsg.settings import McsgSettings
from generation.mcsg.starts import RealStarts
from generation.search.problem import History, Problem
from generation.study.strategies.rewarded import rewarded

METHOD = {"title": "CCSF", "meaning": "REINFORCE with an LSTM, on criticality", "realistic": False}


def search(problem: Problem, budget: int, seed: int, settings: McsgSettings = McsgSettings()) -> History:  # noqa: B008 - frozen
    """MCSG's policy and stages, with edits of single parameters, always from real scenarios, rewarded for criticality alone."""
    return rewarded(partial(mcsg, settings=settings, edits=single, starts=RealStarts), problem, budget, seed, weight=0.0)
