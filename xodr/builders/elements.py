"""The OpenDRIVE elements of the map builders, their plane curves, and their XML (OpenDRIVE 1.7, or 1.9 with layers).

Plain frozen records, named after the standard's elements. Coordinates are those of the file: x, y in
metres, headings in radians, s along the reference line, t to the left, lane ids negative on the right.
The same records always give the same bytes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import NamedTuple

from lxml import etree

from schemas.common.storage import keep
from xodr.model import PERMANENT, TEMPORARY

# plane curves: clothoids (lines and arcs among them), parametric cubics (`paramPoly3`, p from 0 to 1) ----


class Pose(NamedTuple):
    """Position in m and heading in rad."""

    x: float
    y: float
    heading: float

    def shifted(self, t: float) -> Pose:
        """The pose `t` metres to the left, same heading."""
        return Pose(self.x - t * math.sin(self.heading), self.y + t * math.cos(self.heading), self.heading)

    def turned(self, angle: float) -> Pose:
        """The pose turned on the spot, counterclockwise."""
        return Pose(self.x, self.y, self.heading + angle)


class Segment(NamedTuple):
    """Piece of a reference line: its length in m and its curvatures at start and end in 1/m, linear between."""

    length: float
    start: float = 0.0
    end: float = 0.0


def line(length: float) -> Segment:
    """A straight piece."""
    return Segment(length)


def arc(length: float, curvature: float) -> Segment:
    """A circular piece; curvature positive to the left."""
    return Segment(length, curvature, curvature)


def advance(pose: Pose, segment: Segment) -> Pose:
    """The pose at the end of a segment that starts at `pose`."""
    from pyclothoids import Clothoid

    rate = (segment.end - segment.start) / segment.length
    curve = Clothoid.StandardParams(*pose, segment.start, rate, segment.length)
    turn = segment.length * (segment.start + segment.end) / 2
    return Pose(curve.XEnd, curve.YEnd, pose.heading + turn)


def connect(start: Pose, end: Pose) -> Segment:
    """Return the only clothoid from `start` to `end` that keeps both headings.

    Source: Bertolazzi and Frego, G1 fitting with clothoids, 2015.
    """
    from pyclothoids import Clothoid

    curve = Clothoid.G1Hermite(*start, *end)
    first, last = curve.KappaStart, curve.KappaEnd
    if abs(first - last) * curve.length < 1e-9:
        first = last = (first + last) / 2 if abs(first + last) * curve.length > 1e-9 else 0.0
    return Segment(curve.length, first, last)


Coefficients = tuple[float, float, float, float]


class ParamPoly3(NamedTuple):
    """A piece u(p), v(p) in the frame of its start: u ahead, v to the left, a + b·p + c·p² + d·p³ with p from 0 to 1.

    length: of the curve, in m. The curve begins at the frame's origin in its direction: a of both and b of v are 0.
    """

    length: float
    u: Coefficients
    v: Coefficients

    def after(self, pose: Pose) -> Pose:
        """The pose at the end of the piece that starts at `pose`; it turns by less than half a turn."""
        ahead, aside = sum(self.u), sum(self.v)
        turn = math.atan2(self.v[1] + 2 * self.v[2] + 3 * self.v[3], self.u[1] + 2 * self.u[2] + 3 * self.u[3])
        cos, sin = math.cos(pose.heading), math.sin(pose.heading)
        return Pose(pose.x + cos * ahead - sin * aside, pose.y + sin * ahead + cos * aside, pose.heading + turn)

    def mirrored(self) -> ParamPoly3:
        """The piece on the other side of its starting direction."""
        a, b, c, d = self.v
        return ParamPoly3(self.length, self.u, (-a, -b, -c, -d))


# elements ---------------------------------------------------------------------------------------


REVISION, REVISION_OF_LAYERS = (1, 7), (1, 9)
"""Version of the standard that is written, and that of maps with temporary lanes."""


RoadId = int | str
"""Id of a road: numbers count up, texts are as a scenario has them."""


@dataclass(frozen=True)
class Cubic:
    """Cubic a + b·ds + c·ds² + d·ds³ from `s` on (lane widths, lane offset)."""

    s: float
    a: float
    b: float = 0.0
    c: float = 0.0
    d: float = 0.0


@dataclass(frozen=True)
class Lane:
    """One lane of a section: type of the standard, width, the mark on its outer border, its links, and its own speed limit.

    speed_limit: in m/s; None where that of the road holds. other_predecessor, other_successor: links to lanes of the other layer.
    """

    type: str
    width: tuple[Cubic, ...]
    mark: str = "none"
    predecessor: int | None = None
    successor: int | None = None
    speed_limit: float | None = None
    other_predecessor: int | None = None
    other_successor: int | None = None


@dataclass(frozen=True)
class Section:
    """Lane section from `s` on; lane 0 is implied and carries `centre_mark`. length: of a section of temporary lanes, m."""

    s: float
    lanes: Mapping[int, Lane]
    centre_mark: str = "none"
    length: float | None = None


@dataclass(frozen=True)
class Link:
    """Predecessor or successor of a road: a road with its contact point, or a junction."""

    element: str
    id: RoadId
    contact: str | None = None


@dataclass(frozen=True)
class Signal:
    """A traffic light for lanes with the given ids, facing traffic along +s (`+`) or against it (`-`)."""

    id: int
    name: str
    s: float
    t: float
    orientation: str
    lanes: tuple[int, int]


@dataclass(frozen=True)
class Object:
    """Something flat on the road, with the corners (u, v) of its outline: ahead and to the left of (s, t), seen along +s."""

    id: int
    name: str
    type: str
    s: float
    t: float
    outline: tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Road:
    """A road: plan view as pieces from a start pose, lane sections and links. Speed limit in m/s, infinite for none.

    offset: t of lane 0, along the whole road. temporary, temporary_offset: the same of the temporary layer of lanes.
    """

    id: RoadId
    name: str
    start: Pose
    plan: tuple[Segment | ParamPoly3, ...]
    sections: tuple[Section, ...]
    type: str
    speed_limit: float
    junction: int = -1
    predecessor: Link | None = None
    successor: Link | None = None
    signals: tuple[Signal, ...] = ()
    offset: tuple[Cubic, ...] = ()
    objects: tuple[Object, ...] = ()
    temporary: tuple[Section, ...] = ()
    temporary_offset: tuple[Cubic, ...] = ()

    @property
    def length(self) -> float:
        """Length of the reference line in m."""
        return sum(piece.length for piece in self.plan)

    @property
    def end(self) -> Pose:
        """Pose at the end of the reference line."""
        return self.poses[-1]

    @property
    def poses(self) -> list[Pose]:
        """Poses at the start of each piece of the reference line, and at its end."""
        found = [self.start]
        for piece in self.plan:
            found.append(piece.after(found[-1]) if isinstance(piece, ParamPoly3) else advance(found[-1], piece))
        return found


@dataclass(frozen=True)
class Connection:
    """A path through a junction: incoming road, connecting road (entered at its start) and lane pairs."""

    incoming: RoadId
    connecting: RoadId
    lanes: tuple[tuple[int, int], ...]


@dataclass(frozen=True)
class Junction:
    """A junction with its connections, priorities (connecting roads: high, low) and signal controllers.

    direct: the "connecting" roads are the roads that the incoming ones lead to, without any road between them.
    """

    id: int
    name: str
    connections: tuple[Connection, ...]
    priorities: tuple[tuple[RoadId, RoadId], ...] = ()
    controllers: tuple[int, ...] = ()
    direct: bool = False


@dataclass(frozen=True)
class Controller:
    """A group of traffic lights that switch together."""

    id: int
    name: str
    signals: tuple[int, ...]


@dataclass(frozen=True)
class Geo:
    """The projection of a map as a PROJ string, and the projected coordinates (easting, northing, m) of the map's origin."""

    projection: str
    origin: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True)
