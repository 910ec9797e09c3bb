"""Ablation: MCSG with the exclusive form of the reward, in which a collision pays the same whatever its R_risk."""

from __future__ import annotations

import numpy as np

from generation.mcsg.search import search as mcsg
from generation.outcomes.outcomes import Outcomes
from generation.search.problem import History, Problem
from generation.search.reward import COLLISION, RISK, SAFE
from generation.study.strategies.rewarded import rewarded
from xodr.array_types import FloatArray

METHOD = {"title": "exclusive reward", "meaning": "MCSG where a collision pays the same whatever R_risk", "realistic": True}


def search(problem: Problem, budget: int, seed: int) -> History:
    """MCSG by the exclusive reward."""
    return rewarded(mcsg, problem, budget, seed, criticality=exclusive)


def exclusive(outcomes: Outcomes) -> FloatArray:
    """0.25 with a collision, otherwise −0.1 + 0.2·R_risk: (n,)."""
    return np.where(outcomes.collision, COLLISION, SAFE + RISK * outcomes.r_risk)
