"""Where roads begin and end: lines across the road on which all roads of a joint agree, border for border.

A joint is measured on one road, its owner: the one that splits or the one into which others merge. Its line runs at right
angles to the owner where all its lanes still (or already) exist, since lanelets rarely end abreast. What the lanelets of the
others lack up to that line, or have beyond it, they take from, or leave to, the owner's.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from xodr.lanelet2.bundles import Joint, Layout
from xodr.lanelet2.graph import Graph
from xodr.lanelet2.lanelet import Points
from xodr.lanelet2.lines.polylines import Frame, crossing, direction, joined, lengths, middle, points_at, prolonged

_MOST_CUT = 0.5
"""Largest share of a road that may be cut off at one end."""

End = tuple[int, bool]
"""A bundle, and whether its end (True) or its start is meant."""


class Edge(NamedTuple):
    """Where a border passes a line across the road: distance to the left of its origin [m], and tangent of its angle to it."""

    t: float
    slope: float


class Mouth(NamedTuple):
    """The end of a road: the line across it, and where its borders pass, from left to right."""

    frame: Frame
    edges: tuple[Edge, ...]


class Borders:
    """The borders of bundles as lines, from left to right."""

    def __init__(self, graph: Graph, layout: Layout) -> None:
        self.graph, self.layout = graph, layout

    def own(self, number: int) -> list[Points]:
        """The borders of a bundle as its lanelets have them."""
        lanelets = self.graph.lanelets
        lanes = self.layout.bundles[number].lanes
        return [joined([lanelets[name].left for name in lanes[0]])] + [
            joined([lanelets[name].right for name in lane]) for lane in lanes
        ]

    def extended(self, number: int) -> list[Points]:
        """The same with those of the lanelets before and after, and straight pieces beyond."""
        lanes = self.layout.bundles[number].lanes
        before = [next(iter(self.graph.before[lane[0]]), None) for lane in lanes]
        after = [next(iter(self.graph.after[lane[-1]]), None) for lane in lanes]
        lines = []
        for index, line in enumerate(self.own(number)):
            lane = max(index - 1, 0)
            parts = [self._side(before[lane], index), line, self._side(after[lane], index)]
            lines.append(prolonged(joined([part for part in parts if part is not None])))
        return lines

    def middle(self, number: int) -> Points:
        """The line half-way between the outer borders of a bundle."""
        own = self.own(number)
        return middle(own[0], own[-1])

    def _side(self, name: str | None, index: int) -> Points | None:
        if name is None:
            return None
        lanelet = self.graph.lanelets[name]
        return lanelet.right if index else lanelet.left


def mouths(borders: Borders) -> dict[End, Mouth]:
    """Both ends of every bundle."""
    layout = borders.layout
    found: dict[End, Mouth] = {}
    for joint in layout.joints:
        owner = _owner(layout, joint)
        frame = _meeting(borders, joint) if owner is None else _cut(borders, owner)
        edges = _lane_edges(borders, owner, frame) if owner else {}
        links = [*joint.lanes, *((after, before) for before, after in joint.lanes)]
        for end in [*((number, True) for number in joint.ending), *((number, False) for number in joint.beginning)]:
            partner = (
                {lane: edges[other] for lane, other in links if lane[0] == end[0] and other in edges} if end != owner else edges
            )
            found[end] = Mouth(frame, tuple(_edges(borders, end, frame, partner)))
    for number in range(len(layout.bundles)):
        for end in ((number, False), (number, True)):
            if end not in found:
                frame = _free(borders, end)
                found[end] = Mouth(frame, tuple(_edges(borders, end, frame, {})))
    return found


def _owner(layout: Layout, joint: Joint) -> End | None:
    alone = [(side[0], at_end) for side, at_end in ((joint.ending, True), (joint.beginning, False)) if len(side) == 1]
    return min(alone, key=lambda end: layout.bundles[end[0]].inside, default=None)


def _across(borders: Borders, end: End) -> Frame:
    """The line across the middle of a bundle's end."""
    line = borders.middle(end[0])
    x, y = line[-1 if end[1] else 0]
    return Frame(float(x), float(y), direction(line, end[1]))


def _corners(borders: Borders, end: End, frame: Frame) -> Points:
    """How far ahead of a line across its end the borders of a bundle end (begin), m."""
    return frame.local(np.array([border[-1 if end[1] else 0] for border in borders.own(end[0])]))[:, 0]


def _free(borders: Borders, end: End) -> Frame:
    """The line across a bundle's end that no border passes: nothing of a lanelet is lost where no other road goes on."""
    frame = _across(borders, end)
    corners = _corners(borders, end, frame)
    x, y = frame.world(float(corners.max() if end[1] else corners.min()), 0.0)
    return Frame(x, y, frame.heading)


def _cut(borders: Borders, end: End) -> Frame:
    """The line across a bundle near its end, up to which all its lanes reach."""
    line = borders.middle(end[0])
    corners = _corners(borders, end, _across(borders, end))
    shift = max(-corners.min(), 0.0) if end[1] else max(corners.max(), 0.0)
    total = lengths(line)[-1]
    shift = min(shift, _MOST_CUT * total)
    rest = points_at(line, np.linspace(0.0, total - shift, 65) if end[1] else np.linspace(shift, total, 65))
    x, y = rest[-1 if end[1] else 0]
    return Frame(float(x), float(y), direction(rest, end[1]))


def _meeting(borders: Borders, joint: Joint) -> Frame:
    """The line half-way between all that end and all that begin."""
    ends = [*((number, True) for number in joint.ending), *((number, False) for number in joint.beginning)]
    frames = [_across(borders, end) for end in ends]
    x, y = np.mean([(frame.x, frame.y) for frame in frames], axis=0)
    heading = math.atan2(sum(math.sin(frame.heading) for frame in frames), sum(math.cos(frame.heading) for frame in frames))
    return Frame(float(x), float(y), heading)


_Lane = tuple[int, int]


def _lane_edges(borders: Borders, end: End, frame: Frame) -> dict[_Lane, tuple[Edge, Edge]]:
    """The left and right edges of each lane of the owner."""
    edges = [_edge(line, frame, end[1]) for line in borders.own(end[0])]
    return {(end[0], lane): (edges[lane], edges[lane + 1]) for lane in range(len(edges) - 1)}


def _edges(borders: Borders, end: End, frame: Frame, known: dict[_Lane, tuple[Edge, Edge]]) -> list[Edge]:
    """The edges of a bundle on a line across it: those of the lanes that it continues where they are known."""
    found = []
    lines = borders.own(end[0])
    for index, line in enumerate(lines):
        sides = [(known.get((end[0], index - 1)), 1), (known.get((end[0], index)), 0)]
        edges = [pair[side] for pair, side in sides if pair]
        found.append(Edge(*np.mean(edges, axis=0).tolist()) if edges else _edge(line, frame, end[1]))
    return found


def _edge(line: Points, frame: Frame, at_end: bool) -> Edge:
    """Where a border passes, its slope taken from the road's side of the line."""
    longer = prolonged(line)
    s, t = crossing(longer, frame)
    total = lengths(longer)[-1]
    rest = points_at(longer, np.linspace(0.0, s, 257) if at_end else np.linspace(s, total, 257))
    return Edge(t, math.tan(direction(rest, at_end) - frame.heading))
