"""Observations that smoothing estimates states from: noise, physical limits, headings."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from itertools import groupby, pairwise
from operator import itemgetter
from typing import NamedTuple, Self

import numpy as np

from recognition.recordings.rows import Rows, rate
from schemas.common.array_types import FloatArray, IntArray


class KinematicLimits(NamedTuple):
    """Greatest speed and speed in reverse (m/s), acceleration and braking along the path,
    acceleration across it (m/s²), jerk (m/s³), yaw rate (rad/s)."""

    speed: float
    reverse: float
    acceleration: float
    braking: float
    lateral: float
    jerk: float
    yaw_rate: float


_CAR = KinematicLimits(70.0, 5.0, 5.0, 9.0, 8.0, 15.0, 1.0)
_HEAVY = KinematicLimits(35.0, 3.0, 3.0, 8.0, 5.0, 15.0, 0.6)
LIMITS = {
    "car": _CAR,
    "van": _CAR._replace(speed=50.0),
    "truck": _HEAVY,
    "bus": _HEAVY,
    "tram": KinematicLimits(25.0, 3.0, 2.0, 4.0, 3.0, 15.0, 0.6),
    "motorbike": _CAR._replace(speed=80.0, acceleration=8.0),
    "bicycle": KinematicLimits(20.0, 1.0, 3.0, 6.0, 5.0, 15.0, 1.5),
    "pedestrian": KinematicLimits(10.0, 0.0, 5.0, 5.0, 5.0, 30.0, 3.2),
}
"""Sources. Acceleration up to 5 m/s², jerk up to 15 m/s³: Punzo, Borzacchiello and Ciuffo (Transp.
Res. C 19, 2011), Montanino and Punzo (Transp. Res. B 80, 2015), with no more in the sound part of
NGSIM. Braking of 9 m/s² and 8 m/s² across: tyres on dry asphalt; SUMO's emergency braking of cars
is 9 m/s² too. Heavy vehicles brake at up to 8 m/s², and tip over beyond 5 m/s² across (Gillespie,
Fundamentals of Vehicle Dynamics, 1992). Yaw rates: what the smallest turning circle (11 m, 20 m of
heavy vehicles) allows at a walking speed of 5 m/s. Speeds are those that catalogue entries of the
category have."""


class Bounds(NamedTuple):
    """Limits of each row, (n,) each; units as in `KinematicLimits`."""

    speed: FloatArray
    reverse: FloatArray
    acceleration: FloatArray
    braking: FloatArray
    lateral: FloatArray
    jerk: FloatArray
    yaw_rate: FloatArray

    @classmethod
    def of(cls, categories: Iterable[str], sizes: IntArray) -> Self:
        """Build the value for tracks of these categories with the given numbers of rows."""
        return cls(
            *np.repeat(
                np.array([LIMITS.get(category, _CAR) for category in categories]), sizes, axis=0
            ).T
        )


class Noise(NamedTuple):
    """Measurement noise of recordings: standard deviations, and distributions.

    heading: of recorded headings, rad. jerk: of the change of the acceleration in a second, m/s².
    bend: of the change of the curvature in a second, 1/m. tails: degrees of freedom of Student's t
    distribution, by which recorded values are off: many a little, some much.
    """

    heading: float = 0.1
    jerk: float = 1.5
    bend: float = 0.02
    tails: float = 4.0


class Observations(NamedTuple):
    """Rows of tracks as they were recorded, one track after the other.

    starts: first row of each track, and the number of rows. time: s. x, y: of the centre of the
    box, m. h: heading, rad. speed: m/s. trusted: 0 for rows whose position is known to be wrong,
    else 1. off: standard deviation of the centre, m. facing: of the heading, rad; infinite where it
    is unknown. behind: distance of the rear axle behind the centre, m.
    """

    starts: IntArray
    time: FloatArray
    x: FloatArray
    y: FloatArray
    h: FloatArray
    speed: FloatArray
    trusted: FloatArray
    off: FloatArray
    facing: FloatArray
    behind: FloatArray
    bounds: Bounds
    noise: Noise

    @property
    def joined(self) -> FloatArray:
        """1 for each interval between rows of one track, 0 where a track ends (n - 1,)."""
        joined = np.ones(len(self.time) - 1)
        joined[self.starts[1:-1] - 1] = 0.0
        return joined

    @property
    def steps(self) -> FloatArray:
        """Time between rows, s; 1 where a track ends (n - 1,)."""
        return np.where(self.joined > 0.0, np.diff(self.time), 1.0)

    def part(self, first: int, last: int) -> Observations:
        """Subset of the tracks, from `first` to before `last`."""
        rows = slice(int(self.starts[first]), int(self.starts[last]))
        columns = ("time", "x", "y", "h", "speed", "trusted", "off", "facing", "behind")
        cut = {name: getattr(self, name)[rows] for name in columns}
        bounds = Bounds(*(bound[rows] for bound in self.bounds))
        return self._replace(
            starts=self.starts[first : last + 1] - self.starts[first], bounds=bounds, **cut
        )


def turned(angle: FloatArray) -> FloatArray:
    """An angle between -π and π, rad."""
    return np.remainder(angle + np.pi, 2.0 * np.pi) - np.pi


def weight(squares: FloatArray, dimensions: int, tails: float) -> FloatArray:
    """Weight of values that are off by so many squared deviations, by Student's distribution."""
    return (tails + dimensions) / (tails + squares)


