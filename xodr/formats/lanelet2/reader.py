"""Lanelets of a Lanelet2 file, in metres, with the meaning of its tags and regulatory elements.

Source: Poggenhans et al., "Lanelet2: A High-Definition Map Framework for the Future of Automated
Driving", ITSC 2018; Lanelet2 documentation, "LaneletAndAreaTagging", "LinestringTagging" and
"RegulatoryElementTagging"; limits where a map gives none: its German traffic rules."""

from __future__ import annotations

import math
import re
from collections import defaultdict
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from schemas.common.array_types import FloatArray
from schemas.common.errors import InvalidFile
from schemas.common.terminal.text import shown
from xodr.builders.elements import Geo
from xodr.formats.lanelet2.borders import LaneletBounds, bounds_of, linked, split_at_joints
from xodr.formats.lanelet2.lanelet import WALKS, Lanelet, Points
from xodr.formats.lanelet2.osm import MapProjection, Osm, Relation, Tags, read
from xodr.formats.lanelet2.signs import (
    Place,
    face_lines,
    facing,
    poles_of,
    signs_of,
    stop_lines_of,
)
from xodr.formats.maps.lane_map import LANE_TYPES, ROAD_TYPES, MapPole, MapSignal

CROSSWALK = "crosswalk"


class LaneletKind(NamedTuple):
    """OpenDRIVE type of a lanelet. type: lane type, or `CROSSWALK` for an object on the road."""

    type: str
    road_type: str
    speed_limit: float


_SUBTYPES = {
    "road": "driving",
    "highway": "driving",
    "play_street": "driving",
    "bus_lane": "bus",
    "emergency_lane": "stop",
    "exit": "exit",
    "bicycle_lane": "biking",
    "bikelane": "biking",  # TAF-BW
    "walkway": "sidewalk",
    "shared_walkway": "sidewalk",
    "stairs": "sidewalk",
    "crosswalk": CROSSWALK,
    "rail": "rail",
}
_ROAD_TYPES = {"highway": "motorway", "play_street": "lowSpeed"}
_LIMITS = {"motorway": math.inf, "rural": 100 / 3.6, "town": 50 / 3.6, "lowSpeed": 7 / 3.6}
_TYPE_LIMITS = {"sidewalk": 10 / 3.6, CROSSWALK: 10 / 3.6, "biking": 30 / 3.6}

_SPEED = re.compile(r"(\d+(?:\.\d*)?|\.\d+)\s*(km/h|kmh|kph|mph|m/s|mps)?", re.IGNORECASE)
_UNITS = {"mph": 0.44704, "m/s": 1.0, "mps": 1.0}
_SPEED_TAGS = ("speed_limit", "maxspeed")

_MARKS = {
    ("line_thin", "dashed"): "broken", ("line_thick", "dashed"): "broken",
    ("line_thin", "solid_solid"): "solid solid", ("line_thick", "solid_solid"): "solid solid",
    ("line_thin", "solid_dashed"): "solid broken", ("line_thick", "solid_dashed"): "solid broken",
    ("line_thin", "dashed_solid"): "broken solid", ("line_thick", "dashed_solid"): "broken solid",
}  # fmt: skip
_LINES = {"line_thin": "solid", "line_thick": "solid", "curbstone": "curb", "road_border": "curb"}


def kind_of(relation: Relation) -> LaneletKind | None:
    """Return the OpenDRIVE type of a lanelet, or of an area that was a lane; None if its subtype is
    unknown. Lanelets without a subtype are roads. The tags `lane_type` and `road_type` of maps that
    were OpenDRIVE say more than the subtype."""
    tags = relation.tags
    subtype = tags.get("subtype") or "road"
    own = tags.get("lane_type", "")
    area = tags.get("type") == "multipolygon"
    # Of an area the subtype says too little: `keepout` was a border or a restricted lane.
    lane_type = own if area and own in LANE_TYPES else _SUBTYPES.get(subtype)
    if lane_type is None:
        return None
    usual = "rural" if tags.get("location") == "nonurban" else "town"
    road_type = _ROAD_TYPES.get(subtype, usual)
    limit = speed_limit(relation)
    if limit is None:
        limit = math.inf if area else _TYPE_LIMITS.get(lane_type, _LIMITS[road_type])
    # The tags of this project's own writer say more than Lanelet2's subtypes.
    if lane_type != CROSSWALK and own in LANE_TYPES:
        lane_type = own
    if tags.get("road_type", "") in ROAD_TYPES:
        road_type = tags["road_type"]
    return LaneletKind(lane_type, road_type, limit)


def is_strip(relation: Relation) -> bool:
    """Whether a relation is an area that was a lane without traffic.

    Its first two ways are its borders.
    """
    tags = relation.tags
    return (
        tags.get("type") == "multipolygon"
        and tags.get("lane_type", "") in LANE_TYPES
        and len(relation.refs("outer", "way")) >= 2
    )


