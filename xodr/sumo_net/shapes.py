"""Polylines of lanes and outlines of junctions for the SUMO network."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise

from xodr.model import Lane
from xodr.road import Road

Point = tuple[float, float]

CHORD_ERROR = 0.005
"""Largest distance between a lane's centre line and its polyline, in m."""
_LONGEST = 100.0
"""Longest stretch that is judged by five of its points, in m."""
_DEEPEST, _MOST_STRETCHES, _MOST_POINTS = 14, 1_000, 20_000
"""Limits that keep absurd roads from filling the memory; beyond them the polyline is coarser."""


def centre_line(road: Road, lane: Lane, start: float, end: float) -> list[Point]:
    """The lane's centre line from s = start to s = end (either way round) as a polyline."""

    def at(s: float) -> Point:
        pose = road.pose(s, lane.center(s))
        return pose.x, pose.y

    low, high = min(start, end), max(start, end)
    breaks = sorted({low, high, *(s for s in (*road.line.starts, *lane.center.starts) if low < s < high)}, reverse=start > end)
    points = [at(start)]
    for here, there in pairwise(breaks):
        pieces = min(max(1, math.ceil(abs(there - here) / _LONGEST)), _MOST_STRETCHES)
        for number in range(pieces):
            first, last = (here + (there - here) * share / pieces for share in (number, number + 1))
            _refine(at, first, points[-1], last, at(last), points)
    return _without_straight(points)


def _refine(
    at: Callable[[float], Point], start: float, first: Point, end: float, last: Point, points: list[Point], depth: int = 0
) -> None:
    """Append the points after `start` up to `end`, close enough together."""
    quarters = [start + (end - start) * share for share in (0.25, 0.5, 0.75)]
    inner = [at(s) for s in quarters]
    enough = depth >= _DEEPEST or len(points) >= _MOST_POINTS
    if enough or all(_aside(point, first, last) <= CHORD_ERROR for point in inner):
        points.append(last)
        return
    _refine(at, start, first, quarters[1], inner[1], points, depth + 1)
    _refine(at, quarters[1], inner[1], end, last, points, depth + 1)


def _without_straight(points: list[Point]) -> list[Point]:
    """Leave out points between two others on one straight line."""
    kept = points[:1]
    for index in range(1, len(points) - 1):
        if _aside(points[index], kept[-1], points[index + 1]) > 1e-6:
            kept.append(points[index])
    kept.append(points[-1])
    return kept


def _aside(point: Point, first: Point, last: Point) -> float:
    """Distance of a point from the segment between two others."""
    dx, dy = last[0] - first[0], last[1] - first[1]
    length = math.hypot(dx, dy)
    if length < 1e-9:
        return math.dist(point, first)
    return abs((point[0] - first[0]) * dy - (point[1] - first[1]) * dx) / length


def mouth(road: Road, s: float) -> tuple[Point, Point]:
    """The road's right and left edge at s."""
    right, left = (road.pose(s, t) for t in road.edges(s))
    return (right.x, right.y), (left.x, left.y)


def middle(points: Sequence[Point]) -> Point:
    """The mean of some points."""
    return sum(point[0] for point in points) / len(points), sum(point[1] for point in points) / len(points)


def outline(corners: Sequence[Point]) -> list[Point]:
    """A polygon through the corners in counterclockwise order around their middle."""
    x, y = middle(corners)
    return sorted(corners, key=lambda point: math.atan2(point[1] - y, point[0] - x))


def text(points: Iterable[Point]) -> str:
    """A polyline as SUMO writes it, to the tenth of a millimetre."""
    return " ".join(f"{x:.4f},{y:.4f}" for x, y in points)