def cost(squares: FloatArray, dimensions: int, tails: float) -> FloatArray:
    """Return twice the negative log-likelihood, up to a constant."""
    return (tails + dimensions) * np.log1p(squares / tails)


LEAST = 0.05
"""Least deviation of positions, m."""
_REACH = 1.0
"""Time to either side (s) over which a course is a parabola, but for noise."""


def deviation(rows: Rows, x: FloatArray, y: FloatArray) -> FloatArray:
    """Standard deviation of the position of each row, m: root mean square, within a second, of the
    distance from local parabolas.

    It counts errors that last for some rows, unlike differences from row to row, and is large where
    a track is bad for a while. Parts shorter than two seconds have the median of all rows.
    """
    from scipy.signal import savgol_coeffs

    reach = max(2, round(_REACH / rows.step))
    window = 2 * reach + 1
    if len(rows) < window:
        return np.full(len(rows), LEAST)
    # Savitzky and Golay: the value in the middle of a fitted parabola is a convolution.
    fit = savgol_coeffs(window, 2)
    off = [np.convolve(values, fit, mode="same") - values for values in (x, y)]
    here = np.arange(len(rows))
    # `same` pads with zeros: only whole windows count.
    whole = (here - rows.first >= reach) & (rows.last - here >= reach)
    # Half, as the deviation is that of each axis.
    squares = np.where(whole, 0.5 * (off[0] ** 2 + off[1] ** 2), 0.0)
    first, last = np.maximum(here - reach, rows.first), np.minimum(here + reach, rows.last) + 1
    total, count = (np.append(0.0, np.cumsum(values)) for values in (squares, whole))
    among = count[last] - count[first]
    usual = float(np.median(squares[whole])) if whole.any() else 0.0
    mean = np.divide(
        total[last] - total[first], among, out=np.full(len(rows), usual), where=among > 0.0
    )
    return np.sqrt(LEAST**2 + mean)


_MOVES = 1.0
"""Speed over a second (m/s) from which the motion shows where a vehicle heads."""
_AWAY = 2.0
"""Distance (m) that a stretch of motion leads away at least; less is noise."""
_FAR = 15.0
"""Distance (m) that jitter about a place does not lead away."""
_SHARP = 1.0
"""Turn from row to row (rad) that ends a stretch: no vehicle turns so fast, it goes the other way.
"""


def headings(rows: Rows, seen: Observations) -> FloatArray:
    """Headings (rad) by the motion where there is some, without jumps of whole turns within a
    track.

    In between the heading is that of the last motion; without any, the mean of the recorded ones.
    """
    n, here = len(rows), np.arange(len(rows))
    vx, vy = rate(seen.x, rows), rate(seen.y, rows)
    speed, motion = np.hypot(vx, vy), np.arctan2(vy, vx)
    stretches = _stretches(rows, seen, speed, motion)
    shows = np.zeros(n, bool)
    for first, last in stretches:
        shows[first : last + 1] = True
    h = motion.copy()
    for first, last in _backwards(rows, seen, stretches, speed, motion):
        h[first : last + 1] += np.pi
    start, end = rows.each(rows.starts[:-1]), rows.each(rows.starts[1:])
    before = np.maximum.accumulate(np.where(shows, here, -1))
    after = np.minimum.accumulate(np.where(shows, here, n)[::-1])[::-1]
    source = np.where(before >= start, before, np.where(after < end, after, -1))
    # By vectors: the mean of angles about ±π would point backwards.
    mean = rows.each(np.arctan2(rows.totals(np.sin(seen.h)), rows.totals(np.cos(seen.h))))
    return _unwrapped(np.where(source >= 0, h[source], mean), rows)


