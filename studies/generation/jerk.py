"""Effect of a limited jerk: the same draws of recorded braking, played with their jerk and with
discontinuous accelerations."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from generation.search.outcomes import JUDGES
from generation.search.plays import ArrayPlays
from generation.space import SpaceChoice
from generation.space.density.models import JUDGE
from generation.space.density.roles import roles_of
from generation.space.logical.library import SCENARIOS
from generation.space.recorded import of_recordings, of_samples
from generation.space.space import Space
from recognition.labels.maneuvers.parameters import BRAKING, JERK
from runner.judging.settings import RunSettings
from schemas.common.array_types import BoolArray, FloatArray

WITH, WITHOUT = (SCENARIOS / f"{name}_highway.xosc" for name in ("braking_leader", "car_following"))
"""The same manoeuvre, with the parameter and without it"""


@dataclass(frozen=True)
class Compared:
    """Results of draws.

    Attributes:
        jerk: of each (n,), m/s³.
        with_it, without_it: which are failures that are foreseeable and preventable (n,).
    """

    jerk: FloatArray
    with_it: BoolArray
    without_it: BoolArray


def compare(recorded: Path | None, sut: str, draws: int, seed: int) -> Compared:
    """Play draws of what is recorded both ways, in arrays.

    Args:
        recorded: recordings, or a table of their units; None for those of our own. sut: the system
            under test.

    Raises:
        UsageError: no unit's jerk is known.
    """
    space, other = Space.of(WITH, SpaceChoice(free=[_name(WITH)])), Space.of(WITHOUT)
    prior = of_samples(of_recordings(recorded, BRAKING), space).prior(space, JUDGE)
    theta = prior.sample(draws, np.random.default_rng(seed))
    foreseeable = prior.foreseeable(theta)
    shared = theta[:, [space.names.index(name) for name in other.names]]
    failed = [
        foreseeable & _prevented(*each, sut)
        for each in ((WITH, space, theta), (WITHOUT, other, shared))
    ]
    return Compared(theta[:, space.names.index(_name(WITH))], *failed)


def _name(scenario: Path) -> str:
    """The parameter that is the jerk."""
    roles = roles_of(Space.of(scenario).pinned)
    return next(name for name, role in roles.items() if role.role == JERK)


def _prevented(scenario: Path, space: Space, theta: FloatArray, sut: str) -> BoolArray:
    """Mask of points (n,) that are collisions that a judge prevents."""
    plays = ArrayPlays(scenario, space, RunSettings(sut=sut))
    found = plays(theta).collision
    hit = np.flatnonzero(found)
    found[hit] = np.any([~plays(theta[hit], judge).collision for judge in JUDGES], axis=0)
    return found
