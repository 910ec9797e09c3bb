"""The lanes of a road network as a graph in the direction of their traffic, for looking up many
rows at once.

A strip is one lane within one lane section. Left and right are those of the strip's traffic."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from runner.recording import Recording
from schemas.common.array_types import BoolArray, FloatArray, IntArray
from xodr.graph.network import RoadNetwork
from xodr.graph.travel import Traveller
from xodr.graph.ways import DRIVABLE
from xodr.lookup import placing
from xodr.lookup.arrays import sample
from xodr.lookup.placing import Places
from xodr.model import LaneLink
from xodr.model.road import Road

NOWHERE = -1
"""Index in place of a strip where a row is on none."""
_ALIGNED = math.radians(60.0)
"""Greatest angle between a vehicle and a lane that it is on"""
_STEP = 2.0
"""Greatest distance of points on a centre line, m"""
_TOUCH = 0.9
"""Greatest gap or overlap of lanes of different roads that lie side by side, m"""
_SHARED = 6.0
"""Least length of a common border, m: lanes that follow each other touch at a corner"""
_BESIDE = 2.0
"""Greatest distance beside a lane, or beyond the end of its road, of a row that counts as on the
lane, m."""


class Strip(NamedTuple):
    """A lane within a lane section.

    section: index of the section on its road. start, end: the section's s, m. forward: whether its
    traffic drives towards +s. place: how many lanes of the same direction lie to its left. length:
    of its centre line, m. width: its greatest, m. speed_limit: m/s, infinite for none.
    """

    road: str
    section: int
    lane: int
    start: float
    end: float
    forward: bool
    kind: str
    place: int
    length: float
    width: float
    speed_limit: float


class LaneGraph:
    """All lanes of a road network, and which follows which.

    Attributes:
        strips: the lanes within sections.
        following, preceding: indices of the strips that traffic reaches from each, and from which
            it reaches it.
        straight: that one of them which turns least, or NOWHERE.
        road: number of each strip's road.
        driving: whether each strip is for motor vehicles.
    """

    def __init__(self, network: RoadNetwork) -> None:
        self._network = network
        self._traveller = Traveller(network.roads, {}, {})
        self.strips = [
            strip
            for road in network.roads.values()
            for index in range(len(road.sections))
            for strip in self._section(road, index)
        ]
        self._index = {
            (strip.road, strip.section, strip.lane): number
            for number, strip in enumerate(self.strips)
        }
        self._of_lane: dict[tuple[str, int], list[int]] = {}
        for number, strip in enumerate(self.strips):
            self._of_lane.setdefault((strip.road, strip.lane), []).append(number)
        self.following = [self._following(strip) for strip in self.strips]
        self.preceding: list[list[int]] = [[] for _ in self.strips]
        for number, after in enumerate(self.following):
            for other in after:
                self.preceding[other].append(number)
        self.straight = np.array(
            [self._straightest(number) for number in range(len(self.strips))], np.int64
        )
        self._start = np.array([strip.start for strip in self.strips])
        self._end = np.array([strip.end for strip in self.strips])
        numbers = {name: number for number, name in enumerate(network.roads)}
        self.road = np.array([numbers[strip.road] for strip in self.strips], np.int64)
        self.length = np.array([strip.length for strip in self.strips])
        self.width = np.array([strip.width for strip in self.strips])
        self.forward = np.array([strip.forward for strip in self.strips], bool)
        self.speed_limit = np.array([strip.speed_limit for strip in self.strips])
        self.driving = np.array([strip.kind in DRIVABLE for strip in self.strips], bool)
        self._lookup = _Lookup(network, self._index)

    def find(self, road_id: NDArray[np.object_], lane_id: IntArray, s: FloatArray) -> IntArray:
        """Index of the strip of each row, NOWHERE where it is on none."""
        return self._lookup.find(road_id, lane_id, s)

    def contains(self, strip: IntArray, s: FloatArray, offset: FloatArray) -> BoolArray:
        """Whether rows at s and an offset from the lane's centre (m) are on their strip, but for a
        tolerance of `_BESIDE`."""
        along = (s >= self._start[strip] - _BESIDE) & (s <= self._end[strip] + _BESIDE)
        return (strip != NOWHERE) & along & (np.abs(offset) <= 0.5 * self.width[strip] + _BESIDE)

    def numbers(self, road: str, lane: int, start: float, end: float) -> list[int]:
        """Indices of the strips that a lane has from one s to another."""
        return [
            number
            for number in self._of_lane.get((road, lane), [])
            if self._overlaps(number, start, end)
        ]

    def _overlaps(self, number: int, start: float, end: float) -> bool:
        return self.strips[number].start < end and self.strips[number].end > start

    def along(self, strip: IntArray, s: FloatArray) -> FloatArray:
        """Distance from the beginning of each row's strip in the direction of its traffic, along
        its centre line, m."""
        start, end = self._start[strip], self._end[strip]
        way = np.where(self.forward[strip], s - start, end - s)
        # By its share: in a curve a lane is longer or shorter than the road's s says.
        return way * self.length[strip] / np.maximum(end - start, 1e-9)

    def heading(self, strip: int, along: float) -> float:
        """Heading of a strip's traffic at a distance (m) from its beginning, rad."""
        of = self.strips[strip]
        way = along * (of.end - of.start) / max(of.length, 1e-9)
        road = self._network.roads[of.road]
        return road.heading(of.start + way) if of.forward else road.heading(of.end - way) + math.pi

    def lanes_left(self, one: int, other: int) -> int | None:
        """Return the number of lanes that a strip lies to the left of another one beside or before
        it; None for neither.

        A strip that follows counts as 0, as do those that follow it within a few steps: short ones
        are skipped between rows. Of two that follow, the one that bears away from the other counts
        as the lane beside it, if they go on beside each other. Strips of different roads outside of
        junctions lie beside each other as those do that they come from or lead to.
        """
        if other in self.following[one]:
            return self._splits(one, other)
        ahead = [one]
        for _ in range(4):
            for strip in ahead:
                steps = self._beside(strip, other)
                if steps is not None:
                    return steps
            ahead = [after for strip in ahead for after in self.following[strip]]
        found = [self._beside(one, before) for before in self.preceding[other]]
        found += [self._related(one, other), self.side_by_side(one, other)]
        return next((steps for steps in found if steps is not None), None)

    def _beside(self, one: int, other: int) -> int | None:
        a, b = self.strips[one], self.strips[other]
        if (a.road, a.section, a.forward) != (b.road, b.section, b.forward):
            return None
        return a.place - b.place

    def _related(self, one: int, other: int, both: bool = True) -> int | None:
        """Return the lanes between strips outside of junctions that lead to lanes beside each
        other, or also come from such."""
        if self._in_junction(one, other):
            return None
        links = (self.following, self.preceding) if both else (self.following,)
        pairs = ((a, b) for link in links for a in link[one] for b in link[other])
        return next((steps for a, b in pairs if (steps := self._beside(a, b))), None)

    def side_by_side(self, one: int, other: int) -> int | None:
        """Return 1 where the other strip, of another road, touches the left border of one, -1 for
        the right one; None for neither."""
        if self.road[one] == self.road[other] or self._in_junction(one, other):
            return None
        lines = [self.centre_line(strip) for strip in (one, other)]
        step = np.diff(lines[1], axis=0)
        middle, h = 0.5 * (lines[1][1:] + lines[1][:-1]), np.arctan2(step[:, 1], step[:, 0])
        there = middle[:, None] - lines[0]
        cos, sin = np.cos(h)[:, None], np.sin(h)[:, None]
        along = there[..., 0] * cos + there[..., 1] * sin
        across = there[..., 0] * -sin + there[..., 1] * cos
        # Centre lines of lanes side by side are half of both widths apart.
        widths = 0.5 * (self.width[one] + self.width[other])
        near = (np.abs(along) <= _STEP) & (np.abs(np.abs(across) - widths) <= _TOUCH)
        near &= (
            np.abs(np.remainder(h - self.heading(one, 0.0) + np.pi, math.tau) - np.pi)[:, None]
            < _ALIGNED
        )
        # Each near point stands for a step of common border.
        if near.any(axis=1).sum() * _STEP < _SHARED:
            return None
        return int(np.sign(across[near].mean()))

    def centre_line(self, number: int, count: int | None = None) -> FloatArray:
        """Points (count + 1, 2) on a strip's centre line, in the direction of its traffic; 2 m
        apart by default."""
        strip = self.strips[number]
        ends = (strip.start, strip.end) if strip.forward else (strip.end, strip.start)
        s = np.linspace(*ends, 1 + (count or math.ceil((strip.end - strip.start) / _STEP)))
        road = self._network.roads[strip.road]
        centre = road.sections[strip.section].lanes[strip.lane].center
        return sample(road, s, [centre(one) for one in s.tolist()])[:, :2]

    def _in_junction(self, *strips: int) -> bool:
        roads = (self._network.roads[self.strips[strip].road] for strip in strips)
        return any(road.junction_id is not None for road in roads)

    def _splits(self, one: int, other: int) -> int:
        """Return the number of lanes to the left by which `other` bears away where `one` splits
        into lanes side by side."""
        for sibling in self.following[one]:
            steps = self._related(sibling, other, both=False)
            if steps and self._aside(other) > self._aside(sibling):
                return steps
        return 0

    def _aside(self, number: int) -> float:
        """Distance of a strip's end from the line on which it begins, m."""
        strip = self.strips[number]
        road = self._network.roads[strip.road]
        centre = road.sections[strip.section].lanes[strip.lane].center
        ends = np.array([strip.start, strip.end] if strip.forward else [strip.end, strip.start])
        (x, y), heading = (
            np.diff(sample(road, ends, [centre(s) for s in ends.tolist()])[:, :2], axis=0)[0],
            self.heading(number, 0.0),
        )
        return abs(float(y * math.cos(heading) - x * math.sin(heading)))

    def _section(self, road: Road, index: int) -> list[Strip]:
        section = road.sections[index]
        middle = 0.5 * (section.s + section.end)
        from_right = road.lane_ids(middle)
        forward = {lane: road.direction(lane, middle) > 0 for lane in from_right}
        places = {
            lane: place
            for way in (True, False)
            for place, lane in enumerate(_from_left(from_right, forward, way))
        }
        strips = []
        for lane_id in from_right:
            lane = section.lanes[lane_id]
            # Just before its end, as that is the beginning of the next section.
            length, _ = self._traveller.length(
                road, lane_id, section.s, math.nextafter(section.end, -math.inf)
            )
            width = max(lane.width(s) for s in (section.s, middle, section.end))
            limit = road.speed_limit(middle, lane_id)
            where = (
                road.id,
                index,
                lane_id,
                section.s,
                section.end,
                forward[lane_id],
                lane.type,
                places[lane_id],
            )
            strips.append(Strip(*where, length, width, math.inf if limit is None else limit))
        return strips

    def _following(self, strip: Strip) -> list[int]:
        road = self._network.roads[strip.road]
        lane = road.sections[strip.section].lanes[strip.lane]
        beyond = strip.section + (1 if strip.forward else -1)
        if 0 <= beyond < len(road.sections):
            linked = lane.successor if strip.forward else lane.predecessor
            found = [self._index.get((strip.road, beyond, linked))] if linked is not None else []
        else:
            found = [
                self._entered(link)
                for link in self._network.links(strip.road, strip.lane, strip.forward)
            ]
        return [number for number in found if number is not None]

    def _entered(self, link: LaneLink) -> int | None:
        """The strip that a link leads into, unless against its traffic."""
        section = 0 if link.at_start else len(self._network.roads[link.road_id].sections) - 1
        number = self._index.get((link.road_id, section, link.lane_id))
        # Links into the start of a road continue along +s, those into its end along −s.
        return (
            number if number is not None and self.strips[number].forward == link.at_start else None
        )

    def _straightest(self, number: int) -> int:
        def turn(after: int) -> tuple[float, bool]:
            strip = self.strips[after]
            return self._traveller.turn(LaneLink(strip.road, strip.lane, strip.forward))

        return min(self.following[number], key=turn, default=NOWHERE)


