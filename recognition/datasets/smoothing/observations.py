"""What smoothers are given of tracks, and how much of it they believe."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from recognition.datasets.smoothing.limits import Bounds
from xodr.array_types import FloatArray, IntArray


class Noise(NamedTuple):
    """What is not measured of recordings: standard deviations, and how they are distributed.

    heading: of recorded headings, rad. jerk: of the change of the acceleration in a second, m/s². bend: of the change of the
    curvature in a second, 1/m. tails: degrees of freedom of Student's t distribution, by which recorded values are off: many a
    little, some much.
    """

    heading: float = 0.1
    jerk: float = 1.5
    bend: float = 0.02
    tails: float = 4.0


class Seen(NamedTuple):
    """Rows of tracks as they were recorded, one track after the other.

    starts: first row of each track, and the number of rows. time: s.
    x, y: of the centre of the box, m. h: heading, rad. speed: m/s.
    trusted: 0 for rows whose position is known to be wrong, else 1.
    off: standard deviation of the centre, m. facing: of the heading, rad; infinite where it is unknown.
    behind: distance of the rear axle behind the centre, m.
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
        """For each interval between rows: 1, or 0 where a track ends (n - 1,)."""
        joined = np.ones(len(self.time) - 1)
        joined[self.starts[1:-1] - 1] = 0.0
        return joined

    @property
    def steps(self) -> FloatArray:
        """Time between rows, s; 1 where a track ends (n - 1,)."""
        return np.where(self.joined > 0.0, np.diff(self.time), 1.0)

    def part(self, first: int, last: int) -> Seen:
        """Some of the tracks, from `first` to before `last`."""
        rows = slice(int(self.starts[first]), int(self.starts[last]))
        columns = ("time", "x", "y", "h", "speed", "trusted", "off", "facing", "behind")
        cut = {name: getattr(self, name)[rows] for name in columns}
        bounds = Bounds(*(each[rows] for each in self.bounds))
        return self._replace(starts=self.starts[first : last + 1] - self.starts[first], bounds=bounds, **cut)


def turned(angle: FloatArray) -> FloatArray:
    """An angle between -π and π, rad."""
    return np.remainder(angle + np.pi, 2.0 * np.pi) - np.pi


def weight(squares: FloatArray, dimensions: int, tails: float) -> FloatArray:
    """Weight of values that are off by so many squared deviations, by Student's distribution."""
    return (tails + dimensions) / (tails + squares)


def cost(squares: FloatArray, dimensions: int, tails: float) -> FloatArray:
    """What they cost: twice the negative logarithm of the density, but for a constant."""
    return (tails + dimensions) * np.log1p(squares / tails)
