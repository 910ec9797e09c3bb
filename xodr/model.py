"""Contents of an OpenDRIVE file as plain data: lanes, links, junctions, signals, objects, and positions on roads."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

from schemas.common.errors import InvalidFile
from xodr.profiles import Profile

NO_WIDTH = 1e-6
"""Lanes narrower than this [m] are not there: nothing can be on them."""

PERMANENT, TEMPORARY = "permanent", "temporary"
"""Layers of lanes (OpenDRIVE 1.9). Asked for as a layer, TEMPORARY means: temporary lanes where there are some, which take
precedence for driving, and permanent ones elsewhere. PERMANENT means the permanent ones everywhere."""


class RoadError(InvalidFile):
    """A road, lane or junction was asked for that the road network does not have."""


class Pose(NamedTuple):
    """Position [m] and orientation [rad] in the world.

    h: heading of the road (+s direction), not wrapped. pitch: rotation about the left-pointing axis, so positive where
    the road descends. roll: superelevation, positive where the left side is higher (ISO 8855, as in OpenSCENARIO).
    """

    x: float
    y: float
    z: float
    h: float
    pitch: float
    roll: float


class RoadPoint(NamedTuple):
    """A place on a road: s along the reference line, t to its left, and the lane there.

    offset: t minus the t of the lane's centre, so positive towards +t whatever the traffic's direction.
    layer: the lanes that it keeps to, where the road has two layers of them.
    """

    road_id: str
    s: float
    t: float
    lane_id: int
    offset: float
    layer: str = TEMPORARY


class LaneRef(NamedTuple):
    """A lane as links name it: by its id and its layer."""

    id: int
    layer: str = PERMANENT


class LaneLink(NamedTuple):
    """A lane that can be entered: at the start (s = 0) or the end of its road, or between them at a virtual junction.

    at_start: at the start, or inside towards +s. s: place inside the road; None at its start or end.
    """

    road_id: str
    lane_id: int
    at_start: bool
    s: float | None = None


class RoadMark(NamedTuple):
    """The marking on a lane's outer border (of lane 0: on the centre line) from s on, up to the next one.

    type: as in the file: "none", "solid", "broken", "solid broken" (inside, outside), "curb", … color: "standard" is white.
    width [m]: None where the file does not say.
    """

    s: float
    type: str
    color: str
    width: float | None


@dataclass(slots=True)
class Lane:
    """One lane within one lane section. All profiles are functions of the road's s.

    predecessor, successor: the lane that continues it in the neighbouring section, as resolved by the reader.
    predecessors, successors: every link in the file. layer: PERMANENT or TEMPORARY.
    road_works: closed to traffic (OpenDRIVE 1.8).
    direction: "standard" (by lane id and traffic rule), "reversed" or "both" (OpenDRIVE 1.8).
    opens, closes: s before and after which the lane has no width within its section; infinite where it has some at the end.
    speeds: (s, limit [m/s] or None for none) in ascending s. marks: in ascending s.
    """

    id: int
    type: str
    level: bool
    predecessor: int | None
    successor: int | None
    width: Profile
    inner: Profile
    outer: Profile
    center: Profile
    direction: str = "standard"
    opens: float = -math.inf
    closes: float = math.inf
    speeds: tuple[tuple[float, float | None], ...] = ()
    marks: tuple[RoadMark, ...] = ()
    layer: str = PERMANENT
    predecessors: tuple[LaneRef, ...] = ()
    successors: tuple[LaneRef, ...] = ()
    road_works: bool = False

    def closed(self, s: float, forward: bool) -> bool:
        """Whether the lane has narrowed to nothing at s, and has no width ahead in its section."""
        return s >= self.closes if forward else s <= self.opens


@dataclass(slots=True)
class LaneSection:
    """A stretch of road with an unchanging set of lanes.

    lanes: by id, including the centre lane 0 (no width). left, right: lane ids from the reference line outwards.
    """

    s: float
    end: float
    lanes: dict[int, Lane]
    left: tuple[int, ...] = field(init=False)
    right: tuple[int, ...] = field(init=False)

    def __post_init__(self) -> None:
        self.left = tuple(sorted(lane for lane in self.lanes if lane > 0))
        self.right = tuple(sorted((lane for lane in self.lanes if lane < 0), reverse=True))


class RoadLink(NamedTuple):
    """Link at one end of a road.

    element_type: "road" or "junction". contact: "start" or "end" of that road; None for junctions.
    s: place inside that road, at a virtual junction; None otherwise.
    """

    element_type: str
    element_id: str
    contact: str | None
    s: float | None = None


class Connection(NamedTuple):
    """One way through a junction: from a road's lanes to those of the road that it leads to.

    contact: which end of `connecting_road` is entered. In direct junctions `connecting_road` is the linked road.
    lane_links: (from, to) lanes; empty where the file leaves them out.
    """

    id: str
    incoming_road: str
    connecting_road: str
    contact: str
    lane_links: tuple[tuple[LaneRef, LaneRef], ...]


@dataclass(slots=True)
class Junction:
    """A junction. type: "default", "direct", "virtual" or "crossing"."""

    id: str
    name: str
    type: str
    connections: tuple[Connection, ...]
    controllers: tuple[str, ...] = ()


class Controller(NamedTuple):
    """A group of signals switched together."""

    id: str
    name: str
    sequence: int | None
    signals: tuple[str, ...]


@dataclass(slots=True)
class Signal:
    """A traffic sign or light.

    orientation: "+", "-" or "none": for traffic in that s direction. validity: (from, to) lane ranges; empty means all lanes.
    """

    id: str
    road_id: str
    s: float
    t: float
    name: str
    dynamic: bool
    type: str
    subtype: str
    country: str
    orientation: str
    value: float | None
    unit: str
    text: str
    z_offset: float
    h_offset: float
    width: float | None
    height: float | None
    validity: tuple[tuple[int, int], ...]


class SignalReference(NamedTuple):
    """A signal of another road that also holds here."""

    signal_id: str
    s: float
    t: float
    orientation: str
    validity: tuple[tuple[int, int], ...]


class Corner(NamedTuple):
    """An outline's corner: (u, v, z) in the object's frame, or (s, t, dz) on the road where `on_road`."""

    u: float
    v: float
    z: float
    height: float
    on_road: bool


@dataclass(slots=True)
class RoadObject:
    """A static object beside or on the road, with its bounding dimensions [m] and outlines."""

    id: str
    road_id: str
    s: float
    t: float
    name: str
    type: str
    subtype: str
    orientation: str
    z_offset: float
    heading: float
    pitch: float
    roll: float
    length: float | None
    width: float | None
    radius: float | None
    height: float | None
    outlines: tuple[tuple[Corner, ...], ...]
    validity: tuple[tuple[int, int], ...]


class Structure(NamedTuple):
    """A bridge or tunnel that carries or covers a stretch of its road.

    Attributes:
        kind: "bridge" or "tunnel".
        id, name, type: as in the file.
        s: start of the stretch, m.
        length: m.
    """

    kind: str
    id: str
    name: str
    type: str
    s: float
    length: float


class RoadType(NamedTuple):
    """Kind of road from `s` on, with its speed limit [m/s], None where there is none."""

    s: float
    type: str
    speed: float | None


class Header(NamedTuple):
    """Header of the file: version, name, PROJ string, and the offset that was applied to inertial coordinates.

    offset: (x, y, z, heading) as in the `offset` element of OpenDRIVE 1.5 and later.
    """

    version: tuple[int, int]
    name: str
    geo_reference: str | None
    offset: tuple[float, float, float, float]
