"""Settings of the methods for the problem of failures, chosen on development seeds on the twin, with as many trials for each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from generation.search.problem import BATCH
from generation.study.failures.problem import Posed
from generation.study.failures.screened import screened
from generation.study.failures.study import SLOW, with_settings

TRIALS: Mapping[str, Sequence[Mapping[str, Any]]] = {
    "mcsg": (
        {"batch": 250},
        {"batch": 500, "reach": 1.5, "spread": 0.5},
        {"batch": 500, "rate": 3e-2},
        {"batch": 500, "elite": 0.01, "reach": 1.0, "spread": 0.3},
    ),
    "mcsg-published": (
        {"batch": 250},
        {"batch": 500, "reach": 1.5, "spread": 0.5},
        {"batch": 500, "rate": 3e-2},
        {"batch": 500, "reach": 1.0, "spread": 0.3},
    ),
    "ccsf": (
        {"batch": 250},
        {"batch": 500, "reach": 1.5, "spread": 0.5},
        {"batch": 500, "rate": 3e-2},
        {"batch": 500, "reach": 1.0, "spread": 0.3},
    ),
    "cma-es": (
        {"population": 250, "sigma": 0.2},
        {"population": 250, "sigma": 0.05},
        {"population": 100, "sigma": 0.1},
        {"population": 500, "sigma": 0.1},
    ),
    "gacs": (
        {"population": 250, "distance": 20.0},
        {"population": 500, "distance": 20.0},
        {"population": 500, "distance": 5.0},
        {"population": 250, "distance": 5.0},
    ),
    "rlbe": (
        {"batch": 250, "spread": 0.15},
        {"batch": 500, "spread": 0.05},
        {"batch": 500, "rate": 1e-2},
        {"batch": 500, "entropy": 1e-2},
    ),
    "rltester": (
        {"walkers": 250, "step": 0.1},
        {"walkers": 250, "step": 0.03},
        {"walkers": 500, "step": 0.05, "length": 20},
        {"walkers": 500, "step": 0.1, "length": 5},
    ),
    "ibo": (
        {"starts": 20, "batch": 10},
        {"starts": 100, "batch": 10},
        {"starts": 100, "batch": 25},
        {"starts": 20, "batch": 25},
    ),
}
"""Settings to try, by method; what has none is not here. Large batches, as the twin plays them nearly as fast as small ones."""


class Trial(NamedTuple):
    """Settings of a method, and the distinct failures that it found with each seed."""

    settings: Mapping[str, Any]
    found: tuple[int, ...]


def trials(posed: Posed, name: str, proposals: int, seeds: Sequence[int]) -> list[Trial]:
    """All trials of a method, with the extras of `screened`; in the order of `TRIALS`.

    Args:
        posed: the problem, on the twin.
        proposals: of each trial and seed.
    """
    budget, most = max(proposals, BATCH), min(proposals, SLOW.get(name, proposals))
    return [
        Trial(
            settings,
            tuple(len(screened(with_settings(name, settings), most)(posed.problem, budget, seed).theta) for seed in seeds),
        )
        for settings in TRIALS[name]
    ]
