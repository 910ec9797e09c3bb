"""Designs of roads: pieces of their reference lines, lanes by width, and the writer of maps
(OpenDRIVE 1.7, or 1.9 with layers).

A design says what a file says; `xodr.model.road.Road` is what a reader computes from it (borders
and centres of lanes in a road's s, resolved links). Links, signals, objects, junctions and
controllers are those of `xodr.model`, read and built alike.

Coordinates are those of the file: x, y in metres, headings in radians, s along the reference line,
t to the left, lane ids negative on the right. The same design always gives the same bytes.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate
from os import PathLike
from pathlib import Path
from typing import NamedTuple

from lxml import etree

from schemas.common.storage import keep
from xodr.model import (
    PERMANENT,
    TEMPORARY,
    Connection,
    Controller,
    Junction,
    LaneRef,
    RoadLink,
    RoadObject,
    Signal,
    SignalReference,
)
from xodr.model.geometry import Cubic

# plane curves: clothoids (lines and arcs among them), parametric cubics (`paramPoly3`) ----------


class PlanPose(NamedTuple):
    """Position in m and heading in rad."""

    x: float
    y: float
    heading: float

    def shifted(self, t: float) -> PlanPose:
        """The pose `t` metres to the left, same heading."""
        return PlanPose(
            self.x - t * math.sin(self.heading), self.y + t * math.cos(self.heading), self.heading
        )

    def local(self, place: Sequence[float]) -> tuple[float, float]:
        """Distances (m) of a place (x, y) ahead of the pose and to its left."""
        dx, dy = place[0] - self.x, place[1] - self.y
        cos, sin = math.cos(self.heading), math.sin(self.heading)
        return cos * dx + sin * dy, cos * dy - sin * dx

    def turned(self, angle: float) -> PlanPose:
        """The pose turned on the spot, counterclockwise."""
        return PlanPose(self.x, self.y, self.heading + angle)


class Clothoid(NamedTuple):
    """Piece of a reference line, a straight or an arc too: length in m, curvatures at start and end
    in 1/m, linear between."""

    length: float
    start: float = 0.0
    end: float = 0.0

    def after(self, pose: PlanPose) -> PlanPose:
        """The pose at the end of the piece that starts at `pose`."""
        from pyclothoids import Clothoid as Fitted

        rate = (self.end - self.start) / self.length
        curve = Fitted.StandardParams(*pose, self.start, rate, self.length)
        turn = self.length * (self.start + self.end) / 2
        return PlanPose(curve.XEnd, curve.YEnd, pose.heading + turn)

    def first(self, length: float) -> Clothoid:
        """Return the first part of the element, of a length (m)."""
        end = self.start + (self.end - self.start) * length / self.length
        return Clothoid(length, self.start, end)


def line(length: float) -> Clothoid:
    """A straight piece."""
    return Clothoid(length)


def arc(length: float, curvature: float) -> Clothoid:
    """A circular piece; curvature positive to the left."""
    return Clothoid(length, curvature, curvature)


def connect(start: PlanPose, end: PlanPose) -> Clothoid:
    """Return the only clothoid from `start` to `end` that keeps both headings.

    Source: Bertolazzi and Frego, G1 fitting with clothoids, 2015.
    """
    from pyclothoids import Clothoid as Fitted

    curve = Fitted.G1Hermite(*start, *end)
    first, last = curve.KappaStart, curve.KappaEnd
    # Curvatures that differ by rounding only: an arc, or a line, is to be written as such.
    if abs(first - last) * curve.length < 1e-9:
        first = last = (first + last) / 2 if abs(first + last) * curve.length > 1e-9 else 0.0
    return Clothoid(curve.length, first, last)


Coefficients = tuple[float, float, float, float]


class CubicPiece(NamedTuple):
    """A piece u(p), v(p) in the frame of its start: u ahead, v to the left, a + b·p + c·p² + d·p³
    with p from 0 to 1.

    length: of the curve, in m. The curve begins at the frame's origin in its direction: a of both
    and b of v are 0.
    """

    length: float
    u: Coefficients
    v: Coefficients

    def after(self, pose: PlanPose) -> PlanPose:
        """The pose at the end of the piece that starts at `pose`; it turns by less than half a
        turn."""
        ahead, aside = sum(self.u), sum(self.v)
        turn = math.atan2(
            self.v[1] + 2 * self.v[2] + 3 * self.v[3], self.u[1] + 2 * self.u[2] + 3 * self.u[3]
        )
        cos, sin = math.cos(pose.heading), math.sin(pose.heading)
        return PlanPose(
            pose.x + cos * ahead - sin * aside,
            pose.y + sin * ahead + cos * aside,
            pose.heading + turn,
        )

    def first(self, length: float) -> CubicPiece:
        """Return the first part of the element, of a length (m); p is taken as the share of the
        length."""
        share = length / self.length
        u, v = ((a, b * share, c * share**2, d * share**3) for a, b, c, d in (self.u, self.v))
        return CubicPiece(length, u, v)

    def mirrored(self) -> CubicPiece:
        """The piece on the other side of its starting direction."""
        a, b, c, d = self.v
        return CubicPiece(self.length, self.u, (-a, -b, -c, -d))


# elements ---------------------------------------------------------------------------------------


REVISION, REVISION_OF_LAYERS = (1, 7), (1, 9)
"""Version of the standard that is written, and that of maps with temporary lanes."""


@dataclass(frozen=True)
class LaneDesign:
    """A lane of a section: type of the standard, width, the mark on its outer border, its links,
    and its own speed limit.

    width: cubics, whose starts count from that of the section. speed_limit: in m/s; None where that
    of the road holds. other_predecessor, other_successor: links to lanes of the other layer.
    height:
    of the inner and the outer border over the road's surface, m.
    """

    type: str
    width: tuple[Cubic, ...]
    mark: str = "none"
    predecessor: int | None = None
    successor: int | None = None
    speed_limit: float | None = None
    other_predecessor: int | None = None
    other_successor: int | None = None
    height: tuple[float, float] | None = None


@dataclass(frozen=True)
class SectionDesign:
    """Lane section from `s` on; lane 0 is implied and carries `centre_mark`. length: of a section
    of temporary lanes, m."""

    s: float
    lanes: Mapping[int, LaneDesign]
    centre_mark: str = "none"
    length: float | None = None


def traffic_light(
    number: int,
    road_id: str,
    s: float,
    t: float,
    name: str,
    lanes: tuple[int, int],
    against: bool = False,
) -> Signal:
    """A traffic light for a range of lanes (from, to), that faces traffic along
    +s, or against it.
    """
    return Signal(
        str(number), road_id, s, t, name, dynamic=True, type="1000001", subtype="-1",
        country="OpenDRIVE",
        orientation="-" if against else "+", value=-1.0, z_offset=3.0, width=0.4, height=1.0,
        validity=(lanes,),
    )  # fmt: skip


def connection(incoming: str, connecting: str, lanes: Iterable[tuple[int, int]]) -> Connection:
    """Way through a junction that enters its connecting road at the start, not numbered yet."""
    return Connection(
        "",
        incoming,
        connecting,
        "start",
        tuple((LaneRef(here), LaneRef(there)) for here, there in lanes),
    )


@dataclass(frozen=True)
class RoadDesign:
    """A road: plan view as pieces from a start pose, lane sections and links. Speed limit in m/s,
    infinite for none.

    offset: t of lane 0, along the whole road. elevation, superelevation: height (m) of the
    reference
    line and roll (rad) about it, none for a flat road. temporary, temporary_offset: the same of the
    temporary layer of lanes. references: signals of other roads that also hold here.
    """

    id: str
    name: str
    start: PlanPose
    plan: tuple[Clothoid | CubicPiece, ...]
    sections: tuple[SectionDesign, ...]
    type: str
    speed_limit: float
    junction: str = "-1"
    predecessor: RoadLink | None = None
    successor: RoadLink | None = None
    signals: tuple[Signal, ...] = ()
    references: tuple[SignalReference, ...] = ()
    offset: tuple[Cubic, ...] = ()
    elevation: tuple[Cubic, ...] = ()
    superelevation: tuple[Cubic, ...] = ()
    objects: tuple[RoadObject, ...] = ()
    temporary: tuple[SectionDesign, ...] = ()
    temporary_offset: tuple[Cubic, ...] = ()

    @property
    def length(self) -> float:
        """Length of the reference line in m."""
        return sum(piece.length for piece in self.plan)

    @property
    def end(self) -> PlanPose:
        """Pose at the end of the reference line."""
        return self.poses[-1]

    @property
    def poses(self) -> list[PlanPose]:
        """Poses at the start of each piece of the reference line, and at its end."""
        reached = [self.start]
        for piece in self.plan:
            reached.append(piece.after(reached[-1]))
        return reached

    def poses_at(self, stations: Sequence[float]) -> list[PlanPose]:
        """Poses of the reference line at places s (m), in ascending order, within its length."""
        poses, starts = [], self.poses
        begins = list(accumulate((piece.length for piece in self.plan), initial=0.0))
        for s in stations:
            number = min(max(bisect_right(begins, s) - 1, 0), len(self.plan) - 1)
            way = min(s - begins[number], self.plan[number].length)
            here = starts[number]
            poses.append(self.plan[number].first(way).after(here) if way > 0.0 else here)
        return poses


@dataclass(frozen=True)
class Geo:
    """The projection of a map as a PROJ string, and the projected coordinates (easting, northing,
    m) of the map's origin.

    height: of the map's origin, m. heading: of the map's x axis in the projection, rad.
    """

    projection: str
    origin: tuple[float, float] = (0.0, 0.0)
    height: float = 0.0
    heading: float = 0.0


@dataclass(frozen=True)
class RoadMap:
    """A whole map, built for right-hand traffic or mirrored for left-hand traffic.

    geo: where it is on Earth; None for nowhere in particular.
    """

    name: str
    roads: tuple[RoadDesign, ...]
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
                    connections=tuple(_mirrored_connection(one) for one in junction.connections),
                )
                for junction in self.junctions
            ),
        )

    def to_xml(self) -> bytes:
        """The map as an OpenDRIVE file, UTF-8."""
        root = etree.Element("OpenDRIVE")
        # The oldest version that has all that is built: more readers know it.
        major, minor = (
            REVISION_OF_LAYERS if any(road.temporary for road in self.roads) else REVISION
        )
        header = _add(
            root,
            "header",
            revMajor=major,
            revMinor=minor,
            name=self.name,
            version="1.00",
            vendor="xosc-toolchain",
        )
        if self.geo:
            _add(header, "geoReference").text = etree.CDATA(self.geo.projection)
            x, y = self.geo.origin
            _add(header, "offset", x=x, y=y, z=self.geo.height, hdg=self.geo.heading)
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


def _mirrored_road(road: RoadDesign) -> RoadDesign:
    start = PlanPose(road.start.x, -road.start.y, -road.start.heading)
    plan = tuple(_mirrored_piece(piece) for piece in road.plan)
    sections, temporary = (
        tuple(
            replace(s, lanes={-key: _mirrored_lane(lane) for key, lane in s.lanes.items()})
            for s in layer
        )
        for layer in (road.sections, road.temporary)
    )
    signals = tuple(
        replace(s, t=-s.t, validity=tuple((-b, -a) for a, b in s.validity)) for s in road.signals
    )
    references = tuple(
        r._replace(t=-r.t, validity=tuple((-b, -a) for a, b in r.validity)) for r in road.references
    )
    # Offsets and roll change sides; heights, which are profiles too, do not.
    offset, moved, roll = (
        tuple(Cubic(c.start, -c.a, -c.b, -c.c, -c.d) for c in profile)
        for profile in (road.offset, road.temporary_offset, road.superelevation)
    )
    objects = tuple(
        replace(
            o,
            t=-o.t,
            heading=-o.heading,
            validity=tuple((-b, -a) for a, b in o.validity),
            outlines=tuple(
                tuple(corner._replace(v=-corner.v) for corner in outline) for outline in o.outlines
            ),
        )
        for o in road.objects
    )
    return replace(
        road, start=start, plan=plan, sections=sections, signals=signals, offset=offset,
        objects=objects,
        superelevation=roll, temporary=temporary, temporary_offset=moved, references=references,
    )  # fmt: skip


def _mirrored_piece(piece: Clothoid | CubicPiece) -> Clothoid | CubicPiece:
    return (
        piece.mirrored()
        if isinstance(piece, CubicPiece)
        else Clothoid(piece.length, -piece.start, -piece.end)
    )


def _mirrored_lane(lane: LaneDesign) -> LaneDesign:
    links = ("predecessor", "successor", "other_predecessor", "other_successor")
    mirrored = {name: -lane_id for name in links if (lane_id := getattr(lane, name)) is not None}
    return replace(lane, **mirrored)


def _mirrored_connection(way: Connection) -> Connection:
    return way._replace(
        lane_links=tuple((LaneRef(-here.id), LaneRef(-there.id)) for here, there in way.lane_links)
    )


# XML --------------------------------------------------------------------------------------------


def _number(value: float) -> str:
    """A number without noise digits: 12 significant ones are a nanometre on a kilometre."""
    return f"{value + 0.0:.12g}" if abs(value) > 1e-15 else "0"


def _add(parent: etree._Element, tag: str, **attributes: str | float | None) -> etree._Element:
    texts = {
        key: value if isinstance(value, str) else _number(value)
        for key, value in attributes.items()
        if value is not None
    }
    return etree.SubElement(parent, tag, texts)


def _road(root: etree._Element, road: RoadDesign, rule: str) -> None:
    element = _add(
        root,
        "road",
        name=road.name,
        length=road.length,
        id=road.id,
        junction=road.junction,
        rule=rule,
    )
    if road.predecessor or road.successor:
        links = _add(element, "link")
        for name, link in (("predecessor", road.predecessor), ("successor", road.successor)):
            if link:
                _add(
                    links,
                    name,
                    elementType=link.element_type,
                    elementId=link.element_id,
                    contactPoint=link.contact,
                )
    kind = _add(element, "type", s=0, type=road.type)
    _add(kind, "speed", **_speed(road.speed_limit))
    _plan_view(_add(element, "planView"), road)
    for profile, tag, cubics in (
        ("elevationProfile", "elevation", road.elevation),
        ("lateralProfile", "superelevation", road.superelevation),
    ):
        if cubics:
            _cubics(_add(element, profile), tag, cubics)
    # Without temporary lanes the attribute is left out: it came with OpenDRIVE 1.9, the file is of
    # 1.7.
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
    if road.signals or road.references:
        signals = _add(element, "signals")
        for signal in road.signals:
            _signal(signals, signal)
        for reference in road.references:
            _reference(signals, reference)


def _plan_view(parent: etree._Element, road: RoadDesign) -> None:
    s = 0.0
    for pose, piece in zip(road.poses, road.plan, strict=False):
        geometry = _add(
            parent, "geometry", s=s, x=pose.x, y=pose.y, hdg=pose.heading, length=piece.length
        )
        if isinstance(piece, CubicPiece):
            u, v = (
                dict(
                    zip(
                        (f"a{axis}", f"b{axis}", f"c{axis}", f"d{axis}"),
                        getattr(piece, axis.lower()),
                        strict=True,
                    )
                )
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


def _layer(
    lanes: etree._Element,
    layer: str | None,
    offset: Sequence[Cubic],
    sections: Sequence[SectionDesign],
) -> None:
    _cubics(lanes, "laneOffset", offset)
    for section in sections:
        _section(lanes, section, layer)


def _cubics(parent: etree._Element, tag: str, cubics: Iterable[Cubic]) -> None:
    for cubic in cubics:
        _add(parent, tag, s=cubic.start, a=cubic.a, b=cubic.b, c=cubic.c, d=cubic.d)


def _section(parent: etree._Element, section: SectionDesign, layer: str | None) -> None:
    element = _add(parent, "laneSection", s=section.s, length=section.length)
    # The order of the schema: from left to right.
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


def _lane(side: etree._Element, key: int, lane: LaneDesign, layer: str | None) -> None:
    element = _add(side, "lane", id=str(key), type=lane.type, level="false")
    # A link names the layer it leads to, where there are two.
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
        _add(element, "width", sOffset=cubic.start, a=cubic.a, b=cubic.b, c=cubic.c, d=cubic.d)
    _mark(element, lane.mark, layer)
    if lane.speed_limit is not None:
        _add(element, "speed", sOffset=0, **_speed(lane.speed_limit))
    if lane.height is not None:
        _add(element, "height", sOffset=0, inner=lane.height[0], outer=lane.height[1])


def _speed(limit: float) -> dict[str, str | float]:
    # "no limit" is OpenDRIVE's word (1.9, 10.4).
    return {"max": limit * 3.6 if math.isfinite(limit) else "no limit", "unit": "km/h"}


def _mark(parent: etree._Element, kind: str, layer: str | None) -> None:
    # Of the marks that are built, only broken ones may be crossed.
    change = "both" if kind == "broken" else "none"
    width = 0.12 if kind != "none" else None
    color = "yellow" if layer == TEMPORARY else "standard"
    _add(
        parent,
        "roadMark",
        sOffset=0,
        type=kind,
        weight="standard",
        color=color,
        width=width,
        laneChange=change,
    )


def _object(parent: etree._Element, item: RoadObject) -> None:
    element = _add(
        parent, "object", id=item.id, name=item.name, type=item.type,
        subtype=item.subtype or None, s=item.s, t=item.t, zOffset=item.z_offset,
        hdg=item.heading, orientation=item.orientation, length=item.length, width=item.width,
        radius=item.radius, height=item.height,
    )  # fmt: skip
    # 1.7 asks for one outline or more in `outlines`.
    outlines = _add(element, "outlines") if item.outlines else element
    for index, corners in enumerate(item.outlines):
        outline = _add(outlines, "outline", id=str(index), closed="true")
        for number, corner in enumerate(corners):
            _add(
                outline,
                "cornerLocal",
                id=str(number),
                u=corner.u,
                v=corner.v,
                z=corner.z,
                height=corner.height,
            )
    _validity(element, item.validity)


def _signal(parent: etree._Element, signal: Signal) -> None:
    element = _add(
        parent, "signal", s=signal.s, t=signal.t, id=signal.id, name=signal.name,
        dynamic="yes" if signal.dynamic else "no",
        orientation=signal.orientation, zOffset=signal.z_offset, country=signal.country,
        type=signal.type,
        subtype=signal.subtype, value=signal.value, unit=signal.unit or None,
        height=signal.height, width=signal.width, hOffset=signal.h_offset,
        pitch=0, roll=0,
    )  # fmt: skip
    _validity(element, signal.validity)


def _reference(parent: etree._Element, reference: SignalReference) -> None:
    element = _add(
        parent, "signalReference", s=reference.s, t=reference.t, id=reference.signal_id,
        orientation=reference.orientation
    )  # fmt: skip
    _validity(element, reference.validity)


def _validity(element: etree._Element, ranges: Iterable[tuple[int, int]]) -> None:
    for first, last in ranges:
        _add(element, "validity", fromLane=str(first), toLane=str(last))


def _junction(root: etree._Element, junction: Junction) -> None:
    element = _add(root, "junction", id=junction.id, name=junction.name, type=junction.type)
    # Direct junctions link roads, not connecting roads (OpenDRIVE 1.9, 12.6).
    entered = "linkedRoad" if junction.type == "direct" else "connectingRoad"
    for number, way in enumerate(junction.connections):
        ends = {"incomingRoad": way.incoming_road, entered: way.connecting_road}
        child = _add(
            element, "connection", id=way.id or str(number), **ends, contactPoint=way.contact
        )
        for here, there in way.lane_links:
            _add(child, "laneLink", **{"from": str(here.id), "to": str(there.id)})
    for high, low in junction.priorities:
        _add(element, "priority", high=high, low=low)
    for sequence, controller in enumerate(junction.controllers):
        _add(element, "controller", id=controller, sequence=str(sequence))
