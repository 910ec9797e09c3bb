"""OSM files of Lanelet2 maps: nodes, ways, relations, and the projection of their coordinates to
metres.

As in Lanelet2 and INTERACTION, x and y are those of the UTM zone of an origin, minus those of the
origin itself. Maps whose nodes have the tags local_x and local_y bring their coordinates along."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple, TypeVar

from lxml import etree

from schemas.common.errors import InvalidFile, UsageError
from schemas.common.xml import line_of, parse
from xodr.builders.elements import Geo

Tags = dict[str, str]
T = TypeVar("T")


class OsmNode(NamedTuple):
    """A point: latitude and longitude [degrees], coordinates of the map [m] where it has its own,
    height [m]; its line in the file; its tags where it is something of its own."""

    place: tuple[float, float] | None
    local: tuple[float, float] | None
    height: float
    line: int | None
    tags: Tags


class OsmWay(NamedTuple):
    """A line through nodes."""

    id: str
    nodes: tuple[str, ...]
    tags: Tags


class Member(NamedTuple):
    """A part of a relation. type: "node", "way" or "relation"."""

    type: str
    ref: str
    role: str


@dataclass(frozen=True, eq=False)
class Relation:
    """A relation, with the element for complaints."""

    id: str
    members: tuple[Member, ...]
    tags: Tags
    element: etree._Element

    def refs(self, role: str, type: str) -> list[str]:
        """Return the references of the members of a role and type."""
        return [
            member.ref for member in self.members if member.role == role and member.type == type
        ]

    def invalid(self, message: str) -> InvalidFile:
        """An error about this relation."""
        return _invalid(self.element, message)


class Osm(NamedTuple):
    """The content of a file, by id. absent: members of relations that are not in the file, with the
    relation."""

    nodes: dict[str, OsmNode]
    ways: dict[str, OsmWay]
    relations: dict[str, Relation]
    absent: list[str]


def read(path: Path) -> Osm:
    """Read an OSM file; elements that an editor marked as deleted are left out.

    Raises:
        InvalidFile: missing, malformed, or not OSM; an id is used twice, refers to nothing, or a
            number is not finite.
    """
    root = parse(path).getroot()
    try:
        return _content(root)
    except InvalidFile as error:
        error.path = error.path or str(path)
        raise


def _content(root: etree._Element) -> Osm:
    if root.tag != "osm":
        raise _invalid(root, "the root element of a Lanelet2 map is osm")
    found = Osm({}, {}, {}, [])
    for element in root.iterchildren("node"):
        _put(found.nodes, element, _node(element))
    for element in root.iterchildren("way"):
        way = _way(element)
        _put(found.ways, element, way)
        for nd, ref in zip(element.iterchildren("nd"), way.nodes, strict=True):
            if ref not in found.nodes:
                raise _invalid(nd, f"there is no node {ref!r}")
    for element in root.iterchildren("relation"):
        _put(found.relations, element, _relation(element))
    for name, relation in found.relations.items():
        found.relations[name] = _with_present_members(found, relation)
    return found


def _put(table: dict[str, T], element: etree._Element, value: T) -> None:
    # JOSM keeps what was deleted in the file, marked so.
    if element.get("action") == "delete":
        return
    identity = _attribute(element, "id")
    if identity in table:
        raise _invalid(element, f"the id {identity!r} is used twice")
    table[identity] = value


def _node(element: etree._Element) -> OsmNode:
    tags = _tags(element)
    local = _pair(element, tags, "local_x", "local_y")
    place = _pair(element, {name: element.get(name, "") for name in ("lat", "lon")}, "lat", "lon")
    if place is None and local is None:
        raise _invalid(element, "a node has lat and lon, or the tags local_x and local_y")
    if place is not None and not (abs(place[0]) <= 90.0 and abs(place[1]) <= 180.0):
        raise _invalid(element, f"lat={place[0]:g}, lon={place[1]:g} is no place on Earth")
    height = _number(element, "ele", tags.get("ele") or "0")
    # Most nodes are of ways only: without tags they take less memory.
    return OsmNode(place, local, height, line_of(element), tags if "type" in tags else {})


def _pair(
    element: etree._Element, texts: dict[str, str], *names: str
) -> tuple[float, float] | None:
    values = [texts.get(name) or None for name in names]
    if values == [None, None]:
        return None
    first, second = (
        _number(element, name, value or "") for name, value in zip(names, values, strict=True)
    )
    return first, second


def _number(element: etree._Element, name: str, text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    # float() reads "nan" and "inf", too.
    if not math.isfinite(number):
        raise _invalid(element, f"{name}={text!r} is no finite number")
    return number


def _way(element: etree._Element) -> OsmWay:
    nodes = tuple(_attribute(nd, "ref") for nd in element.iterchildren("nd"))
    return OsmWay(_attribute(element, "id"), nodes, _tags(element))


def _relation(element: etree._Element) -> Relation:
    members = tuple(
        Member(_attribute(member, "type"), _attribute(member, "ref"), member.get("role", ""))
        for member in element.iterchildren("member")
    )
    return Relation(_attribute(element, "id"), members, _tags(element), element)


def _with_present_members(found: Osm, relation: Relation) -> Relation:
    """The relation without members that maps cut out of larger ones have lost; a lanelet can't be
    without its bounds."""
    tables: dict[str, Collection[str]] = {
        "node": found.nodes,
        "way": found.ways,
        "relation": found.relations,
    }
    present, bounds = list[Member](), set[Member]()
    for element, member in zip(
        relation.element.iterchildren("member"), relation.members, strict=True
    ):
        if member.type not in tables:
            raise _invalid(element, f"type={member.type!r} is not node, way or relation")
        if member in bounds:
            raise _invalid(
                element, f"the {member.type} {member.ref!r} is its {member.role} bound twice"
            )
        if member.role in ("left", "right"):
            bounds.add(member)
        if member.ref in tables[member.type]:
            present.append(member)
        elif member.role in ("left", "right"):
            raise _invalid(element, f"there is no {member.type} {member.ref!r}")
        else:
            found.absent.append(f"{member.type} {member.ref} (of {relation.id})")
    return replace(relation, members=tuple(present))


def _tags(element: etree._Element) -> Tags:
    return {tag.get("k", ""): tag.get("v", "").strip() for tag in element.iterchildren("tag")}


def _attribute(element: etree._Element, name: str) -> str:
    value = element.get(name)
    if not value:
        raise _invalid(element, f"the attribute {name} is missing")
    return value


def _invalid(element: etree._Element, message: str) -> InvalidFile:
    tag = str(element.tag)
    name = f"{tag} {element.get('id')}" if element.get("id") else tag
    return InvalidFile(message, line=line_of(element), element=name)


LARGEST = 1e7
"""Farthest coordinate that is believed, m."""


class MapProjection:
    """Projection from the nodes of a map to x, y (m).

    Args:
        osm: the map.
        origin: latitude and longitude of the origin, degrees. Where none is given, local
            coordinates are taken where every node has them, else the origin of INTERACTION is,
            0, 0.

    Attributes:
        geo: what the road map says of it, None for local coordinates.

    Raises:
        UsageError: the origin is no place on Earth.
        InvalidFile: some nodes have neither kind of coordinates.
    """

    def __init__(self, osm: Osm, origin: tuple[float, float] | None) -> None:
        # All nodes need them: a map of two kinds of coordinates would fall apart.
        self.local = origin is None and all(node.local is not None for node in osm.nodes.values())
        latitude, longitude = origin or (0.0, 0.0)
        # UTM ends at 84 degrees.
        if not (abs(latitude) <= 84.0 and abs(longitude) <= 180.0):
            raise UsageError(f"the origin ({latitude:g}, {longitude:g}) has no UTM zone")
        self.geo = None if self.local else _geo(latitude, longitude)

    def points(self, osm: Osm) -> dict[str, tuple[float, float]]:
        """x and y of every node by its id, m.

        Raises:
            InvalidFile: a node has no such coordinates, or is too far away.
        """
        if self.geo is None:
            points = {
                name: node.local for name, node in osm.nodes.items() if node.local is not None
            }
        else:
            points = _projected(osm, self.geo)
        for name, (x, y) in points.items():
            # `not … <` catches NaN, too.
            if not abs(x) + abs(y) < LARGEST:
                raise InvalidFile(
                    "it is too far away from the map's origin",
                    line=osm.nodes[name].line,
                    element=f"node {name}",
                )
        return points


def utm_zone(longitude: float) -> int:
    """The UTM zone of a longitude, degrees."""
    return int((longitude + 180.0) // 6.0) % 60 + 1


def _geo(latitude: float, longitude: float) -> Geo:
    import pyproj

    projection = (
        f"+proj=utm +zone={utm_zone(longitude)} {'+south ' if latitude < 0.0 else ''}+ellps=WGS84 "
        "+units=m +no_defs"
    )
    easting, northing = pyproj.Proj(projection)(longitude, latitude)
    return Geo(projection, (easting, northing))


def _projected(osm: Osm, geo: Geo) -> dict[str, tuple[float, float]]:
    import pyproj

    names, places = [], []
    for name, node in osm.nodes.items():
        if node.place is None:
            raise InvalidFile("it has no lat and lon", line=node.line, element=f"node {name}")
        names.append(name)
        places.append(node.place)
    latitudes, longitudes = zip(*places, strict=True) if places else ((), ())
    eastings, northings = pyproj.Proj(geo.projection)(longitudes, latitudes)
    x0, y0 = geo.origin
    found = {name: (x - x0, y - y0) for name, x, y in zip(names, eastings, northings, strict=True)}
    # PROJ gives inf where it does not reach; the caller refuses such nodes by name.
    return {
        name: point if math.isfinite(sum(point)) else (math.inf, math.inf)
        for name, point in found.items()
    }
