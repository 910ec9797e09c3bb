"""Probability of a failure under the density: importance sampling from a proposal made of failures
in arrays, or draws."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np

from generation.clock import TimeOver
from generation.estimation.probability import (
    ControlVariate,
    Driving,
    FailingDraws,
    Probability,
    Rate,
    WeightedRows,
    density_spread,
    probability,
)
from generation.search.methods.models import differences
from generation.search.outcomes import JUDGES, Drivers, Evaluate, Outcomes, joined, survivors
from generation.search.problem import Plays
from generation.space.density.models.kernels import KDE, scott
from generation.space.density.prior import Prior, until_possible
from schemas.common.array_types import BoolArray, FloatArray, IntArray
from schemas.common.packages import optional
from schemas.common.terminal.text import many

_TREES = 100


class Learned:
    """A forest of the parameters that are no nuisances and their differences; of logarithms where
    the box is positive, so that differences are ratios of speeds and headways.

    Args:
        prior: of the columns.
        theta: runs (n, d). failing: which of them failed (n,), one at least, and not all.

    Raises:
        MissingExtra: scikit-learn is not installed.
    """

    def __init__(self, prior: Prior, theta: FloatArray, failing: BoolArray) -> None:
        self._prior, self._columns = prior, prior.columns(prior.searched)
        self._positive = prior.low[self._columns] > 0.0
        forest: Any = optional("sklearn.ensemble").ExtraTreesClassifier(_TREES, random_state=0)
        self._forest = forest.fit(self._features(theta), failing)

    def _features(self, theta: FloatArray) -> FloatArray:
        # The choices themselves: thresholds of trees fall anywhere between two of them.
        rows = self._prior.chosen(theta)[:, self._columns]
        rows[:, self._positive] = np.log(rows[:, self._positive])
        return differences(rows)

    def failing(self, theta: FloatArray) -> FloatArray:
        """The share (n,) of the trees, weighed by how sure they are, that take points (n, d) for
        failures."""
        share: FloatArray = self._forest.predict_proba(self._features(theta))[:, 1]
        return share


_COUNTED = 20_000
"""Draws that say which share of the kernels is possible"""
_WIDER, _WIDE = 1.5, 0.3
"""Ratio of the second kernel's width to the first around each failure, and its share"""
_UNSURE = 0.3
"""Share of the kernels that is around points which may fail"""


class Proposal:
    """q = a·p + (1 − a)·k: a prior p, and kernels k around known failures, cut where the prior
    ends.

    The defensive share a bounds the weights p/q by 1/a, and with them the error from failures far
    from the known ones. Kernels as narrow as the likelihood of the known failures wants them leave
    others just outside to that share, and one of them among the draws weighs as much as all the
    rest: so there are two around each failure, a narrow and a wide one. T. Hesterberg, Weighted
    average importance sampling and defensive mixture distributions, Technometrics 37, 1995.

    Args:
        prior: p.
        defensive: a.
        failures: points (n, d) at which the system fails, n above the number of parameters that are
            no nuisances.
        others: points (m, d) at which it may fail, fewer than these numbers where there are none;
            they have `_UNSURE` of k.

    Raises:
        UsageError: the failures are too few for a density, or all the same in a parameter.
    """

    def __init__(
        self, prior: Prior, defensive: float, failures: FloatArray, others: FloatArray | None = None
    ) -> None:
        self._prior, self.defensive = prior, defensive
        self._columns = prior.columns(prior.searched)
        unsure = 0.0 if others is None else _UNSURE
        self._kernels = self._around_each(1.0 - unsure, failures)
        if others is not None:
            self._kernels += self._around_each(unsure, others)

    def _around_each(self, share: float, theta: FloatArray) -> tuple[tuple[float, KDE], ...]:
        rows = theta[:, self._columns]
        narrow = KDE().fit(rows)
        wide = KDE(_WIDER * narrow.bandwidth / scott(*rows.shape)).fit(rows)
        return (share * (1.0 - _WIDE), narrow), (share * _WIDE, wide)

    def _around(self, n: int, generator: np.random.Generator) -> FloatArray:
        """Draws (n, d) of the kernels, with nuisances as recorded; some are not possible."""
        theta = np.broadcast_to(
            (self._prior.low + self._prior.high) / 2, (n, len(self._prior.names))
        ).copy()
        counts = generator.multinomial(n, [share for share, _ in self._kernels])
        drawn = [
            kernel.sample(count, generator)
            for count, (_, kernel) in zip(counts, self._kernels, strict=True)
        ]
        # Whoever takes the first rows (`until_possible`) would else get those of the first kernels.
        theta[:, self._columns] = generator.permutation(np.concatenate(drawn))
        # Rows outside are drawn again and need no nuisances.
        inside = self._prior.inside(theta)
        theta[inside] = self._prior.with_nuisances(theta[inside])
        return theta

    @cached_property
    def _log_share(self) -> float:
        """log of the share of the kernels that is possible."""
        return float(
            # A seed of its own: q is one density, whichever draws are weighed.
            np.log(self._prior.possible(self._around(_COUNTED, np.random.default_rng(0))).mean())
        )

    def sample(self, n: int, generator: np.random.Generator) -> FloatArray:
        """Draws (n, d), all possible, as many of the prior as its share says, in random order.

        Raises:
            UsageError: nearly nothing around the failures is possible.
        """
        common = round(self.defensive * n)
        around = until_possible(self._around, self._prior.possible, n - common, generator)
        return generator.permutation(
            np.concatenate([_spread(self._prior, common, generator), around])
        )

    def weights(self, theta: FloatArray) -> FloatArray:
        """p/q of possible points (n, d): (n,)."""
        # In logarithms: densities of several parameters leave the range of floating-point numbers.
        log_p = self._prior.log_density(theta)
        rows = theta[:, self._columns]
        kernels = [np.log(share) + kernel.log_density(rows) for share, kernel in self._kernels]
        log_k = np.logaddexp.reduce(kernels) - self._log_share
        log_q = np.logaddexp(np.log(self.defensive) + log_p, np.log1p(-self.defensive) + log_k)
        ratio: FloatArray = np.exp(log_p - log_q)
        return ratio


