"""Probabilities by another library."""

from __future__ import annotations

import importlib.util

import numpy as np
import pytest

from generation.search.outcomes import Outcomes
from generation.space.density.prior import Box, RecordedPrior
from generation.space.density.roles import roles_of
from schemas.common.array_types import FloatArray
from schemas.common.errors import UsageError
from studies.generation import packages
from studies.generation.crosscheck import Level, subset_simulation

FAST = 30.0
"""Speed of the ego, m/s, from which it collides"""


@pytest.fixture(scope="module")
def prior() -> RecordedPrior:
    """Of speeds and gaps of which neither depends on the other."""
    generator, names = np.random.default_rng(0), ("CutIn_Gap_m", "Ego_Speed_mps")
    values = dict(
        zip(names, np.exp(generator.normal((2.5, 3.0), (0.3, 0.15), (600, 2))).T, strict=True)
    )
    box = Box(names, np.array([1.0, 5.0]), np.array([100.0, 60.0]), {})
    return RecordedPrior(
        box,
        values,
        np.array([f"r{number % 5}" for number in range(600)]),
        roles_of(names),
        "gaussian",
    )


def fails_when_fast(theta: FloatArray, sut: str | None = None) -> Outcomes:
    speed = theta[:, 1]
    return Outcomes.of(
        len(theta),
        collision=speed > FAST,
        max_drac=np.minimum(speed, FAST),
        status=["completed"] * len(theta),
    )


def test_normal_points_stand_for_draws_of_the_prior(prior: RecordedPrior) -> None:
    drawn = Level(prior, fails_when_fast).points(
        np.random.default_rng(1).standard_normal((20_000, 3))
    )
    expected = prior.sample(20_000, np.random.default_rng(2))
    assert np.log(drawn).mean(axis=0) == pytest.approx(np.log(expected).mean(axis=0), abs=0.01)
    assert np.cov(np.log(drawn).T) == pytest.approx(np.cov(np.log(expected).T), abs=0.005)


def test_collisions_are_beyond_all_levels(prior: RecordedPrior) -> None:
    level = Level(prior, fails_when_fast)
    normal = np.random.default_rng(1).standard_normal((5000, 3))
    found, collided = level(normal)[:, 0], level.points(normal)[:, 1] > FAST
    assert level.played == 5000
    assert collided.any()
    assert found[collided].max() < found[~collided].min()


@pytest.mark.skipif(
    importlib.util.find_spec("openturns") is None,
    reason="openturns is not installed; no extra brings it",
)
def test_subset_simulation_finds_the_share_of_draws_that_collide(prior: RecordedPrior) -> None:
    truth = (prior.sample(400_000, np.random.default_rng(3))[:, 1] > FAST).mean()
    assert subset_simulation(prior, fails_when_fast, 0).value == pytest.approx(truth, rel=0.5)


def test_without_openturns_it_says_what_to_type(
    prior: RecordedPrior, monkeypatch: pytest.MonkeyPatch
) -> None:
    def absent(name: str) -> None:
        raise ModuleNotFoundError(name=name)

    monkeypatch.setattr(packages, "import_module", absent)
    with pytest.raises(UsageError, match="pip install openturns"):
        subset_simulation(prior, fails_when_fast, 0)
