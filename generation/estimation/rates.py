"""How often a system fails per hour and per kilometre: P(failure | manoeuvre) times manoeuvres per hour, both uncertain.

Manoeuvres are a Poisson process with the posterior Gamma(count + ½, exposure) of its rate; of these a share Beta(possible + ½,
others + ½) is what the estimate is of; the probability is log-normal, as its interval is. ½ is the prior of H. Jeffreys, 1946.
Pairs of simultaneous manoeuvres are found among those that have parameters; how many more there are follows from the share of
each kind that has some, as if it were independent of the other one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from generation.density.prior import Prior
from generation.density.roles import NUISANCES
from generation.estimation.probability import Probability
from generation.recorded import Recorded
from generation.search.space import Space
from recognition.maneuvers.units import Exposure
from xodr.array_types import FloatArray

_DRAWS = 100_000
"""Draws that intervals are quantiles of"""
_HALF = 0.5
PER_HOUR, PER_DISTANCE = "per hour", "per 1,000 km"
_DISTANCE = 1000.0


class Rate(NamedTuple):
    """A rate with its 95 % interval; its value is 0 where no draw fails, and the interval's upper end a limit."""

    value: float
    interval: tuple[float, float]

    def __str__(self) -> str:
        low, high = self.interval
        return f"{self.value:.2e} [{low:.2e}, {high:.2e}]" if self.value > 0.0 else f"below {high:.1e}"


@dataclass(frozen=True)
class Driving:
    """What recordings say of how often a manoeuvre comes, or a pair of them.

    Attributes:
        exposure: of all recordings.
        kind: of the units, or pairs.
        recordings: how many there are.
        units: how many of the units have parameters. possible: how many of these are within the density's limits.
    """

    exposure: Exposure
    kind: str
    recordings: int
    units: int
    possible: int

    @property
    def count(self) -> int:
        """Manoeuvres of the kind, those without parameters among them."""
        return self.exposure.counts.get(self.kind, 0)

    def rates(self, probability: Probability) -> dict[str, Rate]:
        """Failures per hour of driving and per 1,000 km, by these names."""
        generator = np.random.default_rng(0)
        chances, chance = _chances(probability, generator)
        met = generator.gamma(self.count + _HALF, 1.0, _DRAWS)
        met *= generator.beta(self.possible + _HALF, self.units - self.possible + _HALF, _DRAWS)
        share = self.possible / self.units if self.units else 0.0
        found = {}
        for name, driven in ((PER_HOUR, self.exposure.hours), (PER_DISTANCE, self.exposure.kilometres / _DISTANCE)):
            low, high = np.quantile(chances * met / driven, (0.025, 0.975))
            if not chance:
                low, high = 0.0, np.quantile(chances * met / driven, 0.95)
            found[name] = Rate(chance * share * self.count / driven, (float(low), float(high)))
        return found

    def as_json(self) -> dict[str, Any]:
        """For files."""
        driven = {"hours": self.exposure.hours, "kilometres": self.exposure.kilometres, "recordings": self.recordings}
        return {**driven, "kind": self.kind, "manoeuvres": self.count, "within_limits": self.possible, "of_units": self.units}

    def __str__(self) -> str:
        driven = f"{self.exposure.hours:,.1f} h and {self.exposure.kilometres:,.0f} km of driving in {self.recordings} recordings"
        return f"{self.count} manoeuvres {self.kind} in {driven}"


def driving(recorded: Recorded, space: Space, prior: Prior) -> Driving | str:
    """What recordings say of how often the manoeuvre of a space comes, or why they do not."""
    total = Exposure.total(recorded.exposure.values())
    if not (total.hours and total.kilometres):
        return "nothing is recorded of how many hours and kilometres were driven"
    pairs = recorded.pairs
    if pairs is None and len({role.actor for role in recorded.roles.values()}) > 1:
        return "it combines units of several actors, and nothing is recorded of how often they come together"
    pinned = [name for name, role in recorded.roles.items() if name in space.pinned and role.role not in NUISANCES]
    if pinned:
        return f"{pinned[0]} is pinned, and manoeuvres were counted at all its values"
    units, possible = len(recorded.theta), int(prior.possible(recorded.theta).sum())
    if pairs is not None:
        units = len(pairs.recordings)
        total = replace(total, counts={pairs.kind: round(units / pairs.known)})
    return Driving(total, recorded.kind, len(recorded.exposure), units, possible)


def _chances(probability: Probability, generator: np.random.Generator) -> tuple[FloatArray, float]:
    """Draws of a probability, and its value; where no draw failed, exponential with 95 % below the bound."""
    if probability.value <= 0.0:
        return generator.exponential(-probability.bound / math.log(0.05), _DRAWS), 0.0
    spread = math.sqrt(math.log1p(probability.variation**2))
    return np.minimum(probability.value * np.exp(spread * generator.standard_normal(_DRAWS)), 1.0), probability.value