def _stretches(
    rows: Rows, seen: Observations, speed: FloatArray, motion: FloatArray
) -> list[tuple[int, int]]:
    """First and last row of each stretch of motion within a track."""
    moves = speed >= _MOVES
    begins = np.ones(len(rows), bool)
    begins[1:] = (moves[1:] != moves[:-1]) | (
        moves[1:] & (np.abs(turned(np.diff(motion))) > _SHARP)
    )
    begins[rows.starts[:-1]] = True
    heads = np.flatnonzero(begins)
    ends = np.append(heads[1:], len(rows)) - 1
    away = np.hypot(seen.x[ends] - seen.x[heads], seen.y[ends] - seen.y[heads])
    leads = moves[heads] & (away >= _AWAY)
    return list(zip(heads[leads].tolist(), ends[leads].tolist(), strict=True))


def _backwards(
    rows: Rows,
    seen: Observations,
    stretches: list[tuple[int, int]],
    speed: FloatArray,
    motion: FloatArray,
) -> Iterator[tuple[int, int]]:
    """Stretches that a vehicle drives in reverse.

    Stretches that are far and fast are forwards. From one stretch to the next the heading changes
    by less than a right angle: who goes back where it came from is in reverse. A track without a
    fast stretch goes forwards where its recorded headings say so.
    """
    track = np.searchsorted(rows.starts, [first for first, _ in stretches], side="right").tolist()
    for _, group in groupby(zip(track, stretches, strict=True), itemgetter(0)):
        own = [stretch for _, stretch in group]
        turns = [_turns_back(motion[a[1]], motion[b[0]]) for a, b in pairwise(own)]
        # Odd where the vehicle goes against the direction of its first stretch.
        parity = np.append(0, np.cumsum(turns)) % 2
        fast = [i for i, piece in enumerate(own) if _fast(seen, piece, speed)]
        if fast:
            # The last fast stretch before, or the first one, says which parity is forwards.
            near = np.array(fast)[
                np.maximum(np.searchsorted(fast, np.arange(len(own)), side="right") - 1, 0)
            ]
            back = parity != parity[near]
        else:
            agree = sum(
                (1 - 2 * p) * _agreement(seen, piece, speed, motion)
                for p, piece in zip(parity, own, strict=True)
            )
            back = parity != (agree < 0.0)
        yield from (piece for piece, reverse in zip(own, back, strict=True) if reverse)


def _turns_back(before: float, after: float) -> bool:
    return abs(math.remainder(after - before, math.tau)) > 0.5 * math.pi


def _fast(seen: Observations, stretch: tuple[int, int], speed: FloatArray) -> bool:
    """Whether a stretch is too far and fast for reverse; that of a pedestrian always is."""
    first, last = stretch
    if seen.bounds.reverse[first] == 0.0:
        return True
    away = math.hypot(seen.x[last] - seen.x[first], seen.y[last] - seen.y[first])
    return away > _FAR and bool(np.median(speed[first : last + 1]) > seen.bounds.reverse[first])


def _agreement(
    seen: Observations, stretch: tuple[int, int], speed: FloatArray, motion: FloatArray
) -> float:
    """Way in the direction of the recorded headings, less the way against it."""
    own = slice(stretch[0], stretch[1] + 1)
    return float((speed[own] * np.cos(motion[own] - seen.h[own])).sum())


def _unwrapped(h: FloatArray, rows: Rows) -> FloatArray:
    """The same directions without a change of more than half a turn from row to row of a track."""
    change = turned(np.diff(h, prepend=h[:1]))
    change[rows.starts[:-1]] = 0.0
    total = np.cumsum(change)
    heads = rows.starts[:-1]
    return rows.each(h[heads] - total[heads]) + total
