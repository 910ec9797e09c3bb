"""The probabilistic driving risk field: probability and energy of a hit within seconds.

Everyone else's motion relative to the ego is foretold with accelerations that are normally
distributed and last for the whole of a look-ahead time: at time τ the other one's middle is at Δ +
Δv τ + ½ a τ². The probability that the boxes overlap then is that of both their distances, ahead
and aside, being shorter than half their sizes together; the greatest over τ counts. Risk is that
probability times the energy that a crash at the present relative velocity would cost the ego, ½ m
β² |Δv|² with β the other one's share of both masses.

F. A. Mullakkal-Babu, M. Wang, X. He, B. van Arem, R. Happee, Probabilistic field approach for
motorway driving risk assessment, Transportation Research Part C 118, 2020. The field there is of
one future instant, or of several; here of the worst one within `FieldParameters.ahead`. Unlike RSS
distances it grows with every risk, and does not attribute blame.

Frame: the ego's, x ahead and y to the left. In bends others are foretold to go straight on.

The greatest of a run is asked for more often than the whole: where boxes are z standard deviations
apart, they overlap with at most exp(−z²/2), so that most instants can't be it, by the least z that
they could have (`greatest`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from runner.engine.participants.outlines import boxes_overlap, seen_by
from runner.judging.measures.measure import Extreme
from runner.judging.measures.relations import MotionRows, blocks, common
from schemas.common.array_types import FloatArray, IntArray


@dataclass(frozen=True)
class FieldParameters:
    """Assumptions on other entities.

    Attributes:
        along, across: standard deviations of accelerations ahead and aside, m/s².
        ahead, step: longest look-ahead time, and time between those that are looked at, s.
        mass: of the ego, kg. share: of the other one's mass in both.
    """

    along: float = 1.5
    across: float = 0.3
    ahead: float = 3.0
    step: float = 0.1
    mass: float = 1500.0
    share: float = 0.5

    @property
    def times(self) -> FloatArray:
        """Look-ahead times (k,), s."""
        # Without time 0: the deviation there is 0, and boxes that touch are looked at apart.
        return np.arange(1, round(self.ahead / self.step) + 1, dtype=np.float64) * self.step


_erfc = np.frompyfunc(math.erfc, 1, 1)
"""Complementary error function; few instants are asked for, and SciPy's would take longer to import
than a run"""
_TOGETHER = 6
"""Look-ahead times that have one rough bound"""
_SLACK = 1e-6
"""Of logarithms and distances (m) that are compared: more than they are rounded by"""

DEFAULTS = FieldParameters()
"""Cars of equal mass in traffic that mostly keeps its speed and lane."""


class Field(NamedTuple):
    """Strength of the field of one other participant, at each instant.

    Attributes:
        probability: of a collision within the look-ahead time (n,), 0 to 1; 1 where the boxes
            touch.
        risk: expected energy of the crash (n,), kJ.
    """

    probability: FloatArray
    risk: FloatArray


def risk_field(ego: MotionRows, other: MotionRows, parameters: FieldParameters = DEFAULTS) -> Field:
    """The field of another participant where the ego is, row by row.

    Args:
        ego, other: at the same instants.
    """
    approach, touching = _approach(ego, other), boxes_overlap(ego, other)
    bounds = _bounds(approach, parameters.times, parameters)
    rows = np.arange(len(touching))
    # The time with the greatest bound first: its probability excludes most of the others.
    likeliest = bounds.argmax(axis=0)
    found = _overlap(approach, likeliest, rows, parameters)
    with np.errstate(divide="ignore"):
        times, rows = np.nonzero(
            (bounds > np.log(found) - _SLACK) & ~touching
        )  # no other instant can be more
    # A row may occur with several times: plain assignment would keep the last one.
    np.maximum.at(found, rows, _overlap(approach, times, rows, parameters))
    probability = np.where(touching, 1.0, found)
    return Field(probability, probability * approach.energy(parameters))


def greatest(
    ego: MotionRows, others: Sequence[MotionRows], parameters: FieldParameters = DEFAULTS
) -> list[Extreme]:
    """The greatest probability and the greatest risk of the fields of all others; none without
    others.

    Of equal values those of the first participant, and of its first instant, count.
    """
    extremes: list[Extreme] = []
    for block in blocks(others):
        a, b, _, _, who = common(ego, block)
        if not who.size:
            continue
        # Two sieves: few sums for every row, then one bound for each time of the rows left.
        rows = _candidates(a, b, parameters, _roughly)
        rows = rows[_candidates(a.at(rows), b.at(rows), parameters, _finely)]
        field = risk_field(a.at(rows), b.at(rows), parameters)
        tops = [(int(values.argmax()), values) for values in field]
        here = [
            Extreme(float(values[row]), float(a.time[rows[row]]), block[who[rows[row]]].name)
            for row, values in tops
        ]
        extremes = [
            max(pair, key=lambda one: one.value)
            for pair in zip(extremes or here, here, strict=True)
        ]
    return extremes


class _RelativeMotion(NamedTuple):
    """Motion of another entity relative to the ego: ahead and aside (n,), m and m/s; half: half of
    both sizes, m."""

    place: tuple[FloatArray, FloatArray]
    velocity: tuple[FloatArray, FloatArray]
    half: tuple[FloatArray, FloatArray]

    def energy(self, parameters: FieldParameters) -> FloatArray:
        """Energy of a crash now, kJ."""
        vx, vy = self.velocity
        energy: FloatArray = 0.5 * parameters.mass * parameters.share**2 * (vx**2 + vy**2) / 1000.0
        return energy


_Bounded = Callable[[_RelativeMotion, FieldParameters], FloatArray]
"""Logarithms of what the probabilities (n,) of an overlap at any look-ahead time are at most"""


def _approach(ego: MotionRows, other: MotionRows) -> _RelativeMotion:
    x, y, cos, sin = seen_by(ego, other)
    a, b = ego.box, other.box
    half = (
        (a.length + b.length * np.abs(cos) + b.width * np.abs(sin)) / 2,
        (a.width + b.length * np.abs(sin) + b.width * np.abs(cos)) / 2,
    )
    return _RelativeMotion((x, y), (other.speed * cos - ego.speed, other.speed * sin), half)


def _candidates(
    ego: MotionRows, other: MotionRows, parameters: FieldParameters, bounded: _Bounded
) -> IntArray:
    """Candidate rows for the greatest probability and the greatest risk.

    What the rows with the greatest bounds reach, others have to reach by theirs.
    """
    approach = _approach(ego, other)
    bound = bounded(approach, parameters)
    with np.errstate(divide="ignore"):
        bounds = np.stack([bound, np.log(approach.energy(parameters)) + bound])
        best = bounds.argmax(axis=1)
        reached = np.log(np.diag(np.stack(risk_field(ego.at(best), other.at(best), parameters))))
    return np.flatnonzero((bounds >= reached[:, None] - _SLACK).any(axis=0))


def _roughly(approach: _RelativeMotion, parameters: FieldParameters) -> FloatArray:
    """Logarithms of rough upper bounds of the probabilities (n,) of an overlap at any look-ahead
    time.

    Times are taken some together: as if one came as near as it comes between them, and then at the
    last of them.
    """
    ends = parameters.times[::-_TOGETHER][::-1]
    bounds = np.zeros((len(ends), len(approach.place[0])))
    for place, velocity, half, deviation in zip(
        *approach, (parameters.along, parameters.across), strict=True
    ):
        there = place + velocity * np.append(0.0, ends)[:, None]
        low, high = np.minimum(there[1:], there[:-1]), np.maximum(there[1:], there[:-1])
        distance = np.maximum(np.maximum(low, -high) - half, 0.0)
        bounds -= (
            0.5
            * (distance / np.maximum(0.5 * ends * ends * deviation, math.ulp(1.0))[:, None]) ** 2
        )
    bound: FloatArray = bounds.max(axis=0)
    return bound


def _finely(approach: _RelativeMotion, parameters: FieldParameters) -> FloatArray:
    """Logarithms of upper bounds over all look-ahead times, the present included, as boxes may
    touch now."""
    bound: FloatArray = _bounds(approach, np.append(0.0, parameters.times), parameters).max(axis=0)
    return bound


def _bounds(
    approach: _RelativeMotion, times: FloatArray, parameters: FieldParameters
) -> FloatArray:
    """Logarithms of Chernoff's upper bounds of the probabilities of an overlap (k, n) at look-ahead
    times (k,)."""
    time = times[:, None]
    bounds = np.zeros((len(time), len(approach.place[0])))
    for place, velocity, half, deviation in zip(
        *approach, (parameters.along, parameters.across), strict=True
    ):
        # At time 0 the deviation is 0: its floor leaves boxes that are apart then no probability.
        distance = np.maximum(np.abs(place + velocity * time) - half, 0.0)
        bounds -= 0.5 * (distance / np.maximum(0.5 * time * time * deviation, math.ulp(1.0))) ** 2
    return bounds


def _overlap(
    approach: _RelativeMotion, times: IntArray, rows: IntArray, parameters: FieldParameters
) -> FloatArray:
    """Probabilities (m,) that the boxes of rows (m,) overlap at look-ahead times, given by their
    numbers (m,)."""
    time = parameters.times[times]
    hit = np.ones(len(rows))
    for place, velocity, half, deviation in zip(
        *approach, (parameters.along, parameters.across), strict=True
    ):
        hit *= _inside(
            place[rows] + velocity[rows] * time, half[rows], 0.5 * time * time * deviation
        )
    return hit


def _inside(mean: FloatArray, half: FloatArray, deviation: FloatArray) -> FloatArray:
    """Probability that a normal variable is between −half and half (n,)."""
    scale = -math.sqrt(2.0) * np.maximum(deviation, math.ulp(1.0))
    return np.asarray(
        0.5 * (_erfc((half - mean) / scale) - _erfc((-half - mean) / scale)), dtype=np.float64
    )