class RoadMap:
    """A whole map, built for right-hand traffic or mirrored for left-hand traffic.

    geo: where it is on Earth; None for nowhere in particular.
    """

    name: str
    roads: tuple[Road, ...]
    junctions: tuple[Junction, ...] = ()
    controllers: tuple[Controller, ...] = ()
    rule: str = "RHT"
    geo: Geo | None = None

    def mirrored(self) -> RoadMap:
        """The same map for the other side of traffic, mirrored on the x axis."""
        return replace(
            self,
            rule="LHT" if self.rule == "RHT" else "RHT",
            roads=tuple(_mirrored_road(road) for road in self.roads),
            junctions=tuple(
                replace(
                    junction,
                    connections=tuple(replace(c, lanes=tuple((-a, -b) for a, b in c.lanes)) for c in junction.connections),
                )
                for junction in self.junctions
            ),
        )

    def to_xml(self) -> bytes:
        """The map as an OpenDRIVE file, UTF-8."""
        root = etree.Element("OpenDRIVE")
        major, minor = REVISION_OF_LAYERS if any(road.temporary for road in self.roads) else REVISION
        header = _add(root, "header", revMajor=major, revMinor=minor, name=self.name, version="1.00", vendor="xosc-toolchain")
        if self.geo:
            _add(header, "geoReference").text = etree.CDATA(self.geo.projection)
            _add(header, "offset", x=self.geo.origin[0], y=self.geo.origin[1], z=0, hdg=0)
        for road in self.roads:
            _road(root, road, self.rule)
        for controller in self.controllers:
            element = _add(root, "controller", id=controller.id, name=controller.name)
            for signal in controller.signals:
                _add(element, "control", signalId=signal, type="trafficLight")
        for junction in self.junctions:
            _junction(root, junction)
        etree.indent(root)
        return etree.tostring(root, xml_declaration=True, encoding="UTF-8") + b"\n"

    def write(self, path: str | PathLike[str]) -> Path:
        """Write the map to `path`, whole or not at all, and return that path."""
        return keep(self.to_xml(), Path(path))


