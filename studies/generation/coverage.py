"""Coverage of the interval of an estimate: recordings are drawn anew, the density is fitted on
them, and a system is estimated.

The density of all recordings is the world: the probability under it is true. Each repetition draws
recordings with replacement, fits its own density, and estimates by runs in arrays, as
the product does for a system without plays in arrays. An interval that holds sampling and density
covers the truth in 95 % of the repetitions.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from generation.estimation.estimate import FAILURE, EstimateSettings, Known, estimate
from generation.estimation.probability import Probability
from generation.search.methods.cover import cover
from generation.search.outcomes import Evaluate, Outcomes
from generation.search.problem import SearchProblem
from generation.space.density.prior import Prior
from generation.space.recorded import Recorded
from generation.space.space import Space
from schemas.common.array_types import FloatArray
from schemas.common.storage import Records
from studies.generation.planted.study import interval

_TRUE = 20_000
"""Runs of the estimate that says what is true"""
_SOUGHT = 300
"""Runs of the search that tells the estimates where a system fails"""


class Estimated(NamedTuple):
    """An estimate of a repetition: system, the probability that is true, the estimate with its
    interval, whether it is stable."""

    system: str
    repetition: int
    true: float
    value: float
    low: float
    high: float
    stable: bool

    @property
    def covers(self) -> bool:
        """Whether the interval holds what is true."""
        return self.low <= self.true <= self.high


def resampled(recorded: Recorded, generator: np.random.Generator) -> Recorded:
    """Draw recordings with replacement, as many as there are; one that is drawn twice counts as
    two."""
    names = np.unique(recorded.recordings)
    drawn = generator.choice(names, len(names))
    rows = [np.flatnonzero(recorded.recordings == name) for name in drawn]
    chosen = np.concatenate(rows)
    again = np.concatenate([np.full(len(each), f"{number}") for number, each in enumerate(rows)])
    values = {name: each[chosen] for name, each in recorded.values.items()}
    return recorded._replace(
        theta=recorded.theta[chosen], recordings=again, errors=None, values=values
    )


def coverage(
    problem: SearchProblem,
    recorded: Recorded,
    systems: Mapping[str, Evaluate],
    density: str,
    repetitions: int,
    runs: int,
    records: Records,
) -> Iterator[Estimated]:
    """Estimate every system in every repetition, or read what is kept.

    Args:
        problem: with the prior that is the world. recorded: what it was fitted on.
        systems: outcomes of points by the system's name.
        density: name of the density model of the repetitions. runs: of an estimate.
    """
    assert problem.prior is not None
    kept = {(each["system"], each["repetition"], each["runs"]): each for each in records.read()[0]}
    if all((name, each, runs) in kept for name in systems for each in range(repetitions)):
        yield from (_of(kept[name, each, runs]) for each in range(repetitions) for name in systems)
        return
    known = {name: _sought(problem, system) for name, system in systems.items()}
    true = {name: _true(problem.prior, system, known[name]) for name, system in systems.items()}
    for repetition in range(repetitions):
        missing = [name for name in systems if (name, repetition, runs) not in kept]
        prior = (
            _refitted(problem.space, recorded, density, repetition) if missing else problem.prior
        )
        for name in missing:
            found = _estimated(
                prior, systems[name], known[name], EstimateSettings(runs, repetition)
            )
            low, high = found.interval
            entry = Estimated(name, repetition, true[name], found.value, low, high, found.stable)
            records.add([{**entry._asdict(), "runs": runs}])
            kept[name, repetition, runs] = entry._asdict()
        yield from (_of(kept[name, repetition, runs]) for name in systems)


def _of(entry: Mapping[str, object]) -> Estimated:
    return Estimated(**{name: entry[name] for name in Estimated._fields})  # type: ignore[arg-type]


def _refitted(space: Space, recorded: Recorded, density: str, repetition: int) -> Prior:
    return resampled(recorded, np.random.default_rng([7, repetition])).prior(space, density)


def _sought(problem: SearchProblem, system: Evaluate) -> Known:
    """Runs of a search."""
    found = cover(replace(problem, evaluate=system, plays=None), _SOUGHT, 0)
    return Known(found.theta, found.outcomes.collision)


def _true(prior: Prior, system: Evaluate, known: Known) -> float:
    return _estimated(prior, system, known, EstimateSettings(_TRUE, 1_000_000, resampled=0)).value


def _estimated(
    prior: Prior, system: Evaluate, known: Known, settings: EstimateSettings
) -> Probability:
    return estimate(prior, system, _nobody, known, None, settings).probabilities[FAILURE]


def _nobody(theta: FloatArray, sut: str) -> Outcomes:
    """No judge survives: what is preventable is not asked."""
    return Outcomes.of(len(theta), collision=np.ones(len(theta), bool))


def markdown(found: Sequence[Estimated]) -> str:
    """Table of a row for each system: shares with 95 % intervals by bootstrap over repetitions."""
    lines = [
        (
            "| system | true probability | repetitions | intervals that cover it | width, high / "
            "low | unstable |"
        )
    ]
    lines.append("|---|---|---|---|---|---|")
    for name in dict.fromkeys(each.system for each in found):
        of = [each for each in found if each.system == name]
        covers = np.array([each.covers for each in of], float)
        low, high = interval(covers)
        widths = [each.high / each.low for each in of if each.low > 0.0]
        width = f"{np.median(widths):.2f}" if widths else "–"
        unstable = sum(not each.stable for each in of)
        lines.append(
            f"| {name} | {of[0].true:.2e} | {len(of)} | {covers.mean():.2f} ({low:.2f} to "
            f"{high:.2f}) | {width} | {unstable} |"
        )
    return "\n".join(lines)