def _from_left(from_right: tuple[int, ...], forward: dict[int, bool], way: bool) -> list[int]:
    """Lanes of one direction from the left to the right of their traffic, given all lanes in
    ascending t."""
    lanes = [lane for lane in from_right if forward[lane] == way]
    return lanes[::-1] if way else lanes


class _Lookup:
    """Table from section and lane id to strips."""

    def __init__(self, network: RoadNetwork, index: dict[tuple[str, int, int], int]) -> None:
        self._roads = {road: number for number, road in enumerate(network.roads)}
        self._starts = [
            np.array([section.s for section in road.sections]) for road in network.roads.values()
        ]
        self._first = np.concatenate([[0], np.cumsum([len(starts) for starts in self._starts])])
        # Lane ids have both signs: shifted by this they are columns.
        self._reach = max((abs(lane) for _, _, lane in index), default=0)
        self._table = np.full((self._first[-1], 2 * self._reach + 1), NOWHERE, np.int64)
        for (road, section, lane), number in index.items():
            self._table[self._first[self._roads[road]] + section, lane + self._reach] = number

    def find(self, road_id: NDArray[np.object_], lane_id: IntArray, s: FloatArray) -> IntArray:
        """Index of the strip of each row (n,), NOWHERE where it is on none; s in
        m along the roads.
        """
        begins = np.flatnonzero(np.append(True, road_id[1:] != road_id[:-1]))[
            : len(road_id)
        ]  # rows of a track stay on a road
        numbers = np.array(
            [self._roads.get(one, NOWHERE) for one in road_id[begins].tolist()], np.int64
        )
        road = np.repeat(numbers, np.diff(begins, append=len(road_id)))
        row = np.zeros(len(road), np.int64)
        for number in np.unique(road[road >= 0]).tolist():
            mine = road == number
            row[mine] = self._first[number] + np.maximum(
                np.searchsorted(self._starts[number], s[mine], side="right") - 1, 0
            )
        known = (road >= 0) & (np.abs(lane_id) <= self._reach)
        # Rows that are not known look up lane 0 of some section, and the result is dropped.
        return np.where(known, self._table[row, np.where(known, lane_id, 0) + self._reach], NOWHERE)