def _sided(relation: Relation) -> Relation:
    """An area that was a lane with its first two ways as its left and its right bound."""
    ways = [member for member in relation.members if member.role == "outer"]
    sides = (ways[0]._replace(role="left"), ways[1]._replace(role="right"))
    return replace(relation, members=sides)


def speed_limit(relation: Relation) -> float | None:
    """The limit [m/s] that a relation's own tags give, None where they do not.

    Raises:
        InvalidFile: it is no speed.
    """
    for name in _SPEED_TAGS:
        text = relation.tags.get(name)
        if text is not None:
            return speed(relation, name, text)
    return None


def speed(relation: Relation, name: str, text: str) -> float:
    """A speed in m/s from a text like "50", "50 km/h" or "30 mph".

    Raises:
        InvalidFile: it is none, or not positive.
    """
    # A number without a unit is in km/h, as in OpenStreetMap.
    match = _SPEED.fullmatch(text)
    value = float(match[1]) * _UNITS.get((match[2] or "").lower(), 1 / 3.6) if match else 0.0
    # A limit of 0 would stop all traffic: it is a slip rather than a rule.
    if not 0.0 < value < math.inf:
        raise relation.invalid(f"{name}={text!r} is no speed limit such as '50' or '50 km/h'")
    return value


def mark_of(tags: Tags) -> str:
    """The road mark that a bound is."""
    kind = tags.get("type", "")
    return _MARKS.get((kind, tags.get("subtype", ""))) or _LINES.get(kind, "none")


class Regulations(NamedTuple):
    """Properties of lanelets from regulatory elements.

    limits: speed limits [m/s]. lights: ids of traffic lights. priorities: pairs of which the first
    goes before the second. left_out: ids of the relations that say nothing of this, by type and
    subtype. users: lanelets by the elements that they refer to.
    """

    users: dict[str, list[str]]
    limits: dict[str, float]
    lights: dict[str, tuple[str, ...]]
    priorities: list[tuple[str, str]]
    left_out: dict[str, list[str]]


def regulations(osm: Osm) -> Regulations:
    """Read the regulatory elements of a map; also return the relations that are neither these nor
    lanelets.

    Raises:
        InvalidFile: a speed limit is no speed.
    """
    users: dict[str, list[str]] = defaultdict(list)
    found = Regulations(users, {}, {}, [], defaultdict(list))
    for relation in osm.relations.values():
        # First all references: an element says nothing of who refers to it.
        for ref in relation.refs("regulatory_element", "relation"):
            users[ref].append(relation.id)
    for relation in osm.relations.values():
        kind, subtype = (
            relation.tags.get("type", "relation without a type"),
            relation.tags.get("subtype", ""),
        )
        if (
            kind != "lanelet"
            and not is_strip(relation)
            and not (
                kind == "regulatory_element" and _read(found, relation, subtype, users[relation.id])
            )
        ):
            found.left_out[f"{kind} {subtype}".strip()].append(relation.id)
    return found


def _read(found: Regulations, rule: Relation, subtype: str, lanelets: list[str]) -> bool:
    """Put down the rules of an element for lanelets that refer to it; False if there is none."""
    if subtype == "speed_limit":
        limit = _limit(rule)
        if limit is not None:
            # Of several limits the lowest holds.
            found.limits.update(
                {name: min(limit, found.limits.get(name, limit)) for name in lanelets}
            )
        # Without a limit it is listed among what is left out.
        return limit is not None
    # Read by `signs_of`, if there is anything to read.
    if subtype == "traffic_sign":
        return bool(rule.refs("refers", "way"))
    if subtype == "traffic_light":
        found.lights.update({name: (*found.lights.get(name, ()), rule.id) for name in lanelets})
        return bool(lanelets)
    if subtype == "right_of_way":
        first, waiting = (rule.refs(role, "relation") for role in ("right_of_way", "yield"))
        found.priorities.extend((high, low) for high in first for low in waiting)
        return bool(first and waiting)
    return False


def _limit(rule: Relation) -> float | None:
    """The limit of a regulatory element "speed_limit": its own, or the number of
    a German sign 274.
    """
    own = speed_limit(rule)
    sign = rule.tags.get("sign_type")
    if own is not None or sign is None:
        return own
    return speed(rule, "sign_type", sign.removeprefix("de274-"))


class Crosswalk(NamedTuple):
    """A crosswalk: its outline, (n, 2), m."""

    id: str
    outline: Points


class Lanelets(NamedTuple):
    """Contents of a map.

    lanes: lanelets that are lanes, with successors and right neighbours. crosswalks: those that are
    not. priorities: pairs of lanelets of which the first goes before the second. geo: where the map
    is. surveyed: left and right bound with heights, (n, 3) each, by id in the file; none of a flat
    map. signs: with the ids of lanelets in the file. faces: place and heading of traffic lights
    that have one. stop_lines: name and points, (n, 3), m. poles: beside the lanes. notes: what is
    left out or assumed, one sentence each.
    """

    lanes: list[Lanelet]
    crosswalks: list[Crosswalk]
    priorities: list[tuple[str, str]]
    geo: Geo | None
    surveyed: dict[str, tuple[FloatArray, FloatArray]]
    signs: list[MapSignal]
    faces: dict[str, tuple[Place, float]]
    stop_lines: list[tuple[str, FloatArray]]
    poles: list[MapPole]
    notes: list[str]


