"""Lanelets of a Lanelet2 file, in metres.

Source: Poggenhans et al., "Lanelet2: A High-Definition Map Framework for the Future of Automated Driving", ITSC 2018.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from schemas.errors import InvalidFile
from xodr.builders.elements import Geo
from xodr.lanelet2.lanelet import Lanelet, Points
from xodr.lanelet2.lines.bounds import Bounds, bounds_of, linked
from xodr.lanelet2.lines.joints import split_at_joints
from xodr.lanelet2.reading.osm import Osm, Relation, read
from xodr.lanelet2.reading.projection import Projection
from xodr.lanelet2.reading.regulations import Regulations, regulations
from xodr.lanelet2.reading.tags import CROSSWALK, Kind, kind_of, mark_of, speed_limit


class Area(NamedTuple):
    """A crosswalk: its outline, (n, 2), m."""

    id: str
    outline: Points


class Lanelets(NamedTuple):
    """What a map has.

    lanes: lanelets that are lanes, with successors and right neighbours. crosswalks: those that are not. priorities: pairs of
    lanelets of which the first goes before the second. geo: where the map is. notes: what is left out or assumed, one sentence
    each.
    """

    lanes: list[Lanelet]
    crosswalks: list[Area]
    priorities: list[tuple[str, str]]
    geo: Geo | None
    notes: list[str]


def read_lanelets(path: Path, origin: tuple[float, float] | None) -> Lanelets:
    """Read a map.

    Args:
        origin: latitude and longitude of the origin of the coordinates, see `Projection`.

    Raises:
        InvalidFile: malformed, without lanelets, or with a lanelet that has no bounds; names file, line and element.
        UsageError: the origin is no place on Earth.
    """
    osm = read(path)
    try:
        return _lanelets(osm, Projection(osm, origin))
    except InvalidFile as error:
        error.path = error.path or str(path)
        raise


def _lanelets(osm: Osm, projection: Projection) -> Lanelets:
    relations = [relation for relation in osm.relations.values() if relation.tags.get("type") == "lanelet"]
    if not relations:
        raise InvalidFile("there is no lanelet in this map", line=1, element="osm")
    points, rules = projection.points(osm), regulations(osm)
    lanes: list[Lanelet] = []
    bounds: list[Bounds] = []
    crosswalks: list[Area] = []
    for relation in relations:
        edges, kind = bounds_of(osm, relation, points), kind_of(relation)
        if kind is not None and kind.type == CROSSWALK:
            crosswalks.append(Area(relation.id, np.concatenate([edges.left, edges.right[::-1]])))
        elif kind is not None:
            lanes.append(_lane(relation, kind, edges, rules))
            bounds.append(edges)
    if not lanes:
        raise InvalidFile("no lanelet of this map is a lane", line=1, element="osm")
    joined = [relation.id for relation in relations if any(len(relation.refs(side, "way")) > 1 for side in ("left", "right"))]
    lanes, splits = split_at_joints(linked(lanes, bounds), bounds, joined)
    notes = [f"left out, since the map does not have them: {', '.join(osm.absent)}"] if osm.absent else []
    notes += _notes(relations, rules)
    if joined:
        notes += [f"bounds of several ways are joined, with the marks of the first: lanelets {' '.join(joined)}", *splits]
    return Lanelets(lanes, crosswalks, rules.priorities, projection.geo, notes)


def _lane(relation: Relation, kind: Kind, bounds: Bounds, rules: Regulations) -> Lanelet:
    limit = rules.limits.get(relation.id) if speed_limit(relation) is None else None
    left, right = (mark_of(way.tags) for way in bounds.ways)
    return Lanelet(
        relation.id, bounds.left, bounds.right, type=kind.type, road_type=kind.road_type,
        speed_limit=kind.speed_limit if limit is None else limit, left_mark=left, right_mark=right,
        lights=rules.lights.get(relation.id, ()),
    )  # fmt: skip


def _notes(relations: list[Relation], rules: Regulations) -> list[str]:
    notes = [f"left out, {kind}: {' '.join(names)}" for kind, names in sorted(rules.left_out.items())]
    assumed = []
    for relation in relations:
        kind = kind_of(relation)
        if kind is None:
            notes.append(f"lanelet {relation.id} is left out: its subtype {relation.tags['subtype']!r} has no lane type")
        elif kind.type not in ("sidewalk", CROSSWALK):
            if relation.tags.get("one_way") == "no":
                notes.append(f"lanelet {relation.id} may be driven both ways; its lane leads one way")
            if speed_limit(relation) is None and relation.id not in rules.limits:
                assumed.append(relation.id)
    if assumed:
        notes.append(f"speed limits are the usual ones, since the map gives none: lanelets {' '.join(assumed)}")
    return notes
