"""Comfort of scripted motion: greatest acceleration and jerk of actors in runs of draws."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

import runner
from generation.space.density.models import JUDGE
from generation.space.density.roles import roles_of
from generation.space.recorded import kind_of, of_recordings, of_samples
from generation.space.space import Space
from schemas.common.array_types import FloatArray


class Comfort(NamedTuple):
    """Motion of an actor in runs (n,).

    Attributes:
        acceleration: greatest, m/s².
        jerk: greatest difference of accelerations of two steps by the timestep, m/s³.
    """

    acceleration: FloatArray
    jerk: FloatArray


def measure(
    scenario: Path, recorded: Path | None, draws: int, seed: int, timestep: float
) -> Comfort:
    """Play draws of what is recorded kinematically, without a system under test.

    Args:
        scenario: of one manoeuvre.
        recorded: recordings, or a table of their units; None for those of our own.

    Raises:
        UsageError: no kind of recorded units has the scenario's name.
    """
    space = Space.of(scenario)
    actor = next(iter(roles_of(space.names).values())).actor
    prior = of_samples(of_recordings(recorded, kind_of(scenario)), space).prior(space, JUDGE)
    found = [
        _greatest(scenario, space, theta, actor, timestep)
        for theta in prior.sample(draws, np.random.default_rng(seed))
    ]
    return Comfort(*np.array(found).T)


def _greatest(
    scenario: Path, space: Space, theta: FloatArray, actor: str, timestep: float
) -> tuple[float, float]:
    """Greatest acceleration and jerk of the actor in a run."""
    result = runner.run(
        scenario,
        parameters=space.values(theta),
        sut=None,
        world="kinematic",
        timestep=timestep,
    )
    speed = result.recording.tracks[actor].columns["speed"]
    acceleration = np.diff(speed) / timestep
    jerk = np.diff(acceleration) / timestep
    return float(np.abs(acceleration).max(initial=0.0)), float(np.abs(jerk).max(initial=0.0))
