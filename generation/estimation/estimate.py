"""How often a system fails when traffic makes a manoeuvre: P(failure | manoeuvre), by multi-fidelity importance sampling.

Failures on the twin say where to look (the proposal), runs there say what is true, and the twin at the same points takes most of
the chance out of it (METHOD.md §6; B. Peherstorfer et al., Multifidelity importance sampling, 2016).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from generation.density.prior import Prior
from generation.estimation.probability import Control, Probability, probability
from generation.estimation.proposal import Proposal
from generation.estimation.rates import Driving, Rate
from generation.outcomes.evaluator import Evaluate
from generation.outcomes.outcomes import Outcomes
from generation.outcomes.references import Drivers, survivors
from generation.search.problem import Plays
from schemas.commands.wording import many
from xodr.array_types import BoolArray, FloatArray

RUNS = 600
"""Runs that an estimate spends"""
FAILURE, PREVENTABLE = "collision", "preventable collision"
BANDS = (0.0, 5.0, 10.0, 20.0)
"""Lower edges of the bands of impact speed, m/s"""
_DEFENSIVE = 0.2
"""Share of the draws that is of the prior"""
_BLOCK, _BLOCKS, _SOUGHT = 16_384, 16, 400
"""Draws of the prior that the twin plays at a time, how often at most, and failures at which it stops"""
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
        known: failures that the proposal was made of; 0 where there were too few, and the runs are draws of the prior.
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


class _Played(NamedTuple):
    """Weighted points, what came of them, and where a careful driver survives."""

    weights: FloatArray
    outcomes: Outcomes
    preventable: BoolArray


def estimate(
    prior: Prior,
    evaluate: Evaluate,
    drivers: Drivers,
    found: FloatArray,
    twin: Plays | None = None,
    settings: EstimateSettings = EstimateSettings(),
) -> Estimate:
    """Estimate how often the system fails.

    Args:
        prior: what traffic does.
        evaluate: runs points with the system under test. drivers: with other ones.
        found: points (m, d) that are known to fail: the proposal is made of these where there is no twin.
        twin: plays points without a simulator; None where there is none.

    Raises:
        UsageError: the known failures make no proposal.
    """
    generator = np.random.default_rng(settings.seed)
    known = found if twin is None else _failures(prior, twin, generator)
    proposal = Proposal(prior, known, _DEFENSIVE) if len(known) >= _LEAST else None
    theta = (prior if proposal is None else proposal).sample(settings.runs, generator)
    outcomes = evaluate(theta)
    theta, outcomes = theta[outcomes.executed], outcomes.take(outcomes.executed)
    real = _judged(theta, outcomes, proposal, drivers)
    controls: tuple[_Played, _Played] | None = None
    if twin is not None and proposal is not None and settings.controlled:
        many = proposal.sample(_CONTROLLED, generator)
        controls = _played(theta, proposal, twin), _played(many, proposal, twin)
    greatest = 1.0 / _DEFENSIVE if proposal is not None else 1.0
    probabilities = {}
    for name, failing in _events(real).items():
        control = None
        if controls is not None:
            same, more = (_events(each)[name] for each in controls)
            control = Control(same, more, controls[1].weights)
        probabilities[name] = probability(failing, real.weights, greatest, control)
    probabilities = {name: each.within(probabilities[FAILURE]) for name, each in probabilities.items()}
    return Estimate(probabilities, len(theta), settings.runs - len(theta), len(known) if proposal is not None else 0)


def _failures(prior: Prior, twin: Plays, generator: np.random.Generator) -> FloatArray:
    """Draws of the prior that fail on the twin."""
    parts: list[FloatArray] = []
    for _ in range(_BLOCKS):
        theta = prior.sample(_BLOCK, generator)
        parts.append(theta[twin(theta).collision])
        if sum(map(len, parts)) >= _SOUGHT:
            break
    return np.concatenate(parts)


def _played(theta: FloatArray, proposal: Proposal, twin: Plays) -> _Played:
    return _judged(theta, twin(theta), proposal, twin)


def _judged(theta: FloatArray, outcomes: Outcomes, proposal: Proposal | None, drivers: Drivers) -> _Played:
    preventable = outcomes.collision.copy()
    preventable[preventable] = survivors(theta[preventable], drivers)
    weights = np.ones(len(theta)) if proposal is None else proposal.weights(theta)
    return _Played(weights, outcomes, preventable)


def _events(played: _Played) -> dict[str, BoolArray]:
    """Whether each event happens at each point (n,)."""
    collision, speed = played.outcomes.collision, played.outcomes.impact_speed
    found = {FAILURE: collision, PREVENTABLE: played.preventable}
    for low, high in zip(BANDS, (*BANDS[1:], np.inf), strict=True):
        name = f"impact at {low:g} to {high:g} m/s" if np.isfinite(high) else f"impact at {low:g} m/s or more"
        found[name] = collision & (speed >= low) & (speed < high)
    return found
