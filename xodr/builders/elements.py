"""The OpenDRIVE elements that the map builders put together, and their XML (OpenDRIVE 1.7).

Plain frozen records, named after the standard's elements. Coordinates are those of the file: x, y in
metres, headings in radians, s along the reference line, t to the left, lane ids negative on the right.
The same records always give the same bytes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path

from lxml import etree

from xodr.builders.curves import Pose, Segment, advance

REVISION = (1, 7)
"""Version of the standard that is written."""


@dataclass(frozen=True)
class Cubic:
    """Cubic a + b·ds + c·ds² + d·ds³ from `s` on (lane widths)."""

    s: float
    a: float
    b: float = 0.0
    c: float = 0.0
    d: float = 0.0


@dataclass(frozen=True)
class Lane:
    """One lane of a section: type of the standard, width, the mark on its outer border, and its links."""

    type: str
    width: tuple[Cubic, ...]
    mark: str = "none"
    predecessor: int | None = None
    successor: int | None = None


@dataclass(frozen=True)
class Section:
    """Lane section from `s` on; lane 0 is implied and carries `centre_mark`."""

    s: float
    lanes: Mapping[int, Lane]
    centre_mark: str = "none"


@dataclass(frozen=True)
class Link:
    """Predecessor or successor of a road: a road with its contact point, or a junction."""

    element: str
    id: int
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
class Road:
    """A road: plan view as segments from a start pose, lane sections and links. Speed limit in m/s, infinite for none."""

    id: int
    name: str
    start: Pose
    plan: tuple[Segment, ...]
    sections: tuple[Section, ...]
    type: str
    speed_limit: float
    junction: int = -1
    predecessor: Link | None = None
    successor: Link | None = None
    signals: tuple[Signal, ...] = ()

    @property
    def length(self) -> float:
        """Length of the reference line in m."""
        return sum(segment.length for segment in self.plan)

    @property
    def end(self) -> Pose:
        """Pose at the end of the reference line."""
        pose = self.start
        for segment in self.plan:
            pose = advance(pose, segment)
        return pose


@dataclass(frozen=True)
class Connection:
    """A path through a junction: incoming road, connecting road (entered at its start) and lane pairs."""

    incoming: int
    connecting: int
    lanes: tuple[tuple[int, int], ...]


@dataclass(frozen=True)
class Junction:
    """A junction with its connections, priorities (connecting roads: high, low) and signal controllers."""

    id: int
    name: str
    connections: tuple[Connection, ...]
    priorities: tuple[tuple[int, int], ...] = ()
    controllers: tuple[int, ...] = ()


@dataclass(frozen=True)
class Controller:
    """A group of traffic lights that switch together."""

    id: int
    name: str
    signals: tuple[int, ...]


@dataclass(frozen=True)
class RoadMap:
    """A whole map, built for right-hand traffic or mirrored for left-hand traffic."""

    name: str
    roads: tuple[Road, ...]
    junctions: tuple[Junction, ...] = ()
    controllers: tuple[Controller, ...] = ()
    rule: str = "RHT"

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
        _add(root, "header", revMajor=REVISION[0], revMinor=REVISION[1], name=self.name, version="1.00", vendor="xosc-toolchain")
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
        """Write the map to `path` and return that path."""
        target = Path(path)
        target.write_bytes(self.to_xml())
        return target


# mirroring --------------------------------------------------------------------------------------


def _mirrored_road(road: Road) -> Road:
    start = Pose(road.start.x, -road.start.y, -road.start.heading)
    plan = tuple(Segment(segment.length, -segment.start, -segment.end) for segment in road.plan)
    sections = tuple(replace(s, lanes={-key: _mirrored_lane(lane) for key, lane in s.lanes.items()}) for s in road.sections)
    signals = tuple(replace(s, t=-s.t, lanes=(-s.lanes[1], -s.lanes[0])) for s in road.signals)
    return replace(road, start=start, plan=plan, sections=sections, signals=signals)


def _mirrored_lane(lane: Lane) -> Lane:
    return replace(
        lane,
        predecessor=None if lane.predecessor is None else -lane.predecessor,
        successor=None if lane.successor is None else -lane.successor,
    )


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
    limited = math.isfinite(road.speed_limit)
    _add(kind, "speed", max=road.speed_limit * 3.6 if limited else "no limit", unit="km/h")
    _plan_view(_add(element, "planView"), road)
    lanes = _add(element, "lanes")
    for section in road.sections:
        _section(lanes, section)
    if road.signals:
        signals = _add(element, "signals")
        for signal in road.signals:
            _signal(signals, signal)


def _plan_view(parent: etree._Element, road: Road) -> None:
    s, pose = 0.0, road.start
    for segment in road.plan:
        geometry = _add(parent, "geometry", s=s, x=pose.x, y=pose.y, hdg=pose.heading, length=segment.length)
        if segment.start != segment.end:
            _add(geometry, "spiral", curvStart=segment.start, curvEnd=segment.end)
        elif segment.start:
            _add(geometry, "arc", curvature=segment.start)
        else:
            _add(geometry, "line")
        s, pose = s + segment.length, advance(pose, segment)


def _section(parent: etree._Element, section: Section) -> None:
    element = _add(parent, "laneSection", s=section.s)
    left = sorted((key for key in section.lanes if key > 0), reverse=True)
    right = sorted((key for key in section.lanes if key < 0), reverse=True)
    if left:
        side = _add(element, "left")
        for key in left:
            _lane(side, key, section.lanes[key])
    centre = _add(_add(element, "center"), "lane", id="0", type="none", level="false")
    _mark(centre, section.centre_mark)
    if right:
        side = _add(element, "right")
        for key in right:
            _lane(side, key, section.lanes[key])


def _lane(side: etree._Element, key: int, lane: Lane) -> None:
    element = _add(side, "lane", id=str(key), type=lane.type, level="false")
    links = [
        (name, link) for name, link in (("predecessor", lane.predecessor), ("successor", lane.successor)) if link is not None
    ]
    if links:
        link_element = _add(element, "link")
        for name, link in links:
            _add(link_element, name, id=str(link))
    for cubic in lane.width:
        _add(element, "width", sOffset=cubic.s, a=cubic.a, b=cubic.b, c=cubic.c, d=cubic.d)
    _mark(element, lane.mark)


def _mark(parent: etree._Element, kind: str) -> None:
    change = "both" if kind == "broken" else "none"
    width = 0.12 if kind != "none" else None
    _add(parent, "roadMark", sOffset=0, type=kind, weight="standard", color="standard", width=width, laneChange=change)


def _signal(parent: etree._Element, signal: Signal) -> None:
    element = _add(
        parent, "signal", s=signal.s, t=signal.t, id=str(signal.id), name=signal.name, dynamic="yes",
        orientation=signal.orientation, zOffset=3, country="OpenDRIVE", type="1000001", subtype="-1", value=-1,
        height=1, width=0.4, hOffset=0, pitch=0, roll=0,
    )  # fmt: skip
    _add(element, "validity", fromLane=str(signal.lanes[0]), toLane=str(signal.lanes[1]))


def _junction(root: etree._Element, junction: Junction) -> None:
    element = _add(root, "junction", id=str(junction.id), name=junction.name, type="default")
    for number, connection in enumerate(junction.connections):
        child = _add(
            element, "connection", id=str(number), incomingRoad=str(connection.incoming),
            connectingRoad=str(connection.connecting), contactPoint="start",
        )  # fmt: skip
        for here, there in connection.lanes:
            _add(child, "laneLink", **{"from": str(here), "to": str(there)})
    for high, low in junction.priorities:
        _add(element, "priority", high=str(high), low=str(low))
    for sequence, controller in enumerate(junction.controllers):
        _add(element, "controller", id=str(controller), sequence=str(sequence))
