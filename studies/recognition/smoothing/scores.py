"""Scores of smoothing methods on hidden data."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from recognition.recordings.motion.observations import Bounds, turned
from schemas.common.array_types import BoolArray, FloatArray
from studies.recognition.smoothing.cases import Case, States
from studies.recognition.smoothing.ways import Way

_DEGREES = 4.0
"""Of Student's t distribution of recorded places about those that are found, whatever the way."""
_MOVING = 1.0
"""Speed (m/s) from which headings are compared."""
_LITTLE = 1.1
"""Over a limit, from which a row is beyond it: ours may be exceeded by a little."""


class Score(NamedTuple):
    """Root mean squares over the rows that count, and a likelihood.

    place: distance of the centre, m. heading: rad, where vehicles move. speed: m/s. acceleration:
    m/s².
    likelihood: mean logarithm of the density of the place, by Student's t distribution with the
    deviation of the row as it was recorded; more is better.
    beyond: share of all rows, of those that do not count too, that accelerate, brake or turn beyond
    the limits of their category.
    """

    place: float
    heading: float
    speed: float
    acceleration: float
    likelihood: float
    beyond: float


def score(way: Way, cases: Sequence[Case]) -> Score:
    """Return the score of a method over all rows of all cases together."""
    columns = zip(*(_off(way, case) for case in cases), strict=True)
    means = (float(np.mean(np.concatenate(values))) for values in columns)
    place, heading, speed, acceleration, likelihood, beyond = means
    return Score(
        math.sqrt(place),
        math.sqrt(heading),
        math.sqrt(speed),
        math.sqrt(acceleration),
        likelihood,
        beyond,
    )


def _off(way: Way, case: Case) -> tuple[FloatArray, ...]:
    """Squares of differences, and logarithms of densities, of the rows that count; which rows of
    all are beyond limits."""
    found, truth, counted = way(case), case.truth, case.counted
    squares = (found.x - truth.x) ** 2 + (found.y - truth.y) ** 2
    density = -np.log(2.0 * np.pi * case.off**2) - (0.5 * _DEGREES + 1.0) * np.log1p(
        squares / case.off**2 / _DEGREES
    )
    turn = turned(found.h - truth.h)[counted & (np.abs(truth.speed) >= _MOVING)]
    speed, acceleration = found.speed - truth.speed, found.acceleration - truth.acceleration
    each = squares, speed**2, acceleration**2, density
    place, fast, hard, dense = (values[counted] for values in each)
    return place, turn**2, fast, hard, dense, _beyond(found, case).astype(float)


def _beyond(found: States, case: Case) -> BoolArray:
    rows, who, _ = case.tracks
    limits = Bounds.of([one.category for one in who], rows.sizes)
    turn = np.zeros(len(rows))
    turn[1:] = np.abs(turned(np.diff(found.h))) / np.maximum(np.diff(rows.time), 0.5 * rows.step)
    turn[rows.starts[:-1]] = 0.0
    hard = (found.acceleration > _LITTLE * limits.acceleration) | (
        found.acceleration < -_LITTLE * limits.braking
    )
    return hard | (turn > _LITTLE * limits.yaw_rate)
