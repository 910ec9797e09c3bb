"""How often a system fails when traffic makes a manoeuvre: P(failure | manoeuvre), by multi-fidelity importance sampling.

Failures on the twin say where to look (the proposal), runs there say what is true, and the twin at the same points takes most of
the chance out of it (METHOD.md §6; B. Peherstorfer et al., Multifidelity importance sampling, 2016). Without a twin, a forest
that has learnt from the runs so far says where to look, and learns anew after each stage of the runs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from generation.density.prior import Prior
from generation.estimation.learned import Learned
from generation.estimation.probability import Control, Probability, probability
from generation.estimation.proposal import Proposal, Stage, Stages
from generation.estimation.rates import Driving, Rate
from generation.outcomes.evaluator import Evaluate
from generation.outcomes.outcomes import Outcomes, joined
from generation.outcomes.references import Drivers, survivors
from generation.search.problem import Plays
from schemas.commands.wording import many
from xodr.array_types import BoolArray, FloatArray

RUNS = 600
"""Runs that an estimate spends"""
FAILURE, PREVENTABLE = "collision", "preventable collision"
BANDS = (0.0, 5.0, 10.0, 20.0)
"""Lower edges of the bands of impact speed, m/s"""
_DEFENSIVE, _LEARNT = 0.2, 0.1
"""Share of the draws that is of the prior, with a twin and where its place is taken by what runs say"""
_BLOCK, _BLOCKS, _SOUGHT = 16_384, 16, 400
"""Draws of the prior that the twin plays at a time, how often at most, and failures at which it stops"""
_STAGES = 3
"""Without a twin, stages of as many runs: each looks where the runs before it say"""
_SURE, _UNSURE, _MOST = 0.5, 0.1, 1600
"""Shares of a forest above which it takes a draw for a failure, and for one that may be; how many of the latter are kept"""
_CONTROLLED = 32_768
"""Draws of the proposal that the twin plays"""
_LEAST = 30
"""Fewest failures that a proposal is made of"""


@dataclass(frozen=True)
class EstimateSettings:
    """How it is estimated.

    Attributes:
        runs: how many are spent.
        seed: of all that is drawn.
        controlled: whether the twin at the same points is used as control.
    """

    runs: int = RUNS
    seed: int = 0
    controlled: bool = True


class Estimate(NamedTuple):
    """What came of it.

    Attributes:
        probabilities: by event: collisions, those that a careful driver prevents, and bands of impact speed.
        runs: how many were executed. failed: how many more were not: they count for nothing.
        known: failures that the last proposal was made of; 0 where there were too few, and the runs are draws of the prior.
        driving: how often recordings have the manoeuvre, for rates; or why there are none.
    """

    probabilities: dict[str, Probability]
    runs: int
    failed: int
    known: int
    driving: Driving | str = ""

    def lines(self) -> Iterator[str]:
        """For people."""
        origin = (
            f"draws around {many(self.known, 'failure')}" if self.known else "draws of the prior, as too few failures are known"
        )
        yield f"P(failure | manoeuvre), 95 % intervals, {many(self.runs, 'run')}: {origin}"
        if self.failed:
            yield f"  {many(self.failed, 'more run')} failed, and count for nothing"
        told = self.probabilities if self.probabilities[FAILURE].value > 0.0 else (FAILURE,)
        for name in told:
            yield f"  {name}: {self.probabilities[name]}"
            yield from (f"    {unit}: {rate}" for unit, rate in self.rates(name).items())
        yield f"  rates of {self.driving}" if isinstance(self.driving, Driving) else f"  no rates: {self.driving}"

    def rates(self, event: str) -> dict[str, Rate]:
        """How often an event happens per hour and per 1,000 km of driving; nothing where that is not known."""
        return self.driving.rates(self.probabilities[event]) if isinstance(self.driving, Driving) else {}

    def as_json(self) -> dict[str, Any]:
        """For files: the interval is of 95 %."""
        listed: dict[str, dict[str, Any]] = {
            name: {"value": each.value, "interval": each.interval, "effective_failures": each.effective, "stable": each.stable}
            for name, each in self.probabilities.items()
        }
        for name, each in listed.items():
            each["rates"] = {unit: {"value": rate.value, "interval": rate.interval} for unit, rate in self.rates(name).items()}
        driving = self.driving.as_json() if isinstance(self.driving, Driving) else {"unknown": self.driving}
        ran = {"runs": self.runs, "failed_runs": self.failed, "known_failures": self.known}
        return {**ran, "probabilities": listed, "driving": driving}


class Known(NamedTuple):
    """What is known before.

    Attributes:
        theta: runs (m, d). failing: which of them failed (m,).
    """

    theta: FloatArray
    failing: BoolArray

    @classmethod
    def nothing(cls, prior: Prior) -> Known:
        """No runs."""
        return cls(np.empty((0, len(prior.names))), np.empty(0, bool))


class _Played(NamedTuple):
    """Weighted points, what came of them, and where a careful driver survives."""

    weights: FloatArray
    outcomes: Outcomes
    preventable: BoolArray


def estimate(
    prior: Prior,
    evaluate: Evaluate,
    drivers: Drivers,
    known: Known,
    twin: Plays | None = None,
    settings: EstimateSettings = EstimateSettings(),
) -> Estimate:
    """Estimate how often the system fails.

    Args:
        prior: what traffic does.
        evaluate: runs points with the system under test. drivers: with other ones.
        known: runs of before: the first proposal is made of these where there is no twin.
        twin: plays points without a simulator; None where there is none.

    Raises:
        UsageError: the known failures make no proposal.
    """
    generator = np.random.default_rng(settings.seed)
    stages, thetas, parts, looked = list[Stage](), list[FloatArray](), list[Outcomes](), 0
    for runs in _shared(settings.runs, _STAGES if twin is None else 1):
        proposal, failures = _failures_on(prior, twin, generator) if twin is not None else _learnt(prior, known, generator)
        looked = failures if proposal is not None else looked
        theta = (prior if proposal is None else proposal).sample(runs, generator)
        outcomes = evaluate(theta)
        theta, outcomes = theta[outcomes.executed], outcomes.take(outcomes.executed)
        stages.append(Stage(len(theta), proposal))
        thetas.append(theta)
        parts.append(outcomes)
        known = Known(np.concatenate([known.theta, theta]), np.concatenate([known.failing, outcomes.collision]))
    drawn, theta = Stages(stages), np.concatenate(thetas)
    real = _judged(theta, joined(parts), drawn, drivers)
    controls: tuple[_Played, _Played] | None = None
    if twin is not None and proposal is not None and settings.controlled:
        many = proposal.sample(_CONTROLLED, generator)
        controls = _played(theta, drawn, twin), _played(many, drawn, twin)
    probabilities = {}
    for name, failing in _events(real).items():
        control = None
        if controls is not None:
            same, more = (_events(each)[name] for each in controls)
            control = Control(same, more, controls[1].weights)
        probabilities[name] = probability(failing, real.weights, drawn.greatest, control)
    probabilities = {name: each.within(probabilities[FAILURE]) for name, each in probabilities.items()}
    return Estimate(probabilities, len(theta), settings.runs - len(theta), looked)


def _shared(runs: int, stages: int) -> list[int]:
    """Runs of each stage."""
    return [runs * (each + 1) // stages - runs * each // stages for each in range(min(stages, runs))]


def _failures_on(prior: Prior, twin: Plays, generator: np.random.Generator) -> tuple[Proposal | None, int]:
    """The proposal of draws of the prior that fail on the twin, and how many there are; None where they are too few."""
    failures = _draws(prior, lambda theta: twin(theta).collision.astype(np.float64), generator)[0]
    return Proposal(prior, _DEFENSIVE, failures) if len(failures) >= _LEAST else None, len(failures)


def _learnt(prior: Prior, known: Known, generator: np.random.Generator) -> tuple[Proposal | None, int]:
    """The proposal of what a forest takes for failures, and how many it has learnt from; None where they are too few.

    Failures that a search has found are spread over all that fails: draws of the prior among them are where traffic fails. What
    the forest is unsure of has a share of its own: a failure there would else weigh more than all others.
    """
    failures = known.theta[known.failing]
    if len(failures) < _LEAST:
        return None, len(failures)
    if known.failing.all():
        return Proposal(prior, _LEARNT, failures), len(failures)
    sure, unsure = _draws(prior, Learned(prior, known.theta, known.failing).failing, generator)
    centres = sure if len(sure) >= _LEAST else failures
    return Proposal(prior, _LEARNT, centres, unsure[:_MOST] if len(unsure) >= _LEAST else None), len(failures)


def _draws(
    prior: Prior, score: Callable[[FloatArray], FloatArray], generator: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Draws of the prior whose score says that they fail, and those that may fail, these among them."""
    sure, unsure = list[FloatArray](), list[FloatArray]()
    for _ in range(_BLOCKS):
        theta = prior.sample(_BLOCK, generator)
        scores = score(theta)
        sure.append(theta[scores > _SURE])
        unsure.append(theta[scores > _UNSURE])
        if sum(map(len, sure)) >= _SOUGHT:
            break
    return np.concatenate(sure), np.concatenate(unsure)


def _played(theta: FloatArray, drawn: Stages, twin: Plays) -> _Played:
    return _judged(theta, twin(theta), drawn, twin)


def _judged(theta: FloatArray, outcomes: Outcomes, drawn: Stages, drivers: Drivers) -> _Played:
    preventable = outcomes.collision.copy()
    preventable[preventable] = survivors(theta[preventable], drivers)
    return _Played(drawn.weights(theta), outcomes, preventable)


def _events(played: _Played) -> dict[str, BoolArray]:
    """Whether each event happens at each point (n,)."""
    collision, speed = played.outcomes.collision, played.outcomes.impact_speed
    found = {FAILURE: collision, PREVENTABLE: played.preventable}
    for low, high in zip(BANDS, (*BANDS[1:], np.inf), strict=True):
        name = f"impact at {low:g} to {high:g} m/s" if np.isfinite(high) else f"impact at {low:g} m/s or more"
        found[name] = collision & (speed >= low) & (speed < high)
    return found
