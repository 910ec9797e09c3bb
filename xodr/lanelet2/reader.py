"""Lanelets of a Lanelet2 file: bounds in metres, and who follows or lies beside whom.

Source: Poggenhans et al., "Lanelet2: A High-Definition Map Framework for the Future of Automated Driving", ITSC 2018. As
there, lanelets follow each other where their bounds share end points, and are neighbours where they share a bound.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from schemas.errors import InvalidFile
from xodr.lanelet2.lanelet import Lanelet, Neighbour, Points
from xodr.lanelet2.osm import Osm, Relation, Way, read
from xodr.lanelet2.polylines import lengths
from xodr.lanelet2.projection import Projection
from xodr.lanelet2.tags import CROSSWALK, Kind, kind_of, mark_of, speed, speed_limit

TOUCHING = 0.1
"""Bounds end where others begin if they are not farther apart than this, m."""


class Area(NamedTuple):
    """A crosswalk: its outline, (n, 2), m."""

    id: str
    outline: Points


class Lanelets(NamedTuple):
    """What a map has: lanes, crosswalks, and what of it is left out or assumed, one sentence each."""

    lanes: list[Lanelet]
    crosswalks: list[Area]
    notes: list[str]


@dataclass(frozen=True, eq=False)
class _Bounds:
    """The bounds of a lanelet, turned to its direction of travel: ways, nodes and points."""

    ways: tuple[Way, Way]
    nodes: tuple[tuple[str, ...], tuple[str, ...]]
    left: Points
    right: Points


def read_lanelets(path: Path, origin: tuple[float, float] | None) -> tuple[Lanelets, Projection]:
    """Read a map.

    Args:
        origin: latitude and longitude of the origin of the coordinates, see `Projection`.

    Raises:
        InvalidFile: malformed, without lanelets, or with a lanelet that has no bounds; names file, line and element.
    """
    osm = read(path)
    try:
        projection = Projection(osm, origin)
        return _lanelets(osm, projection), projection
    except InvalidFile as error:
        error.path = error.path or str(path)
        raise


def _lanelets(osm: Osm, projection: Projection) -> Lanelets:
    relations = [relation for relation in osm.relations.values() if relation.tags.get("type") == "lanelet"]
    if not relations:
        raise InvalidFile("there is no lanelet in this map", line=1, element="osm")
    points = projection.points(osm)
    notes = _left_out(osm)
    limits = _regulated(osm)
    lanes: list[Lanelet] = []
    bounds: list[_Bounds] = []
    crosswalks: list[Area] = []
    assumed: list[str] = []
    for relation in relations:
        edges, kind = _bounds(osm, relation, points), kind_of(relation)
        if kind is None:
            notes.append(f"lanelet {relation.id} is left out: its subtype {relation.tags['subtype']!r} has no lane type")
        elif kind.type == CROSSWALK:
            crosswalks.append(Area(relation.id, np.concatenate([edges.left, edges.right[::-1]])))
        else:
            lanes.append(_lane(relation, kind, edges, limits))
            bounds.append(edges)
            if speed_limit(relation) is None and relation.id not in limits:
                assumed.append(relation.id)
            if relation.tags.get("one_way") == "no" and kind.type != "sidewalk":
                notes.append(f"lanelet {relation.id} may be driven both ways; its lane leads one way")
    if not lanes:
        raise InvalidFile("no lanelet of this map is a lane", line=1, element="osm")
    if assumed:
        notes.append(f"speed limits are the usual ones, since the map gives none: lanelets {' '.join(assumed)}")
    return Lanelets(_linked(lanes, bounds), crosswalks, notes)


def _bounds(osm: Osm, relation: Relation, points: dict[str, tuple[float, float]]) -> _Bounds:
    left, right = _bound(osm, relation, "left"), _bound(osm, relation, "right")
    nodes = [left.nodes, right.nodes]
    lines = [np.array([points[node] for node in way]) for way in nodes]
    starts, ends = lines[0][[0, -1]], lines[1][[0, -1]]
    if np.hypot(*(starts - ends).T).sum() > np.hypot(*(starts - ends[::-1]).T).sum():
        nodes[1], lines[1] = nodes[1][::-1], lines[1][::-1]
    x, y = np.concatenate([lines[0], lines[1][::-1]]).T
    if np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) > 0.0:  # counterclockwise: seen that way, left would be on the right
        nodes, lines = [way[::-1] for way in nodes], [line[::-1] for line in lines]
    return _Bounds((left, right), (nodes[0], nodes[1]), lines[0], lines[1])


def _bound(osm: Osm, relation: Relation, role: str) -> Way:
    refs = relation.refs(role, "way")
    if len(refs) != 1:
        raise relation.invalid(f"a lanelet has one way as its {role} bound, not {len(refs)}")
    way = osm.ways[refs[0]]
    if len(way.nodes) < 2:
        raise relation.invalid(f"its {role} bound, way {way.id}, has {len(way.nodes)} nodes, two or more are needed")
    return way


def _lane(relation: Relation, kind: Kind, bounds: _Bounds, limits: dict[str, float]) -> Lanelet:
    for role, line in (("left", bounds.left), ("right", bounds.right)):
        if not lengths(line)[-1] > TOUCHING:
            raise relation.invalid(f"its {role} bound has no length")
    limit = limits.get(relation.id) if speed_limit(relation) is None else None
    left, right = (mark_of(way.tags) for way in bounds.ways)
    return Lanelet(
        relation.id, bounds.left, bounds.right, type=kind.type, road_type=kind.road_type,
        speed_limit=kind.speed_limit if limit is None else limit, left_mark=left, right_mark=right,
    )  # fmt: skip


def _linked(lanes: list[Lanelet], bounds: list[_Bounds]) -> list[Lanelet]:
    """The lanes with who follows them and who lies beside them. Sidewalks are walked both ways and stay alone."""
    from scipy.spatial import KDTree

    starts = np.array([[*edges.left[0], *edges.right[0]] for edges in bounds])
    ends = np.array([[*edges.left[-1], *edges.right[-1]] for edges in bounds])
    following = KDTree(starts).query_ball_point(ends, TOUCHING)
    right_of: dict[tuple[str, ...], list[int]] = defaultdict(list)
    for index, edges in enumerate(bounds):
        if lanes[index].type != "sidewalk":
            right_of[edges.nodes[0]].append(index)
    found = []
    for index, lane in enumerate(lanes):
        if lane.type == "sidewalk":
            found.append(lane)
            continue
        after = [lanes[other] for other in sorted(following[index]) if other != index]
        beside = right_of[bounds[index].nodes[1]]
        found.append(
            replace(
                lane,
                successors=tuple(other.id for other in after if other.type != "sidewalk"),
                beside_right=Neighbour(lanes[beside[0]].id, True) if beside else None,
            )
        )
    return found


# regulatory elements ---------------------------------------------------------------------------------


def _regulated(osm: Osm) -> dict[str, float]:
    """Speed limits that lanelets have from regulatory elements."""
    found: dict[str, float] = {}
    for relation in osm.relations.values():
        for ref in relation.refs("regulatory_element", "relation"):
            rule = osm.relations[ref]
            limit = _limit(rule)
            if limit is not None:
                found[relation.id] = min(limit, found.get(relation.id, limit))
    return found


def _limit(rule: Relation) -> float | None:
    """The limit of a regulatory element "speed_limit": its own, or the number of a German sign 274."""
    if rule.tags.get("subtype") != "speed_limit":
        return None
    own = speed_limit(rule)
    sign = rule.tags.get("sign_type")
    if own is not None or sign is None:
        return own
    return speed(rule, "sign_type", sign.removeprefix("de274-"))


def _left_out(osm: Osm) -> list[str]:
    """What a map has beside lanelets that does not become part of the road network."""
    found: dict[str, list[str]] = defaultdict(list)
    for relation in osm.relations.values():
        kind = relation.tags.get("type", "without a type")
        if kind == "lanelet" or _limit(relation) is not None:
            continue
        subtype = relation.tags.get("subtype")
        found[f"{kind} {subtype}" if subtype else kind].append(relation.id)
    return [f"left out, {kind}: {' '.join(names)}" for kind, names in sorted(found.items())]
