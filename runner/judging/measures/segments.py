"""Instants of many runs, a segment of time after the other, and motion along roads in them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np

from runner.judging.measures.relations import MotionRows
from schemas.common.array_types import BoolArray, FloatArray, IntArray

if TYPE_CHECKING:
    from runner.engine.participants.declaration import BoundingBox
    from xodr.graph.network import RoadNetwork

SEGMENT = 32
"""Instants that are kept in one array"""
FRAME = ("x", "y", "z", "h", "speed", "s", "t")
ENDLESS = np.iinfo(np.int64).max
"""Number of instants of a run that is not over"""


@dataclass(eq=False)
class Segment:
    """Instants of the same runs, at most `SEGMENT` of them.

    Args:
        first: step of the first one.
        at: numbers of the runs, ascending (k,).
        values: of each participant: x, y, z, h, speed, s, t (p, 7, `SEGMENT`, k).
        roads: keys of roads of each participant (p, `SEGMENT`, k).

    Attributes:
        count: instants that it has.
    """

    first: int
    at: IntArray
    values: FloatArray = field(repr=False)
    roads: IntArray = field(repr=False)
    count: int = 0

    @property
    def steps(self) -> IntArray:
        """Numbers of its time steps (c,)."""
        return np.arange(self.first, self.first + self.count)


class MotionAlong(NamedTuple):
    """Participant at instants of some runs (c, k), its direction along the road (+1 towards
    increasing s, else −1), and its lateral speed towards +t, m/s."""

    rows: MotionRows
    side: FloatArray
    drift: FloatArray


class RoadMotion:
    """A participant's motion along roads in n runs: `relations.along_road` of segments.

    Attributes:
        facing: sign of its first movement along s in its direction of travel (n,); 0 before it.
    """

    def __init__(
        self,
        n: int,
        box: BoundingBox,
        roads: Mapping[int, str],
        network: RoadNetwork | None,
        dt: float,
    ) -> None:
        self._box, self._network, self._dt = box, network, dt
        names = {road: code for code, road in enumerate(dict.fromkeys(roads.values()))}
        self._codes = {key: names[road] for key, road in roads.items()}
        self._names = names
        self._hints: dict[int, Any] = {}
        """where it was located last, by the numbers of runs"""
        self.facing, self._last = np.zeros(n), np.zeros(n)
        self._s, self._t = np.zeros(n), np.zeros(n)
        self._road = np.full(n, -2)
        """s, t and code of its road at the last instant that was measured"""
        self._seen = np.zeros(n), np.zeros(n), np.full(n, -2)
        """the same of the last instant that was surveyed"""
        self._second = np.zeros(n)
        """its lateral speed in the first step, m/s"""

    def survey(self, part: Segment, number: int, sizes: IntArray) -> None:
        """Locate it where it is off roads, and find its first movements."""
        roads = self._coded(part, number, sizes)
        speed, s, t = part.values[number, 4:, : part.count]
        old_s, old_t, old_road = self._seen
        unknown = np.flatnonzero(self.facing[part.at] == 0.0)
        runs = part.at[unknown]
        if unknown.size:
            turns, _ = self._turns(
                s[:, unknown], speed[:, unknown], roads[:, unknown], old_s[runs], old_road[runs]
            )
            turns[part.steps[:, None] >= sizes[runs]] = 0.0
            first = (turns != 0.0).argmax(axis=0)
            self.facing[runs] = turns[first, np.arange(len(runs))]
        row = 1 - part.first
        # Step 1 gives step 0 its lateral speed, as `relations.along_road` does for a first row.
        if 0 <= row < part.count:
            before, road = (old_t[part.at], old_road[part.at]) if row == 0 else (t[0], roads[0])
            rate = (t[row] - before) / self._elapsed(1)
            # A change of roads has no rate; runs of one instant have no step.
            self._second[part.at] = np.where((roads[row] == road) & (sizes[part.at] > 1), rate, 0.0)
        for old, now in zip(self._seen, (s, t, roads), strict=True):
            old[part.at] = now[-1]

    def _coded(self, part: Segment, number: int, sizes: IntArray) -> IntArray:
        """Replace keys of roads by codes of their names (c, k), and set s and t off roads."""
        roads = part.roads[number, : part.count]
        # Most participants stay on one road for a segment: no keys have to be sorted then.
        key = int(roads[0, 0])
        if key and (roads == key).all():
            roads[:] = self._codes[key]
            return roads
        keys, inverse = np.unique(roads, return_inverse=True)
        codes = np.array([self._codes.get(key, -1) for key in keys.tolist()])
        roads[:] = codes[inverse].reshape(roads.shape)
        if self._network is None:
            return roads
        x, y, z, h, _, s, t = part.values[number, :, : part.count]
        off = (roads < 0) & (part.steps[:, None] < sizes[part.at])
        for column, row in zip(*np.nonzero(off.T), strict=True):
            run, at = int(part.at[column]), (row, column)
            px, py, pz, ph = (float(axis[at]) for axis in (x, y, z, h))
            where = self._network.locate(px, py, pz, ph, self._hints.get(run))
            self._hints[run] = where
            roads[at], s[at], t[at] = self._names[where.road_id], where.s, where.t
        return roads

    def _elapsed(self, step: int) -> float:
        """Time between a step and the one before, s."""
        return max(float(np.round(step * self._dt, 9) - np.round((step - 1) * self._dt, 9)), 1e-9)

    @staticmethod
    def _turns(
        s: FloatArray, speed: FloatArray, roads: IntArray, old_s: FloatArray, old_road: IntArray
    ) -> tuple[FloatArray, BoolArray]:
        """Signs of movements along s in the direction of travel (c, k), 0 for none, and where
        another road begins."""
        jumps, ahead = np.empty(s.shape, bool), np.empty(s.shape)
        np.not_equal(roads[1:], roads[:-1], out=jumps[1:])
        np.not_equal(roads[0], old_road, out=jumps[0])
        np.subtract(s[1:], s[:-1], out=ahead[1:])
        np.subtract(s[0], old_s, out=ahead[0])
        # Along s backwards at negative speed is a movement in reverse, not a turn.
        turns = np.sign(ahead) * np.sign(speed)
        if jumps.any():
            turns[jumps] = 0.0
        return turns, jumps

    def moved(self, part: Segment, number: int, some: slice) -> MotionAlong:
        """Motion of the participant in some of a segment's runs."""
        count, runs = part.count, part.at[some]
        x, y, z, h, speed, s, t = part.values[number, :, :count, some]
        roads = part.roads[number, :count, some]
        turns, jumps = self._turns(s, speed, roads, self._s[runs], self._road[runs])
        side = turns
        still = turns == 0.0
        if still.any():
            place = np.where(still, -1, np.arange(count)[:, None])
            place = np.maximum.accumulate(place, axis=0)
            side = np.take_along_axis(turns, np.maximum(place, 0), axis=0)
            last = self._last[runs]
            # Before its first movement it faces as in that one.
            last = np.where(last != 0.0, last, self.facing[runs])
            side = np.where(place < 0, np.where(last != 0.0, last, 1.0), side)
        moved = turns.any(axis=0)
        self._last[runs] = np.where(moved, side[-1], self._last[runs])
        # Times as recordings have them, rounded to ns: the same rates to the bit as in single runs.
        times = np.round(np.arange(part.first - 1, part.first + count) * self._dt, 9)
        drift = np.empty(t.shape)
        np.subtract(t[1:], t[:-1], out=drift[1:])
        np.subtract(t[0], self._t[runs], out=drift[0])
        drift /= np.maximum(np.diff(times), 1e-9)[:, None]
        if jumps.any():
            drift[jumps] = 0.0
        if part.first == 0:
            drift[0] = self._second[runs]
        self._s[runs], self._t[runs], self._road[runs] = s[-1], t[-1], roads[-1]
        time, road = np.broadcast_to(times[1:, None], s.shape), cast(Any, roads)
        return MotionAlong(
            MotionRows("", self._box, time, x, y, z, h, speed, road, s, t), side, drift
        )