def _spread(prior: Prior, n: int, generator: np.random.Generator) -> FloatArray:
    """Draws (n, d) of a prior whose density they have at each point."""
    # Kernels have no choices. At its choices alone p would have no draw in the rest of a cell, and
    # draws where kernels are densest: a choice that fails would seem several times as rare.
    return prior.spread(prior.sample(n, generator), generator)


class Stage(NamedTuple):
    """Draws from a proposal, a number of them; of the prior where it is None."""

    number: int
    proposal: Proposal | None


class Stages:
    """Mixture of the proposals of several stages, q = Σ n_t/n q_t: each draw counts as one of the
    mixture.

    A stage that looked where hardly anything fails then spoils nothing. As later proposals follow
    earlier draws, the estimate is consistent, and not exactly unbiased. E. Veach, L. J. Guibas,
    Optimally combining sampling techniques for Monte Carlo rendering, 1995; J.-M. Cornuet et al.,
    Adaptive multiple importance sampling, Scandinavian Journal of Statistics 39, 2012.
    """

    def __init__(self, stages: Sequence[Stage]) -> None:
        total = max(sum(stage.number for stage in stages), 1)
        self._shares = [(stage.number / total, stage.proposal) for stage in stages]

    def weights(self, theta: FloatArray) -> FloatArray:
        """p/q of possible points (n, d): (n,)."""
        ratio = np.zeros(len(theta))
        for share, proposal in self._shares:
            # 1 / weights is q_t / p, and 1 where q_t is the prior itself.
            ratio += share if proposal is None else share / proposal.weights(theta)
        return 1.0 / ratio

    @property
    def greatest(self) -> float:
        """Weight that none exceeds."""
        # q is nowhere below Σ n_t/n a_t p, so no weight is above the reciprocal.
        defensive = sum(
            share if proposal is None else share * proposal.defensive
            for share, proposal in self._shares
        )
        return 1.0 / defensive if defensive else 1.0


RUNS = 600
"""Runs that an estimate spends"""
FAILURE, PREVENTABLE = "collision", "preventable collision"
BANDS = (0.0, 5.0, 10.0, 20.0)
"""Lower edges of the bands of impact speed, m/s"""
_DEFENSIVE, _LEARNT = 0.2, 0.1
"""Share of the draws that is of the prior, with plays and where its place is taken by what runs say
"""
_BLOCK, _BLOCKS, _SOUGHT = 16_384, 16, 400
"""Draws of the prior that are played at a time, how often at most, and failures at which it stops
"""
_CONTROLLED = 32_768
"""Draws of the proposal that are played"""
_STAGES = 3
"""Without plays, stages of as many runs: each looks where the runs before it say"""
_SURE, _UNSURE, _MOST = 0.5, 0.1, 1600
"""Shares of a forest above which it takes a draw for a failure, and for one that may be; how many
of the latter are kept"""
_LEAST = 30
"""Fewest failures that a proposal is made of"""