def read_lanelets(path: Path, origin: tuple[float, float] | None) -> Lanelets:
    """Read a map.

    Args:
        origin: latitude and longitude of the origin of the coordinates, see `MapProjection`.

    Raises:
        InvalidFile: malformed, without lanelets, or with a lanelet that has no bounds; names file,
            line and element.
        UsageError: the origin is no place on Earth.
    """
    osm = read(path)
    try:
        return _lanelets(osm, MapProjection(osm, origin))
    except InvalidFile as error:
        error.path = error.path or str(path)
        raise


def _lanelets(osm: Osm, projection: MapProjection) -> Lanelets:
    relations = [
        _sided(relation) if is_strip(relation) else relation
        for relation in osm.relations.values()
        if relation.tags.get("type") == "lanelet" or is_strip(relation)
    ]
    if not relations:
        raise InvalidFile("there is no lanelet in this map", line=1, element="osm")
    points, rules = projection.points(osm), regulations(osm)
    lanes: list[Lanelet] = []
    bounds: list[LaneletBounds] = []
    crosswalks: list[Crosswalk] = []
    for relation in relations:
        edges, kind = bounds_of(osm, relation, points), kind_of(relation)
        if kind is not None and kind.type == CROSSWALK:
            crosswalks.append(
                Crosswalk(relation.id, np.concatenate([edges.left, edges.right[::-1]]))
            )
        elif kind is not None:
            lanes.append(_lane(relation, kind, edges, rules))
            bounds.append(edges)
    if not lanes:
        raise InvalidFile("no lanelet of this map is a lane", line=1, element="osm")
    joined = [
        relation.id
        for relation in relations
        if any(len(relation.refs(side, "way")) > 1 for side in ("left", "right"))
    ]
    # The ids of the file, before lanelets are split: heights are looked up by them.
    drawn = [lane.id for lane in lanes]
    directed = {relation.id for relation in relations if relation.tags.get("lane_type") in WALKS}
    lanes, splits = split_at_joints(linked(lanes, bounds, directed), bounds, joined)
    notes = (
        [f"left out, since the map does not have them: {', '.join(osm.absent)}"]
        if osm.absent
        else []
    )
    notes += _notes(relations, rules)
    if joined:
        notes += [
            (
                "bounds of several ways are joined, with the marks of the first: lanelets "
                f"{' '.join(joined)}"
            ),
            *splits,
        ]
    surveyed = {}
    # A map without heights says so by zeros.
    if any(node.height for node in osm.nodes.values()):
        for lane, edges in zip(drawn, bounds, strict=True):
            left, right = (
                np.array([(*points[node], osm.nodes[node].height) for node in line])
                for line in edges.nodes
            )
            surveyed[lane] = left, right
    faces = {
        light: facing(lines[0][0])
        for light in {light for lights in rules.lights.values() for light in lights}
        if (lines := face_lines(osm, osm.relations[light], points))
    }
    signs = signs_of(osm, points, rules.users)
    return Lanelets(
        lanes, crosswalks, rules.priorities, projection.geo, surveyed, signs, faces,
        list(stop_lines_of(osm, points)), list(poles_of(osm, points)), notes,
    )  # fmt: skip


def _lane(
    relation: Relation, kind: LaneletKind, bounds: LaneletBounds, rules: Regulations
) -> Lanelet:
    # A lanelet's own tag goes before the regulatory elements that it refers to.
    limit = rules.limits.get(relation.id) if speed_limit(relation) is None else None
    left, right = (mark_of(way.tags) for way in bounds.ways)
    return Lanelet(
        relation.id, bounds.left, bounds.right, type=kind.type, road_type=kind.road_type,
        speed_limit=kind.speed_limit if limit is None else limit, left_mark=left, right_mark=right,
        lights=rules.lights.get(relation.id, ()),
    )  # fmt: skip


def _notes(relations: list[Relation], rules: Regulations) -> list[str]:
    notes = [
        f"left out, {kind}: {' '.join(names)}" for kind, names in sorted(rules.left_out.items())
    ]
    assumed = []
    for relation in relations:
        kind = kind_of(relation)
        if kind is None:
            notes.append(
                f"lanelet {relation.id} is left out: its subtype {relation.tags['subtype']!r} has "
                "no lane type"
            )
        elif kind.type not in (*WALKS, CROSSWALK) and not is_strip(relation):
            if relation.tags.get("one_way") == "no":
                notes.append(
                    f"lanelet {relation.id} may be driven both ways; its lane leads one way"
                )
            if speed_limit(relation) is None and relation.id not in rules.limits:
                assumed.append(relation.id)
    if assumed:
        notes.append(
            "speed limits are the usual ones, since the map gives none: lanelets "
            f"{' '.join(shown(assumed))}"
        )
    return notes
