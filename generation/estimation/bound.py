"""Draws in arrays until a bound on unknown failures holds, or a failure stands against it.

With no failure in n independent draws the probability of one is below p with 95 % confidence
where 1 − (1 − p)^n ≥ 0.95. n is set before the first draw, and draws end early only where a failure
stands against the bound, so that looking at them in between makes it no weaker.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from generation.search.gate import CONFIDENCE, NEAR, Statement
from generation.search.outcomes import Evaluate
from generation.search.problem import Plays
from generation.space.density.prior import Prior
from generation.space.space import Space, apart, distinctive
from schemas.common.array_types import BoolArray, FloatArray
from schemas.common.terminal.text import many

_BLOCK = 32_768
"""Draws that are played at a time, by several processes"""
_CONFIRMED = 8
"""Failures of a block in arrays that are played again one by one, at most"""


class DrawnBound(NamedTuple):
    """Result of draws that go on until a bound holds or is refuted.

    Attributes:
        asked: probability that failures unlike all found ones are to stay below.
        statement: of the draws.
        against: points (m, d) at which the system fails one by one too, unlike all that the search
            found; the bound does not hold with one.
        unconfirmed: failures in arrays that were no failures one by one: defects of the arrays.
        out_of_time: whether the time of the search ended the draws.
    """

    asked: float
    statement: Statement
    against: FloatArray
    unconfirmed: int
    out_of_time: bool = False

    @property
    def holds(self) -> bool:
        """Whether failures that were not found have a probability below the
        asked one, with 95 % confidence.
        """
        return not len(self.against) and self.statement.unknown <= self.asked

    def as_json(self) -> dict[str, Any]:
        """Return the bound as a JSON object, for files."""
        return {
            "asked": self.asked,
            "holds": self.holds,
            **self.statement.as_json(),
            "against": self.against.tolist(),
            "unconfirmed": self.unconfirmed,
            "out_of_time": self.out_of_time,
        }

    def __str__(self) -> str:
        made = f"{many(self.statement.draws, 'draw')} of the density in arrays"
        if len(self.against):
            failures = many(len(self.against), "failure")
            verb = "stands" if len(self.against) == 1 else "stand"
            return (
                f"{failures} unlike all that the search found {verb} against a bound of "
                f"{self.asked:g}, in {made}"
            )
        if self.holds:
            return (
                f"no failing region of probability above {self.asked:g} was missed "
                f"({CONFIDENCE:.0%} confidence): in {made} all {self.statement.failing:,} failures "
                f"are like found ones"
                if self.statement.failing
                else f"no failing region of probability above {self.asked:g} "
                f"({CONFIDENCE:.0%} confidence): none of {made} fails"
            )
        if not self.statement.draws and self.out_of_time:
            return f"the time was over before a draw was made for a bound of {self.asked:g}"
        ended = f": the time was over, {draws_needed(self.asked):,} are needed"
        return (
            f"failures that were not found have a probability below {self.statement.unknown:.2g}, "
            f"not yet below {self.asked:g}, after {made}{ended if self.out_of_time else ''}"
        )


def draws_needed(asked: float) -> int:
    """Draws without an unknown failure that bound a probability, above 0 and below 1."""
    return math.ceil(math.log(1.0 - CONFIDENCE) / math.log1p(-asked))


def draws_until(
    asked: float,
    space: Space,
    prior: Prior,
    plays: Plays,
    evaluate: Evaluate,
    found: FloatArray,
    seed: int,
    over: Callable[[], bool] = lambda: False,
    progress: Callable[[int], object] = lambda draws: None,
) -> DrawnBound:
    """Draw from a density until a bound holds, a failure stands against it, or the time is over.

    Args:
        asked: the probability, above 0 and below 1.
        prior: density that is drawn from.
        plays: plays points in arrays with the system under test.
        evaluate: runs points one by one: a failure in arrays counts only where it fails there too.
        found: failures (m, d) of the search. They have to be known before the draws.
        seed: of the draws.
        over: whether the time is over.
        progress: called with the number of draws after each block of them.
    """
    # Another stream than that of the search's unguided draws, which has two numbers: the failures
    # of the same draws would all be known already.
    generator = np.random.default_rng([seed, len(space.names), 1])
    columns = distinctive(space)
    known = space.unit(found)[:, columns]
    needed = draws_needed(asked)
    draws = failing = outside = unconfirmed = tried = 0
    against = found[:0]
    out_of_time = False
    while draws < needed and not len(against):
        if out_of_time := over():
            break
        # Never more than the bound needs: `needed` was set before the first draw, so stopping there
        # does not depend on what was seen.
        theta = prior.sample(min(_BLOCK, needed - draws), generator)
        outcomes = plays(theta)
        failed: BoolArray = outcomes.executed & outcomes.collision
        # Draws without a verdict say nothing, and do not count.
        draws, failing = draws + int(outcomes.executed.sum()), failing + int(failed.sum())
        rows = np.flatnonzero(failed)
        if len(known) and rows.size:
            rows = rows[apart(space.unit(theta[rows])[:, columns], known, NEAR)]
        if rows.size:
            shown = rows[:_CONFIRMED]
            # Arrays are a second implementation: only a failure that runs show too refutes a bound.
            again = evaluate(theta[shown])
            against = theta[shown[again.executed & again.collision]]
            survived = int((again.executed & ~again.collision).sum())
            unconfirmed, failing = unconfirmed + survived, failing - survived
            # Those that were not played again count as failures: the bound is no better for it.
            outside += len(rows) - survived
        # Draws that test nothing count for nothing: with enough of them the bound is out of reach.
        tried += len(theta)
        progress(len(theta))
        if not draws and tried >= _BLOCK:
            break
    return DrawnBound(asked, Statement(draws, failing, outside), against, unconfirmed, out_of_time)