@dataclass(frozen=True)
class EstimateSettings:
    """Settings of an estimate.

    Attributes:
        runs: how many are spent.
        seed: of all that is drawn.
        controlled: whether plays of the same points are used as control.
        resampled: densities of resampled recordings that tell how sure the density is.
        judges: names of the drivers of which one survives a failure that counts as preventable.
    """

    runs: int = RUNS
    seed: int = 0
    controlled: bool = True
    resampled: int = 30
    judges: Sequence[str] = JUDGES


class Estimate(NamedTuple):
    """Result of an estimate.

    Attributes:
        probabilities: by event: collisions, those that a careful driver prevents, and bands of
            impact speed.
        runs: how many were executed. failed: how many more were not: they count for nothing.
        known: failures that the last proposal was made of; 0 where there were too few, and the runs
            are draws of the prior.
        driving: how often recordings have the manoeuvre, for rates; or why there are none.
        failing: the draws that fail, for probabilities of parts of the failures; None where none
            was kept.
        drawn: unguided draws among the runs, as time was limited.
    """

    probabilities: dict[str, Probability]
    runs: int
    failed: int
    known: int
    driving: Driving | str = ""
    failing: FailingDraws | None = None
    drawn: int = 0

    def lines(self, failure: str = FAILURE) -> Iterator[str]:
        """Yield the estimate in lines of text, for a terminal.

        Args:
            failure: word for a failure.
        """
        origin = (
            f"draws around {many(self.known, 'failure')}"
            if self.known
            else "draws of the prior, as too few failures are known"
        )
        if self.drawn:
            unguided = f"the {many(self.drawn, 'unguided draw')}"
            own = self.runs - self.drawn
            origin = f"{unguided}, and {origin}" if own else f"{unguided}, no time for more"
        yield f"P(failure | manoeuvre), 95 % intervals, {many(self.runs, 'run')}: {origin}"
        if self.failed:
            yield f"  {many(self.failed, 'more run')} failed, and count for nothing"
        # Without a failure all events have the same bound: once is enough.
        told = self.probabilities if self.probabilities[FAILURE].value > 0.0 else (FAILURE,)
        for name in told:
            yield f"  {name.replace(FAILURE, failure)}: {self.probabilities[name]}"
            yield from (f"    {unit}: {rate}" for unit, rate in self.rates(name).items())
        yield (
            f"  rates of {self.driving}"
            if isinstance(self.driving, Driving)
            else f"  no rates: {self.driving}"
        )

    def rates(self, event: str) -> dict[str, Rate]:
        """Return the rates of an event per hour and per 1,000 km of driving; empty if unknown."""
        return (
            self.driving.rates(self.probabilities[event])
            if isinstance(self.driving, Driving)
            else {}
        )

    def as_json(self) -> dict[str, Any]:
        """Return the estimate as a JSON object, for files: the interval is of 95 %."""
        listed: dict[str, dict[str, Any]] = {
            name: probability.as_json() for name, probability in self.probabilities.items()
        }
        for name, entry in listed.items():
            entry["rates"] = {
                unit: {"value": rate.value, "interval": rate.interval}
                for unit, rate in self.rates(name).items()
            }
        driving = (
            self.driving.as_json()
            if isinstance(self.driving, Driving)
            else {"unknown": self.driving}
        )
        ran = {"runs": self.runs, "failed_runs": self.failed, "known_failures": self.known}
        return {**ran, "probabilities": listed, "driving": driving}


class Known(NamedTuple):
    """Prior knowledge.

    Attributes:
        theta: runs (m, d). failing: which of them failed (m,).
    """

    theta: FloatArray
    failing: BoolArray

    @classmethod
    def of(cls, theta: FloatArray, outcomes: Outcomes) -> Known:
        """Runs (m, d) with outcomes, as far as they took place."""
        # A run that ended with an error has no failure, and did not pass either.
        ran = outcomes.executed
        return cls(theta[ran], outcomes.collision[ran])

    @classmethod
    def nothing(cls, prior: Prior) -> Known:
        """No runs."""
        return cls(np.empty((0, len(prior.names))), np.empty(0, bool))


