"""MCSG in the form of its publication: one policy, from real scenarios, one parameter at a time, by risk and realism."""

from __future__ import annotations

from generation.mcsg.settings import McsgSettings
from generation.search.problem import History, Problem

METHOD = {
    "title": "MCSG as published",
    "meaning": "reinforcement learning of edits as published: no elite, no coordinated edits",
    "realistic": True,
}


def search(problem: Problem, budget: int, seed: int, settings: McsgSettings = McsgSettings()) -> History:  # noqa: B008 - frozen
    """MCSG without an elite and with edits of single parameters."""
    from generation.mcsg.edits import single
    from generation.mcsg.search import search as mcsg
    from generation.mcsg.starts import RealStarts

    return mcsg(problem, budget, seed, settings, edits=single, starts=RealStarts)
