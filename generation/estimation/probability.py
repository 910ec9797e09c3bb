"""Probabilities of failure from weighted draws with control variates, and rates per hour and per
kilometre."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy.special import gammaincinv

from generation.space.density.prior import Prior
from generation.space.density.roles import NUISANCES
from generation.space.recorded import Recorded
from generation.space.space import Space
from recognition.labels.maneuvers.units import Exposure
from schemas.common.array_types import BoolArray, FloatArray
from schemas.common.terminal.text import many

LEAST_EFFECTIVE = 50.0
"""Effective number of failures below which an interval is not to be trusted"""
_TAIL = 0.025
"""Share outside of an interval of 95 % on each side"""
_NORMAL = 1.959964
"""Quantile of the normal distribution that leaves 2.5 % above"""
_MOST_SPREAD = 700.0
"""Logarithm from which on an interval is all from 0 to 1; e to it is still a double"""


class Probability(NamedTuple):
    """A probability with its uncertainty.

    Attributes:
        value: estimate. deviation: its standard deviation.
        effective: effective number of failures among the draws, (Σw)²/Σw² of their weights w (L.
            Kish, 1965).
        bound: upper limit where no draw fails.
        density: standard deviation of the logarithm that refitted densities of resampled recordings
            add; 0 where there are none.
        counted_alone: interval by the failing draws of a part alone, where they are few; None where
            they are not.
    """

    value: float
    deviation: float
    effective: float
    bound: float
    density: float = 0.0
    counted_alone: tuple[float, float] | None = None

    @property
    def spread(self) -> float:
        """Standard deviation of the logarithm, by sampling and by the density; infinite where no
        draw fails."""
        return math.hypot(math.sqrt(math.log1p(self.variation**2)), self.density)

    @property
    def variation(self) -> float:
        """Coefficient of variation; infinite where no draw fails."""
        return self.deviation / self.value if self.value > 0.0 else math.inf

    @property
    def interval(self) -> tuple[float, float]:
        """Interval of 95 %, by sampling and density, symmetrical in the logarithm: weighted sums of
        positive values are skewed."""
        if self.value <= 0.0:
            # Plays may take away as much as fails in runs: these then bound it, not their absence.
            alone = 0.0 if self.counted_alone is None else self.counted_alone[1]
            return 0.0, min(max(self.bound, alone), 1.0)
        away = _NORMAL * self.spread
        factor = math.exp(away) if away < _MOST_SPREAD else math.inf
        low, high = self.value / factor, self.value * factor
        if self.counted_alone is not None:
            # Plays may be wrong in this part, and few draws of it are run: both have to be inside.
            least, most = self.counted_alone
            low, high = min(low, least), max(high, most)
        return low, min(high, 1.0)

    @property
    def stable(self) -> bool:
        """Whether there are enough failures for the interval to be trusted."""
        return self.effective >= LEAST_EFFECTIVE

    def as_json(self) -> dict[str, Any]:
        """Return it as a JSON object, for files; the interval is of 95 %."""
        return {
            "value": self.value,
            "interval": self.interval,
            "effective_failures": self.effective,
            "stable": self.stable,
        }

    def within(self, other: Probability) -> Probability:
        """Return the estimate within that of an event that this one implies, whose upper limit
        holds for it too where it is to be trusted."""
        return self._replace(bound=min(self.bound, other.interval[1])) if other.stable else self

    @property
    def unseen(self) -> str:
        """Remark in parentheses where no draw fails; empty where one does."""
        return "" if self.effective > 0.0 else " (no draw fails)"

    @property
    def counted(self) -> str:
        """The effective number of failures, for people."""
        return many(round(self.effective), "effective failure")

    def __str__(self) -> str:
        low, high = self.interval
        if self.value <= 0.0:
            return f"below {high:.1e}{self.unseen}"
        shown = f"{self.value:.1e} [{low:.1e}, {high:.1e}]"
        return shown if self.stable else f"{shown}, unstable: {self.counted}"


class ControlVariate(NamedTuple):
    """The same event in cheap plays.

    Attributes:
        same: whether it happens there at the draws (n,).
        failing: whether it happens there at many more draws (m,) of the proposal. weights: theirs
            (m,).
    """

    same: BoolArray
    failing: BoolArray
    weights: FloatArray


def probability(
    failing: BoolArray, weights: FloatArray, greatest: float, control: ControlVariate | None = None
) -> Probability:
    """Probability of an event, by importance sampling with plays as control variate.

    P = mean(w·f) − β (mean(w·g) − G), f the event, g that in plays, G its mean over many draws,
    β the regression of the first on the second: only what plays get wrong is left to chance. A.
    B. Owen, Monte Carlo theory, methods and examples, 2013, §8.9 and §9.

    Args:
        failing: whether it happens at draws (n,) of the proposal. weights: p/q of these (n,).
        greatest: weight that none exceeds.
        control: in plays; None where there is none.
    """
    terms = weights * failing
    n = len(terms)
    if not n:
        return Probability(0.0, 0.0, 0.0, 1.0)
    value, residual, extra = float(terms.mean()), terms - terms.mean(), 0.0
    if control is not None:
        same, many = weights * control.same, control.weights * control.failing
        spread = same - same.mean()
        square = float(spread @ spread)
        # Without variance in plays there is nothing to regress on; β = 0 is the estimate without
        # plays.
        slope = float(residual @ spread) / square if square > 0.0 else 0.0
        value -= slope * float(same.mean() - many.mean())
        residual = residual - slope * spread
        # G is a mean of draws itself: its error is added, or intervals were too short for few
        # plays.
        extra = slope**2 * float(many.var(ddof=1)) / len(many)
    # A single draw has no spread to measure: its interval is all from 0 to 1.
    deviation = math.sqrt(float(residual @ residual) / (n - 1) / n + extra) if n > 1 else math.inf
    squares = float(terms @ terms)
    effective = float(terms.sum()) ** 2 / squares if squares > 0.0 else 0.0
    return Probability(max(value, 0.0), deviation, effective, _rare(n, greatest))


class FailingDraws(NamedTuple):
    """Failing draws of an estimate, whose parts have probabilities of the same estimate.

    Parts that exclude each other and together are all failures have probabilities that add up to
    that of a failure: each part has the weights, and the slope of the control variate, of all.

    Attributes:
        theta: draws (k, d) that fail. weights: theirs (k,).
        draws: how many were made, those that pass included.
        greatest: weight that none exceeds.
        ratios: logarithms (j, k) of p'/p by densities of resampled recordings; (0, k) for none.
        control: draws (m, d) that fail in plays, of the same draws and of many more, with their
            weights; None without plays.
    """

    theta: FloatArray
    weights: FloatArray
    draws: int
    greatest: float
    ratios: FloatArray
    control: tuple[WeightedRows, WeightedRows] | None = None

    def part(self, inside: Callable[[FloatArray], BoolArray]) -> Probability:
        """Probability of the failures at which `inside` holds, of rows (n, d): (n,)."""
        within = inside(self.theta)
        own = np.where(within, self.weights, 0.0)
        value, square = float(own.sum()) / self.draws, float(own @ own)
        # Draws that pass are zeros, which are not kept: their number suffices for the moments.
        variance = max(square / self.draws - value**2, 0.0) / max(self.draws - 1, 1)
        if self.control is not None:
            same, many = (
                WeightedRows(
                    rows.theta, np.where(inside(rows.theta), rows.weights, 0.0), rows.draws
                )
                for rows in self.control
            )
            slope, less = self._slope, same.mean - many.mean
            value -= slope * less
            variance = self._residual(within, slope, same) + slope**2 * many.variance
        effective = float(own.sum()) ** 2 / square if square > 0.0 else 0.0
        spread = density_spread(self.ratios[:, within], own[within])
        bound = _rare(self.draws, self.greatest)
        alone = None
        if self.control is not None and effective < LEAST_EFFECTIVE:
            # Plays may be wrong in a small part; then its few runs bound it beside them.
            alone = self._counted_alone(own if square > 0.0 else many.weights, effective)
        return Probability(max(value, 0.0), math.sqrt(variance), effective, bound, spread, alone)

    def _counted_alone(self, weights: FloatArray, effective: float) -> tuple[float, float]:
        """Interval of 95 % of a part by its failing draws, without plays.

        Exact for a Poisson number of draws of one weight; of several, that of their effective
        number. M. Fay, E. Feuer, Confidence intervals for directly standardized rates, Statistics
        in Medicine 16, 1997.

        Args:
            weights: of the part's failing draws, or of those in plays where none is run.
        """
        total = float(weights.sum())
        weight = float(weights @ weights) / total / self.draws if total > 0.0 else 0.0
        low = gammaincinv(effective, _TAIL) if effective > 0.0 else 0.0
        return float(low) * weight, float(gammaincinv(effective + 1.0, 1.0 - _TAIL)) * weight

    @property
    def _slope(self) -> float:
        """Regression of all failures on those in plays (see `probability`)."""
        assert self.control is not None
        same = self.control[0]
        both = _dot(self.theta, self.weights, same.theta, same.weights)
        spread = float(same.weights @ same.weights) - same.draws * same.mean**2
        mean = float(self.weights.sum()) / self.draws
        return (both - self.draws * mean * same.mean) / spread if spread > 0.0 else 0.0

    def _residual(self, within: BoolArray, slope: float, same: WeightedRows) -> float:
        """Variance of the mean of w·f − β·w·g over the draws."""
        own = np.where(within, self.weights, 0.0)
        both = _dot(self.theta, own, same.theta, same.weights)
        square = (
            float(own @ own) - 2.0 * slope * both + slope**2 * float(same.weights @ same.weights)
        )
        mean = float(own.sum()) / self.draws - slope * same.mean
        return max(square / self.draws - mean**2, 0.0) / max(self.draws - 1, 1)


class WeightedRows(NamedTuple):
    """Rows (m, d) of a number of draws at which something happens, with the
    weights (m,) of these.
    """

    theta: FloatArray
    weights: FloatArray
    draws: int

    @property
    def mean(self) -> float:
        """Mean of the weights over all draws."""
        return float(self.weights.sum()) / self.draws

    @property
    def variance(self) -> float:
        """Variance of `mean`."""
        square = float(self.weights @ self.weights) / self.draws
        return max(square - self.mean**2, 0.0) / max(self.draws - 1, 1)


def _dot(one: FloatArray, first: FloatArray, other: FloatArray, second: FloatArray) -> float:
    """Sum over rows that both have of the product of their weights."""
    # By their bytes: both tables are rows of the same draws, so equal ones are equal to the bit.
    of = dict(
        zip((row.tobytes() for row in np.ascontiguousarray(one)), first.tolist(), strict=True)
    )
    rows = (row.tobytes() for row in np.ascontiguousarray(other))
    return sum(of.get(row, 0.0) * weight for row, weight in zip(rows, second.tolist(), strict=True))


def density_spread(ratios: FloatArray, weights: FloatArray) -> float:
    """Standard deviation of the logarithm of Σ w p'/p over densities p', given log p'/p (k, n) and
    weights w (n,)."""
    if not ratios.size:
        return 0.0
    # The logarithm of the sum, not the mean of logarithms: a density moves the estimate as a whole.
    sums = np.exp(np.minimum(ratios, _GREATEST)) @ weights
    # A density without the one recording near all failures may give them no probability at all.
    return float(np.log(np.maximum(sums, np.finfo(float).tiny)).std(ddof=1))


_GREATEST = 5.0
"""Greatest logarithm of a ratio of densities: far out in its tails a density of few recordings
knows little"""


def _rare(n: int, greatest: float) -> float:
    """Upper 95 % limit of a probability after n draws without an event: the rule of three, exactly,
    of as much as no weight exceeds."""
    # Few draws of great weights exclude nothing: the product alone would be above 1.
    return min(float(-np.expm1(math.log(0.05) / n)) * greatest, 1.0)


_DRAWS = 100_000
"""Draws that intervals are quantiles of"""
_HALF = 0.5
_RESAMPLED = 10
"""Fewest recordings that are resampled"""
PER_HOUR, PER_DISTANCE = "per hour", "per 1,000 km"
_DISTANCE = 1000.0


class Rate(NamedTuple):
    """A rate with its 95 % interval; its value is 0 where no draw fails, and the interval's upper
    end a limit."""

    value: float
    interval: tuple[float, float]

    def __str__(self) -> str:
        low, high = self.interval
        return (
            f"{self.value:.1e} [{low:.1e}, {high:.1e}]" if self.value > 0.0 else f"below {high:.1e}"
        )


@dataclass(frozen=True)
class Driving:
    """Recorded frequency of a manoeuvre, or of a pair.

    Attributes:
        exposure: of all recordings.
        kind: of the units, or pairs.
        recordings: how many there are.
        units: how many of the units have parameters. possible: how many of these are within the
            density's limits.
        parts: exposure of each recording by name, `SITE/RECORDING`; none where only the total is
            known.
        simulated: whether the recorded traffic is simulated.
    """

    exposure: Exposure
    kind: str
    recordings: int
    units: int
    possible: int
    parts: Mapping[str, Exposure] = field(default_factory=dict)
    simulated: bool = False

    @property
    def count(self) -> int:
        """Manoeuvres of the kind, those without parameters among them."""
        return self.exposure.counts.get(self.kind, 0)

    def rates(self, probability: Probability) -> dict[str, Rate]:
        """Failures per hour of driving and per 1,000 km, by these names."""
        # A fixed seed: the same search gives the same interval to the last digit.
        generator = np.random.default_rng(0)
        chances, chance = _chances(probability, generator)
        met = self._counts * generator.beta(
            self.possible + _HALF, self.units - self.possible + _HALF, _DRAWS
        )
        by_unit = {}
        for name, driven in (
            (PER_HOUR, self.exposure.hours),
            (PER_DISTANCE, self.exposure.kilometres / _DISTANCE),
        ):
            low, high = np.quantile(chances * met / driven, (0.025, 0.975))
            # No draw fails: there is no lower limit, and all 5 % are left above the upper one.
            if not chance:
                low, high = 0.0, np.quantile(chances * met / driven, 0.95)
            by_unit[name] = Rate(chance * self.per[name], (float(low), float(high)))
        return by_unit

    @property
    def per(self) -> dict[str, float]:
        """Manoeuvres within the density's limits per hour and per 1,000 km, by these names."""
        share = self.possible / self.units if self.units else 0.0
        driven = {PER_HOUR: self.exposure.hours, PER_DISTANCE: self.exposure.kilometres / _DISTANCE}
        return {name: share * self.count / amount for name, amount in driven.items()}

    @property
    def met(self) -> dict[str, Rate]:
        """Recorded manoeuvres per hour and per 1,000 km, by these names, with intervals of their
        counts."""
        low, high = np.quantile(self._counts, (_TAIL, 1.0 - _TAIL)).tolist()
        driven = {PER_HOUR: self.exposure.hours, PER_DISTANCE: self.exposure.kilometres / _DISTANCE}
        return {
            name: Rate(self.count / amount, (low / amount, high / amount))
            for name, amount in driven.items()
        }

    @cached_property
    def _counts(self) -> FloatArray:
        """Draws of the number of manoeuvres (n,) in as much driving.

        Counts of one recording are over-dispersed: recordings are drawn with replacement, within
        sites. Where there are few, or none is known, counts are Poisson's.
        """
        generator = np.random.default_rng(1)
        if len(self.parts) < _RESAMPLED:
            # Jeffreys' prior of a Poisson mean: no recorded manoeuvre still leaves a rate above
            # zero.
            return generator.gamma(self.count + _HALF, 1.0, _DRAWS)
        met, driven = np.zeros(_DRAWS), np.zeros(_DRAWS)
        # Within each kind of site: how much of each was recorded was chosen, and is no matter of
        # chance.
        for parts in self.sites.values():
            drawn = generator.multinomial(len(parts), [1.0 / len(parts)] * len(parts), _DRAWS)
            met += drawn @ np.array([part.counts.get(self.kind, 0) for part in parts])
            driven += drawn @ np.array([part.hours for part in parts])
        # A ratio of sums: recordings differ in length, and so do bootstrap samples of them.
        return met * self.exposure.hours / driven

    @property
    def sites(self) -> dict[str, list[Exposure]]:
        """Exposures of the recordings of each kind of site: the part of their
        names before a slash.
        """
        by_site: dict[str, list[Exposure]] = {}
        for name, part in self.parts.items():
            by_site.setdefault(name.rpartition("/")[0], []).append(part)
        return by_site

    def by_site(self) -> dict[str, dict[str, float]]:
        """Hours, kilometres, and manoeuvres per hour of each kind of site; nothing where there is
        but one."""
        totals = {name: Exposure.total(parts) for name, parts in self.sites.items()}
        if len(totals) < 2:
            return {}
        return {
            name: {
                "hours": exposure.hours,
                "kilometres": exposure.kilometres,
                "manoeuvres_per_hour": exposure.counts.get(self.kind, 0) / exposure.hours,
            }
            for name, exposure in totals.items()
            if exposure.hours
        }

    def as_json(self) -> dict[str, Any]:
        """Return the driving as a JSON object, for files."""
        driven: dict[str, Any] = {
            "hours": self.exposure.hours,
            "kilometres": self.exposure.kilometres,
            "recordings": self.recordings,
        }
        of = {
            "kind": self.kind,
            "manoeuvres": self.count,
            "within_limits": self.possible,
            "of_units": self.units,
        }
        met = {name: [rate.value, *rate.interval] for name, rate in self.met.items()}
        return {
            **driven, **of, "met": met, "simulated": self.simulated, "sites": self.by_site()
        }  # fmt: skip

    def __str__(self) -> str:
        driven = f"{self.exposure.hours:,.1f} h and {self.exposure.kilometres:,.0f} km of "
        driven += f"{'simulated ' if self.simulated else ''}driving in {self.recordings} recordings"
        return f"{self.count} manoeuvres {self.kind} in {driven}"