# mirroring --------------------------------------------------------------------------------------


def _mirrored_road(road: Road) -> Road:
    start = Pose(road.start.x, -road.start.y, -road.start.heading)
    plan = tuple(_mirrored_piece(piece) for piece in road.plan)
    sections, temporary = (
        tuple(replace(s, lanes={-key: _mirrored_lane(lane) for key, lane in s.lanes.items()}) for s in layer)
        for layer in (road.sections, road.temporary)
    )
    signals = tuple(replace(s, t=-s.t, lanes=(-s.lanes[1], -s.lanes[0])) for s in road.signals)
    offset, moved = (tuple(Cubic(c.s, -c.a, -c.b, -c.c, -c.d) for c in each) for each in (road.offset, road.temporary_offset))
    objects = tuple(replace(o, t=-o.t, outline=tuple((u, -v) for u, v in o.outline)) for o in road.objects)
    return replace(
        road, start=start, plan=plan, sections=sections, signals=signals, offset=offset, objects=objects,
        temporary=temporary, temporary_offset=moved,
    )  # fmt: skip


def _mirrored_piece(piece: Segment | ParamPoly3) -> Segment | ParamPoly3:
    return piece.mirrored() if isinstance(piece, ParamPoly3) else Segment(piece.length, -piece.start, -piece.end)


def _mirrored_lane(lane: Lane) -> Lane:
    links = ("predecessor", "successor", "other_predecessor", "other_successor")
    mirrored = {name: -lane_id for name in links if (lane_id := getattr(lane, name)) is not None}
    return replace(lane, **mirrored)


# XML --------------------------------------------------------------------------------------------


def _number(value: float) -> str:
    """A number without noise digits: 12 significant ones are a nanometre on a kilometre."""
    return f"{value + 0.0:.12g}" if abs(value) > 1e-15 else "0"


def _add(parent: etree._Element, tag: str, **attributes: str | float | None) -> etree._Element:
    texts = {key: value if isinstance(value, str) else _number(value) for key, value in attributes.items() if value is not None}
    return etree.SubElement(parent, tag, texts)


def _road(root: etree._Element, road: Road, rule: str) -> None:
    element = _add(root, "road", name=road.name, length=road.length, id=str(road.id), junction=str(road.junction), rule=rule)
    if road.predecessor or road.successor:
        links = _add(element, "link")
        for name, link in (("predecessor", road.predecessor), ("successor", road.successor)):
            if link:
                _add(links, name, elementType=link.element, elementId=str(link.id), contactPoint=link.contact)
    kind = _add(element, "type", s=0, type=road.type)
    _add(kind, "speed", **_speed(road.speed_limit))
    _plan_view(_add(element, "planView"), road)
    for layer, offset, sections in (
        (PERMANENT if road.temporary else None, road.offset, road.sections),
        (TEMPORARY, road.temporary_offset, road.temporary),
    ):
        if sections:
            _layer(_add(element, "lanes", layer=layer), layer, offset, sections)
    if road.objects:
        objects = _add(element, "objects")
        for item in road.objects:
            _object(objects, item)
    if road.signals:
        signals = _add(element, "signals")
        for signal in road.signals:
            _signal(signals, signal)


def _plan_view(parent: etree._Element, road: Road) -> None:
    s = 0.0
    for pose, piece in zip(road.poses, road.plan, strict=False):
        geometry = _add(parent, "geometry", s=s, x=pose.x, y=pose.y, hdg=pose.heading, length=piece.length)
        if isinstance(piece, ParamPoly3):
            u, v = (
                dict(zip((f"a{axis}", f"b{axis}", f"c{axis}", f"d{axis}"), getattr(piece, axis.lower()), strict=True))
                for axis in "UV"
            )
            _add(geometry, "paramPoly3", **u, **v, pRange="normalized")
        elif piece.start != piece.end:
            _add(geometry, "spiral", curvStart=piece.start, curvEnd=piece.end)
        elif piece.start:
            _add(geometry, "arc", curvature=piece.start)
        else:
            _add(geometry, "line")
        s += piece.length


