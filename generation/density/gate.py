"""The gate that a density has to pass before it may judge what is foreseeable: simulated, traffic must fail as rarely as it did.

Recordings replayed with their own values say how often the scenario and the system under test collide in traffic as it was. None
of the recorded vehicles collided. A density whose draws collide far more often draws something else than traffic.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from generation.density.prior import Prior
from generation.outcomes.outcomes import Outcomes
from xodr.array_types import FloatArray

CONFIDENCE = 0.95
UNFAITHFUL = 0.01
"""Share of colliding replays that is certainly exceeded where a scenario does not replay what was recorded."""


class Share(NamedTuple):
    """How many of some runs collided."""

    collisions: int
    runs: int

    @classmethod
    def of(cls, outcomes: Outcomes) -> Share:
        """Of those that took place."""
        return cls(int(outcomes.collision.sum()), int(outcomes.executed.sum()))

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % interval of the probability, exact: C. Clopper, E. Pearson, Biometrika 26, 1934."""
        from scipy.stats import binomtest

        if not self.runs:
            return 0.0, 1.0
        found = binomtest(self.collisions, self.runs).proportion_ci(CONFIDENCE, "exact")
        return float(found.low), float(found.high)

    def __str__(self) -> str:
        low, high = self.interval
        return f"{self.collisions} of {self.runs} ({low:.2%} to {high:.2%})"


class Gate(NamedTuple):
    """What a density was measured by.

    Attributes:
        replayed: recorded units with their own values; None where nothing is recorded.
        drawn: draws of the density.
    """

    replayed: Share | None
    drawn: Share

    @property
    def refusal(self) -> str | None:
        """Why the density is no judge of what is foreseeable; None where it is one, or where there is nothing to hold it to."""
        if self.replayed is None:
            return None
        low, high = self.replayed.interval
        if low > UNFAITHFUL:
            return f"{self.replayed} replays of recordings collide, where none of the recordings did"
        if self.drawn.interval[0] > high:
            return f"{self.drawn} of its draws collide, far more often than {self.replayed} replays of recordings"
        return None

    def __str__(self) -> str:
        if self.replayed is None:
            return f"collisions in {self.drawn} draws of the density; nothing is recorded that could be replayed"
        return f"collisions in {self.replayed} replays of recordings, in {self.drawn} draws of the density"


Run = Callable[[FloatArray], Outcomes]


def measured(prior: Prior, run: Run, replays: FloatArray | None, replay: Run, most: int, seed: int = 0) -> Gate:
    """Measure a density.

    Args:
        prior: of a space. run: runs rows of the space.
        replays: recorded rows (m, k) with their own values, of what is pinned in the space too; None without recordings.
        replay: runs these.
        most: runs of each kind.
        seed: of draws, and of the choice among recorded rows.
    """
    generator = np.random.default_rng(seed)
    replayed = None
    if replays is not None:
        replayed = Share.of(replay(replays[generator.permutation(len(replays))[:most]]))
    return Gate(replayed, Share.of(run(prior.sample(most, generator))))