def driving(recorded: Recorded, space: Space, prior: Prior) -> Driving | str:
    """Return the recorded frequency of a space's manoeuvre, or the reason why it is unknown."""
    total = Exposure.total(recorded.exposure.values())
    if not (total.hours and total.kilometres):
        return "nothing is recorded of how many hours and kilometres were driven"
    pairs = recorded.pairs
    if pairs is None and len({role.actor for role in recorded.roles.values()}) > 1:
        return (
            "it combines units of several actors, and nothing is recorded of how "
            "often they come together"
        )
    pinned = [
        name
        for name, role in recorded.roles.items()
        if name in space.pinned and role.role not in NUISANCES
    ]
    if pinned:
        return f"{pinned[0]} is pinned, and manoeuvres were counted at all its values"
    units, possible = len(recorded.theta), int(prior.possible(recorded.theta).sum())
    if pairs is not None:
        units = len(pairs.recordings)
        total = replace(total, counts={pairs.kind: round(units / pairs.known)})
    parts = {} if pairs is not None else recorded.exposure
    return Driving(
        total, recorded.kind, len(recorded.exposure), units, possible, parts, recorded.simulated
    )


def _chances(probability: Probability, generator: np.random.Generator) -> tuple[FloatArray, float]:
    """Draws of a probability, and its value; where no draw failed, exponential with 95 % below the
    bound."""
    if probability.value <= 0.0:
        # The exponential distribution that exceeds the bound in 5 % of its draws.
        return generator.exponential(-probability.bound / math.log(0.05), _DRAWS), 0.0
    return np.minimum(
        probability.value * np.exp(probability.spread * generator.standard_normal(_DRAWS)), 1.0
    ), probability.value
