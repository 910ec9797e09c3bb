"""MCSG: see `generation.mcsg.search`."""

from __future__ import annotations

from generation.mcsg.settings import McsgSettings
from generation.search.problem import History, Problem

METHOD = {
    "title": "**MCSG**",
    "meaning": "reinforcement learning of edits to real scenarios, coarse to fine",
    "realistic": True,
}


def search(problem: Problem, budget: int, seed: int, settings: McsgSettings = McsgSettings()) -> History:  # noqa: B008 - frozen
    """MCSG as published, with coordinated edits and an elite."""
    from generation.mcsg.search import search as mcsg

    return mcsg(problem, budget, seed, settings)
