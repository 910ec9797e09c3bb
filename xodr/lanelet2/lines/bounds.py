"""The bounds of lanelets of a Lanelet2 map, and which lanelets share them.

As in Lanelet2, left and right decide the direction of travel, lanelets follow each other where their bounds share end points,
and are neighbours where they share a bound.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, replace

import numpy as np

from xodr.lanelet2.lanelet import Lanelet, Neighbour, Points
from xodr.lanelet2.lines.polylines import lengths
from xodr.lanelet2.reading.osm import Osm, Relation, Way

TOUCHING = 0.1
"""Points that are not farther apart than this are one, m."""


@dataclass(frozen=True, eq=False)
class Bounds:
    """The bounds of a lanelet, turned to its direction of travel: ways, ids of nodes, and points."""

    ways: tuple[Way, Way]
    nodes: tuple[tuple[str, ...], tuple[str, ...]]
    left: Points
    right: Points


def bounds_of(osm: Osm, relation: Relation, points: dict[str, tuple[float, float]]) -> Bounds:
    """The bounds of a lanelet; points: x and y of each node.

    Raises:
        InvalidFile: it does not have one way on each side, or several that make one line, with two nodes or more.
    """
    left, right = _bound(osm, relation, "left"), _bound(osm, relation, "right")
    nodes = [left.nodes, right.nodes]
    lines = [np.array([points[node] for node in way]) for way in nodes]
    for role, line in (("left", lines[0]), ("right", lines[1])):
        if not lengths(line)[-1] > TOUCHING:
            raise relation.invalid(f"its {role} bound has no length")
    starts, ends = lines[0][[0, -1]], lines[1][[0, -1]]
    if np.hypot(*(starts - ends).T).sum() > np.hypot(*(starts - ends[::-1]).T).sum():
        nodes[1], lines[1] = nodes[1][::-1], lines[1][::-1]
    x, y = np.concatenate([lines[0], lines[1][::-1]]).T
    if np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) > 0.0:  # counterclockwise: seen that way, left would be on the right
        nodes, lines = [way[::-1] for way in nodes], [line[::-1] for line in lines]
    return Bounds((left, right), (nodes[0], nodes[1]), lines[0], lines[1])


def _bound(osm: Osm, relation: Relation, role: str) -> Way:
    ways = [osm.ways[ref] for ref in relation.refs(role, "way")]
    if not ways:
        raise relation.invalid(f"a lanelet has one way as its {role} bound, this one has none")
    short = next((way for way in ways if len(way.nodes) < 2), None)
    if short is not None:
        raise relation.invalid(f"its {role} bound, way {short.id}, has {len(short.nodes)} nodes, two or more are needed")
    line = _joined([way.nodes for way in ways])
    if line is None:
        raise relation.invalid(f"its {role} bound, ways {' '.join(way.id for way in ways)}, is not one line")
    return Way(ways[0].id, line, ways[0].tags)


def _joined(lines: list[tuple[str, ...]]) -> tuple[str, ...] | None:
    """One line of lines (nodes), in any order and direction, that share end nodes; None where they make no line."""
    whole, *others = lines
    while others:
        ends = {whole[0], whole[-1]}
        following = next((line for line in others if ends & {line[0], line[-1]}), None)
        if following is None:
            return None
        others.remove(following)
        if whole[-1] not in (following[0], following[-1]):
            whole = whole[::-1]
        whole += following[1:] if following[0] == whole[-1] else following[-2::-1]
    return whole


def linked(lanes: list[Lanelet], bounds: list[Bounds]) -> list[Lanelet]:
    """The lanes with who follows them and who lies on their right. Sidewalks are walked both ways and stay alone."""
    from scipy.spatial import KDTree

    starts = np.array([[*edges.left[0], *edges.right[0]] for edges in bounds])
    ends = np.array([[*edges.left[-1], *edges.right[-1]] for edges in bounds])
    following = KDTree(starts).query_ball_point(ends, TOUCHING)
    beside = defaultdict(list)
    for lane, edges in zip(lanes, bounds, strict=True):
        if lane.type != "sidewalk":
            beside[edges.nodes[0]].append(lane.id)
    found = []
    for index, lane in enumerate(lanes):
        if lane.type == "sidewalk":
            found.append(lane)
            continue
        after = [lanes[other] for other in sorted(following[index]) if other != index]
        right = beside[bounds[index].nodes[1]]
        neighbour = Neighbour(right[0], True) if right else None
        found.append(replace(lane, successors=tuple(one.id for one in after if one.type != "sidewalk"), beside_right=neighbour))
    return found