def on_lanes(recording: Recording, network: RoadNetwork, ego: str, times: FloatArray) -> BoolArray:
    """Whether a track of a placed recording is on a lane of the network at some times (s) of its
    own."""
    columns, lanes = recording.tracks[ego].columns, graph(network)
    rows = np.clip(np.searchsorted(columns["time"], times - 1e-6), 0, len(columns["time"]) - 1)
    road, lane, s, offset = (
        columns[name][rows] for name in ("road_id", "lane_id", "s", "lane_offset")
    )
    return lanes.contains(lanes.find(road, lane.astype(np.int64), s), s, offset)


def on_driving_lanes(lanes: LaneGraph, network: RoadNetwork, places: Places, poses: Poses) -> None:
    """Move places of motor vehicles to the driving lane below that is best aligned, if there is
    one: those for bicycles overlap.

    Args:
        places: road coordinates (n,), changed in place.
        poses: x, y, z, h of the same vehicles, m and rad.
    """
    # Beyond this angle no lane below is better: the place stays as it is.
    best = np.full(len(poses.x), _ALIGNED)
    for under in placing.lanes_under(network, poses.x, poses.y, poses.z):
        rows, strip = (
            under.rows,
            lanes.find(np.full(len(under.rows), under.road.id, object), under.lane_id, under.s),
        )
        along = lanes.along(strip, under.s)
        ways = [lanes.heading(*one) for one in zip(strip.tolist(), along.tolist(), strict=True)]
        angle = np.abs(
            np.remainder(poses.h[rows] - np.array(ways, np.float64) + np.pi, 2.0 * np.pi) - np.pi
        )
        better = (strip != NOWHERE) & lanes.driving[strip] & (angle < best[rows])
        rows = rows[better]
        best[rows] = angle[better]
        places.road_id[rows] = under.road.id
        for column, values in zip(
            places[1:], (under.lane_id, under.s, under.t, under.offset), strict=True
        ):
            column[rows] = values[better]


class Poses(NamedTuple):
    """Positions (m) and headings (rad) of n vehicles."""

    x: FloatArray
    y: FloatArray
    z: FloatArray
    h: FloatArray


@lru_cache(maxsize=8)
def graph(network: RoadNetwork) -> LaneGraph:
    """The lanes of a network, built once."""
    return LaneGraph(network)