def _layer(lanes: etree._Element, layer: str | None, offset: Sequence[Cubic], sections: Sequence[Section]) -> None:
    for cubic in offset:
        _add(lanes, "laneOffset", s=cubic.s, a=cubic.a, b=cubic.b, c=cubic.c, d=cubic.d)
    for section in sections:
        _section(lanes, section, layer)


def _section(parent: etree._Element, section: Section, layer: str | None) -> None:
    element = _add(parent, "laneSection", s=section.s, length=section.length)
    left = sorted((key for key in section.lanes if key > 0), reverse=True)
    right = sorted((key for key in section.lanes if key < 0), reverse=True)
    if left:
        side = _add(element, "left")
        for key in left:
            _lane(side, key, section.lanes[key], layer)
    centre = _add(_add(element, "center"), "lane", id="0", type="none", level="false")
    _mark(centre, section.centre_mark, layer)
    if right:
        side = _add(element, "right")
        for key in right:
            _lane(side, key, section.lanes[key], layer)


def _lane(side: etree._Element, key: int, lane: Lane, layer: str | None) -> None:
    element = _add(side, "lane", id=str(key), type=lane.type, level="false")
    other = PERMANENT if layer == TEMPORARY else TEMPORARY
    links = [
        (name, link, where)
        for name, link, where in (
            ("predecessor", lane.predecessor, layer),
            ("predecessor", lane.other_predecessor, other),
            ("successor", lane.successor, layer),
            ("successor", lane.other_successor, other),
        )
        if link is not None
    ]
    if links:
        link_element = _add(element, "link")
        for name, link, where in links:
            _add(link_element, name, id=str(link), layer=where)
    for cubic in lane.width:
        _add(element, "width", sOffset=cubic.s, a=cubic.a, b=cubic.b, c=cubic.c, d=cubic.d)
    _mark(element, lane.mark, layer)
    if lane.speed_limit is not None:
        _add(element, "speed", sOffset=0, **_speed(lane.speed_limit))


def _speed(limit: float) -> dict[str, str | float]:
    return {"max": limit * 3.6 if math.isfinite(limit) else "no limit", "unit": "km/h"}


def _mark(parent: etree._Element, kind: str, layer: str | None) -> None:
    change = "both" if kind == "broken" else "none"
    width = 0.12 if kind != "none" else None
    color = "yellow" if layer == TEMPORARY else "standard"
    _add(parent, "roadMark", sOffset=0, type=kind, weight="standard", color=color, width=width, laneChange=change)


def _object(parent: etree._Element, item: Object) -> None:
    element = _add(
        parent,
        "object",
        id=str(item.id),
        name=item.name,
        type=item.type,
        s=item.s,
        t=item.t,
        zOffset=0,
        hdg=0,
        orientation="none",
    )
    outline = _add(_add(element, "outlines"), "outline", id="0", closed="true")
    for number, (u, v) in enumerate(item.outline):
        _add(outline, "cornerLocal", id=str(number), u=u, v=v, z=0, height=0)


def _signal(parent: etree._Element, signal: Signal) -> None:
    element = _add(
        parent, "signal", s=signal.s, t=signal.t, id=str(signal.id), name=signal.name, dynamic="yes",
        orientation=signal.orientation, zOffset=3, country="OpenDRIVE", type="1000001", subtype="-1", value=-1,
        height=1, width=0.4, hOffset=0, pitch=0, roll=0,
    )  # fmt: skip
    _add(element, "validity", fromLane=str(signal.lanes[0]), toLane=str(signal.lanes[1]))


def _junction(root: etree._Element, junction: Junction) -> None:
    element = _add(root, "junction", id=str(junction.id), name=junction.name, type="direct" if junction.direct else "default")
    entered = "linkedRoad" if junction.direct else "connectingRoad"
    for number, connection in enumerate(junction.connections):
        ends = {"incomingRoad": str(connection.incoming), entered: str(connection.connecting)}
        child = _add(element, "connection", id=str(number), **ends, contactPoint="start")
        for here, there in connection.lanes:
            _add(child, "laneLink", **{"from": str(here), "to": str(there)})
    for high, low in junction.priorities:
        _add(element, "priority", high=str(high), low=str(low))
    for sequence, controller in enumerate(junction.controllers):
        _add(element, "controller", id=str(controller), sequence=str(sequence))