class Allowance(NamedTuple):
    """Time of an estimate.

    Attributes:
        over: whether it is over. room: points that can be played in a share of what is left.
        drawn: draws (n, d) of the prior. outcomes: their outcomes. They count as runs of the
            estimate, which is one however little time there is.
    """

    over: Callable[[], bool]
    room: Callable[[float], float]
    drawn: FloatArray
    outcomes: Outcomes


class _Played(NamedTuple):
    """Weighted points, their outcomes, and where a careful driver survives."""

    weights: FloatArray
    outcomes: Outcomes
    preventable: BoolArray


def estimate(
    prior: Prior,
    evaluate: Evaluate,
    drivers: Drivers,
    known: Known,
    plays: Plays | None = None,
    settings: EstimateSettings = EstimateSettings(),
    allowed: Allowance | None = None,
) -> Estimate:
    """Estimate how often the system fails.

    Args:
        prior: what traffic does.
        evaluate: runs points with the system under test. drivers: with other ones.
        known: runs of before: the first proposal is made of these where there are no plays.
        plays: plays points without a simulator; None where there is none.
        allowed: time for it; None for no limit.

    Raises:
        UsageError: the known failures make no proposal.
    """
    generator = np.random.default_rng(settings.seed)
    known = known._replace(theta=prior.spread(known.theta, generator))
    ran = _Runs(evaluate, partial(survivors, drivers=drivers, judges=settings.judges), allowed)
    if allowed is not None:
        ran.known(prior.spread(allowed.drawn, generator), allowed.outcomes)
    proposal, looked = None, 0
    # Plays tell before the first run where failures are; runs have to look in stages.
    for runs in _shared(settings.runs, _STAGES if plays is None else 1):
        if allowed is not None and allowed.over():
            break
        proposal, failures = _proposed(prior, plays, known, generator, allowed)
        looked = failures if proposal is not None else looked
        theta = (
            _spread(prior, runs, generator)
            if proposal is None
            else proposal.sample(runs, generator)
        )
        theta, failing = ran(theta, proposal)
        # What this stage has run tells the next one where to look.
        known = Known(
            np.concatenate([known.theta, theta]), np.concatenate([known.failing, failing])
        )
    drawn, theta = Stages(ran.stages), np.concatenate(ran.theta)
    # Each draw weighs as one of the mixture of all stages, whichever stage drew it.
    real = _Played(drawn.weights(theta), joined(ran.outcomes), np.concatenate(ran.prevented))
    controls: tuple[_Played, _Played] | None = None
    # With draws of the prior among the runs, draws of the proposal are no draws of the mixture.
    controlled = settings.controlled and allowed is None
    if plays is not None and proposal is not None and controlled and len(theta):
        many = proposal.sample(_CONTROLLED, generator)
        own, others = (
            _judged(rows, plays(rows), drawn, plays, settings.judges) for rows in (theta, many)
        )
        controls = own, others
    probabilities, colliding = {}, real.outcomes.collision
    # Only failures enter the sums, so densities of resampled recordings are compared there alone.
    resampled = _ratios(prior, theta[colliding], settings, generator, allowed)
    ratios = np.zeros((len(resampled), len(theta)))
    ratios[:, colliding] = resampled
    for name, failing in _events(real).items():
        control = None
        if controls is not None:
            same, more = (_events(control)[name] for control in controls)
            control = ControlVariate(same, more, controls[1].weights)
        found = probability(failing, real.weights, drawn.greatest, control)
        probabilities[name] = found._replace(
            density=density_spread(ratios[:, failing], real.weights[failing])
        )
    probabilities = {
        # Every event is a part of the failures: none may have a higher limit than these.
        name: probability.within(probabilities[FAILURE])
        for name, probability in probabilities.items()
    }
    # Parts of the failures are told apart by distances: of choices, not of points of their cells.
    control_rows = None
    if controls is not None:
        control_rows = (
            _colliding(prior.chosen(theta), controls[0]),
            _colliding(prior.chosen(many), controls[1]),
        )
    kept = (
        None
        if not len(theta)
        else FailingDraws(
            prior.chosen(theta[colliding]),
            real.weights[colliding],
            len(theta),
            drawn.greatest,
            ratios[:, colliding],
            control_rows,
        )
    )
    return Estimate(probabilities, len(theta), ran.failed, looked, failing=kept, drawn=ran.drawn)


