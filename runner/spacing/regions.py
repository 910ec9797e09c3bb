"""Regions of traffic actions: ellipses, polygons and stretches of road."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise, product
from typing import TYPE_CHECKING, NamedTuple, Protocol

from xodr.graph.ways import DRIVABLE

if TYPE_CHECKING:
    from xodr.graph.routes import RoadPath
    from xodr.model import RoadPoint
    from xodr.network import RoadNetwork
    from xosc.node import Node


class Region(Protocol):
    """A part of the plane."""

    def contains(self, x: float, y: float) -> bool:
        """Whether a point (m) lies in it."""
        ...


@dataclass(frozen=True, slots=True)
class Ellipse:
    """An ellipse about a point (m); `major` is its half axis along the heading h (rad), `minor` the other (m)."""

    x: float
    y: float
    h: float
    major: float
    minor: float

    def contains(self, x: float, y: float) -> bool:
        """Whether a point lies in it."""
        dx, dy = x - self.x, y - self.y
        cos, sin = math.cos(self.h), math.sin(self.h)
        ahead, aside = dx * cos + dy * sin, dy * cos - dx * sin
        if not (self.major and self.minor):
            return ahead == aside == 0.0
        return math.hypot(ahead / self.major, aside / self.minor) <= 1.0


@dataclass(frozen=True, slots=True)
class Polygon:
    """A polygon by its corners (m), in either order."""

    corners: Sequence[tuple[float, float]]

    def contains(self, x: float, y: float) -> bool:
        """Whether a ray from the point crosses its outline an odd number of times."""
        inside = False
        for (ax, ay), (bx, by) in pairwise([*self.corners, self.corners[0]]):
            if (ay > y) != (by > y) and x < ax + (y - ay) * (bx - ax) / (by - ay):
                inside = not inside
        return inside


class Stretch(NamedTuple):
    """A road between two s (m), and the lanes meant; None for all."""

    road_id: str
    low: float
    high: float
    lanes: frozenset[int] | None


@dataclass(frozen=True, slots=True)
class RoadRanges:
    """Stretches of roads."""

    network: RoadNetwork
    stretches: Sequence[Stretch]

    @classmethod
    def from_xml(cls, nodes: Sequence[Node], network: RoadNetwork) -> RoadRanges:
        """Read RoadRange elements."""
        return cls(network, [stretch for node in nodes for stretch in _limited(node, network)])

    def contains(self, x: float, y: float) -> bool:
        """Whether a point lies on one of them."""
        point = self.network.locate(x, y)
        return self.network.on_road(point) and any(_holds(stretch, point) for stretch in self.stretches)


def _holds(stretch: Stretch, point: RoadPoint) -> bool:
    there = stretch.road_id == point.road_id and stretch.low <= point.s <= stretch.high
    return there and (stretch.lanes is None or point.lane_id in stretch.lanes)


class _Cursor:
    """A RoadCursor: a road, a place on it where one is given, and the lanes meant from there on."""

    def __init__(self, node: Node, network: RoadNetwork) -> None:
        self.node, self.network = node, network
        self.road = network.roads.get(node.get("roadId"))
        if self.road is None:
            raise node.invalid(f"there is no road {node.get('roadId')!r}")
        self.s: float | None = node.finite("s", None)
        if self.s is not None and not 0.0 <= self.s <= self.road.length:
            raise node.invalid(f"s={self.s:g} lies outside the road, which is {self.road.length:g} m long")
        ids = frozenset(lane.int("id") for lane in node.children("Lane"))
        known = {lane_id for section in self.road.sections for lane_id in section.lanes}
        if not ids <= known:
            raise node.invalid(f"road {self.road.id} has no lane {min(ids - known)}")
        self.lanes = ids or None

    def points(self) -> list[RoadPoint]:
        """Points on lanes of traffic there, from which and to which a way may lead."""
        assert self.road is not None
        s = self.road.length / 2 if self.s is None else self.s
        return [self.road.lane_point(s, lane) for lane in self.road.lane_ids(s) if self.road.lane_type(s, lane) in DRIVABLE]


def _limited(node: Node, network: RoadNetwork) -> Iterator[Stretch]:
    """The stretches of a RoadRange, cut off after its length."""
    cursors = [_Cursor(child, network) for child in node.children("RoadCursor")]
    if len(cursors) < 2:
        raise node.invalid("a RoadRange needs two RoadCursors or more")
    left = float(node.float("length", math.inf))
    if left < 0.0:
        raise node.invalid(f"length={left:g} must not be negative")
    for number, (one, other) in enumerate(pairwise(cursors)):
        for road_id, enter, leave in _between(one, other, number == 0, number == len(cursors) - 2):
            length = min(abs(leave - enter), left)
            end = enter + math.copysign(length, leave - enter)
            left -= length
            if length > 0.0:
                yield Stretch(road_id, min(enter, end), max(enter, end), one.lanes)


def _between(one: _Cursor, other: _Cursor, first: bool, last: bool) -> list[tuple[str, float, float]]:
    """Roads with s from one cursor to the next; a road at either end of the range without s is meant as a whole."""
    assert one.road is not None and other.road is not None
    if one.road is other.road:
        start, end = 0.0 if one.s is None else one.s, one.road.length if other.s is None else other.s
        return [(one.road.id, start, end)]
    path = _shortest(one, other)
    found = [(leg.road_id, leg.enter, leg.leave) for leg in path.legs]
    if first and one.s is None:
        found[0] = (one.road.id, 0.0 if path.legs[0].forward else one.road.length, path.legs[0].leave)
    if last and other.s is None:
        found[-1] = (other.road.id, path.legs[-1].enter, other.road.length if path.legs[-1].forward else 0.0)
    return found


def _shortest(one: _Cursor, other: _Cursor) -> RoadPath:
    paths = [one.network.route(pair) for pair in product(one.points(), other.points())]
    found = min((path for path in paths if path is not None), key=lambda path: path.length, default=None)
    if found is None:
        raise other.node.invalid("no way leads here from the cursor before")
    return found
