"""CCSF: REINFORCE with an LSTM on criticality, without regard to how plausible
the scenarios are.
"""

from __future__ import annotations

from functools import partial

from generation.search.methods.mcsg import McsgSettings, RealStarts, mcsg, single
from generation.search.problem import History, SearchProblem
from studies.generation.strategies import rewarded

METHODS = {
    "ccsf": {
        "title": "CCSF",
        "meaning": "REINFORCE with an LSTM, on criticality",
        "realistic": False,
    }
}


def ccsf(
    problem: SearchProblem,
    budget: int,
    seed: int,
    settings: McsgSettings = McsgSettings(),  # noqa: B008
) -> History:
    """MCSG's policy and stages, with edits of single parameters, always from real scenarios,
    rewarded for criticality alone."""
    return rewarded(
        partial(mcsg, settings=settings, edits=single, starts=RealStarts),
        problem,
        budget,
        seed,
        weight=0.0,
    )