def _colliding(theta: FloatArray, played: _Played) -> WeightedRows:
    """Draws (n, d) that collide in plays."""
    rows = played.outcomes.collision
    return WeightedRows(theta[rows], played.weights[rows], len(theta))


_RESAMPLED = 5
"""Densities between two looks at the clock"""


def _ratios(
    prior: Prior,
    theta: FloatArray,
    settings: EstimateSettings,
    generator: np.random.Generator,
    allowed: Allowance | None,
) -> FloatArray:
    """Logarithms (k, n) of p'/p of points (n, d) for densities of resampled recordings, fewer where
    time is over; 0 where none can be resampled."""
    n = settings.resampled
    if not len(theta) or not n:
        return np.zeros((n, len(theta)))
    parts = [prior.log_ratios(theta, n if allowed is None else min(_RESAMPLED, n), generator)]
    while allowed is not None and len(parts[0]) and sum(map(len, parts)) < n:
        if allowed.over():
            break
        parts.append(prior.log_ratios(theta, _RESAMPLED, generator))
    ratios = np.concatenate(parts)
    return ratios if len(ratios) else np.zeros((n, len(theta)))


def _shared(runs: int, stages: int) -> list[int]:
    """Runs of each stage."""
    # Differences of rounded totals: stages differ by one run at most, and all runs are spent.
    stages = min(stages, runs)
    return [runs * (stage + 1) // stages - runs * stage // stages for stage in range(stages)]


_RUN = 20
"""Points that are run, and judged, between two looks at the clock"""


class _Runs:
    """Runs of an estimate, with the verdicts of judges.

    Args:
        evaluate: runs points. prevented: failures (n, d) that a judge survives. allowed: time.

    Attributes:
        stages, theta, outcomes, prevented: each stage, and its points, as far as they were run.
        failed: points that were run without a verdict. drawn: those that were known.
    """

    def __init__(
        self,
        evaluate: Evaluate,
        prevented: Callable[[FloatArray], BoolArray],
        allowed: Allowance | None,
    ) -> None:
        self._evaluate, self._prevented, self._allowed = evaluate, prevented, allowed
        self.stages, self.theta = list[Stage](), list[FloatArray]()
        self.outcomes, self.prevented = list[Outcomes](), list[BoolArray]()
        self.failed = self.drawn = 0

    def known(self, theta: FloatArray, outcomes: Outcomes) -> None:
        """Add draws (n, d) of the prior that were run; a part of them at least."""
        for rows in self._parts(len(theta), first=True):
            self.drawn += len(self._add(theta[rows], outcomes.take(rows), None)[0])

    def __call__(
        self, theta: FloatArray, proposal: Proposal | None
    ) -> tuple[FloatArray, BoolArray]:
        """Run points (n, d) of a stage, as many as there is time for: those with a verdict, and
        which of them fail."""
        ran, failing = [theta[:0]], [np.empty(0, bool)]
        for rows in self._parts(len(theta)):
            points, outcomes = self._add(theta[rows], self._evaluate(theta[rows]), proposal)
            ran.append(points)
            failing.append(outcomes.collision)
        return np.concatenate(ran), np.concatenate(failing)

    def _parts(self, n: int, first: bool = False) -> Iterator[IntArray]:
        """Yield rows of n points, all at once without a limit."""
        size = n if self._allowed is None else _RUN
        for start in range(0, n, max(size, 1)):
            if self._allowed is not None and self._allowed.over() and not (first and start == 0):
                break
            yield np.arange(start, min(start + size, n))

    def _of(self, proposal: Proposal | None) -> bool:
        """Whether the last stage is of a proposal."""
        return bool(self.stages) and self.stages[-1].proposal is proposal

    def _add(
        self, theta: FloatArray, outcomes: Outcomes, proposal: Proposal | None
    ) -> tuple[FloatArray, Outcomes]:
        self.failed += int((~outcomes.executed).sum())
        theta, outcomes = theta[outcomes.executed], outcomes.take(outcomes.executed)
        before = self.stages.pop().number if self._of(proposal) else 0
        self.stages.append(Stage(before + len(theta), proposal))
        self.theta.append(theta)
        self.outcomes.append(outcomes)
        self.prevented.append(_preventable(theta, outcomes, self._prevented))
        return theta, outcomes


def _proposed(
    prior: Prior,
    plays: Plays | None,
    known: Known,
    generator: np.random.Generator,
    allowed: Allowance | None,
) -> tuple[Proposal | None, int]:
    """The proposal of the next stage, and of how many failures it is made."""
    if plays is None:
        return _learnt(prior, known, generator)
    proposal, failures = _failures_on(prior, plays, generator, allowed)
    if proposal is None and allowed is not None:
        # Few plays have few failures: the search may have found more.
        return _learnt(prior, known, generator)
    return proposal, failures


def _failures_on(
    prior: Prior, plays: Plays, generator: np.random.Generator, allowed: Allowance | None
) -> tuple[Proposal | None, int]:
    """The proposal of draws of the prior that fail in arrays, and how many there are; None where
    they are too few."""

    def failing(theta: FloatArray) -> FloatArray:
        return plays(theta).collision.astype(np.float64)

    room = math.inf if allowed is None else _LOOKED * allowed.room(1.0)
    try:
        failures = _draws(prior, failing, generator, room)[0]
    except TimeOver:
        return None, 0
    return Proposal(prior, _DEFENSIVE, failures) if len(failures) >= _LEAST else None, len(failures)


def _learnt(
    prior: Prior, known: Known, generator: np.random.Generator
) -> tuple[Proposal | None, int]:
    """The proposal of what a forest takes for failures, and how many it has learnt from; None where
    they are too few.

    Failures that a search has found are spread over all that fails: draws of the prior among them
    are where traffic fails. What the forest is unsure of has a share of its own: a failure there
    would else weigh more than all others.
    """
    failures = known.theta[known.failing]
    if len(failures) < _LEAST:
        return None, len(failures)
    if known.failing.all():
        return Proposal(prior, _LEARNT, failures), len(failures)
    sure, unsure = _draws(prior, Learned(prior, known.theta, known.failing).failing, generator)
    centres = sure if len(sure) >= _LEAST else failures
    return Proposal(
        prior, _LEARNT, centres, unsure[:_MOST] if len(unsure) >= _LEAST else None
    ), len(failures)


_LOOKED = 0.3
"""Share of the time in which draws of the prior are played"""


def _draws(
    prior: Prior,
    score: Callable[[FloatArray], FloatArray],
    generator: np.random.Generator,
    room: float = math.inf,
) -> tuple[FloatArray, FloatArray]:
    """Draws of the prior whose score says that they fail, and those that may fail, these among
    them.

    Args:
        room: draws that there is time for.
    """
    sure, unsure = list[FloatArray](), list[FloatArray]()
    for block in range(_BLOCKS):
        n = int(min(_BLOCK, room - block * _BLOCK))
        if n <= 0:
            break
        theta = _spread(prior, n, generator)
        scores = score(theta)
        sure.append(theta[scores > _SURE])
        unsure.append(theta[scores > _UNSURE])
        if sum(map(len, sure)) >= _SOUGHT:
            break
    none = np.empty((0, len(prior.names)))
    return np.concatenate([none, *sure]), np.concatenate([none, *unsure])


def _judged(
    theta: FloatArray, outcomes: Outcomes, drawn: Stages, drivers: Drivers, judges: Sequence[str]
) -> _Played:
    survives = partial(survivors, drivers=drivers, judges=judges)
    return _Played(drawn.weights(theta), outcomes, _preventable(theta, outcomes, survives))


def _preventable(
    theta: FloatArray, outcomes: Outcomes, survives: Callable[[FloatArray], BoolArray]
) -> BoolArray:
    """Failures among points (n, d) that a judge survives."""
    preventable = outcomes.collision.copy()
    # Each judge costs a run a point: only failures are driven again.
    preventable[preventable] = survives(theta[preventable])
    return preventable


def _events(played: _Played) -> dict[str, BoolArray]:
    """Whether each event happens at each point (n,)."""
    collision, speed = played.outcomes.collision, played.outcomes.impact_speed
    events = {FAILURE: collision, PREVENTABLE: played.preventable}
    for low, high in zip(BANDS, (*BANDS[1:], np.inf), strict=True):
        name = (
            f"impact at {low:g} to {high:g} m/s"
            if np.isfinite(high)
            else f"impact at {low:g} m/s or more"
        )
        # A failure by a limit alone has no impact: it is in none of the bands.
        events[name] = played.outcomes.touching & (speed >= low) & (speed < high)
    return events
