"""Contents of an OpenDRIVE file as plain data: lanes, links, junctions, signals, objects, and
positions on roads.

A road has permanent lanes all along, and may have temporary ones in places (OpenDRIVE 1.9).
Temporary lanes take precedence for driving. A side of the road without temporary lanes keeps its
permanent ones, but for those that temporary lanes cover.

Modules:

- `geometry`: plan-view geometry of the road reference line (OpenDRIVE "Geometry"): line, arc
- `road`: one road: from (s, t) to the world, and its lanes at every s

Example::

    network.roads["1"].length
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import NamedTuple, TypeAlias

from schemas.common.errors import InvalidFile
from xodr.model.geometry import Profile, exceeding

# contents of a file -----------------------------------------------------------------------------


NO_WIDTH = 1e-6
"""Lanes narrower than this [m] are not there: nothing can be on them."""

PERMANENT, TEMPORARY = "permanent", "temporary"
"""Layers of lanes (OpenDRIVE 1.9). Asked for as a layer, TEMPORARY means: temporary lanes where
there are some, which take precedence for driving, and permanent ones elsewhere. PERMANENT means the
permanent ones everywhere."""


class RoadError(InvalidFile):
    """A road, lane or junction was asked for that the road network does not have."""


class WorldPose(NamedTuple):
    """Position [m] and orientation [rad] in the world.

    h: heading of the road (+s direction), not wrapped. pitch: rotation about the left-pointing
    axis, so positive where the road descends. roll: superelevation, positive where the left side is
    higher (ISO 8855, as in OpenSCENARIO).
    """

    x: float
    y: float
    z: float
    h: float
    pitch: float
    roll: float


class RoadPoint(NamedTuple):
    """A place on a road: s along the reference line, t to its left, and the lane there.

    offset: t minus the t of the lane's centre, so positive towards +t whatever the traffic's
    direction. layer: the lanes that it keeps to, where the road has two layers of them.
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
    """A lane that can be entered: at the start (s = 0) or the end of its road, or between them at a
    virtual junction.

    at_start: at the start, or inside towards +s. s: place inside the road; None at its start or
    end.
    """

    road_id: str
    lane_id: int
    at_start: bool
    s: float | None = None


class RoadMark(NamedTuple):
    """The marking on a lane's outer border (of lane 0: on the centre line) from s on, up to the
    next one.

    type: as in the file: "none", "solid", "broken", "solid broken" (inside, outside), "curb", …
    color: "standard" is white. width [m]: None where the file does not say.
    lane_change: directions of lane ids in which changes are allowed: "increase", "decrease", "both"
    or
    "none"; empty where the file does not say.
    """

    s: float
    type: str
    color: str
    width: float | None
    lane_change: str = ""


class LaneAccess(NamedTuple):
    """Road users that are allowed on a lane, to the exclusion of others, or denied, from s on; none
    at all: no restriction."""

    s: float
    allowed: bool
    users: tuple[str, ...]


@dataclass(slots=True)
class Lane:
    """One lane within one lane section. All profiles are functions of the road's s.

    predecessor, successor: the lane that continues it in the neighbouring section, as resolved by
    the reader. predecessors, successors: every link in the file. layer: PERMANENT or TEMPORARY.
    road_works: closed to traffic (OpenDRIVE 1.8). direction: "standard" (by lane id and traffic
    rule), "reversed" or "both" (OpenDRIVE 1.8). opens, closes: s before and after which the lane
    has no width within its section; infinite where it has some at the end. speeds: (s, limit [m/s]
    or None for none) in ascending s. marks, accesses: in ascending s. heights: (s, inner, outer [m]
    above the road's surface) in ascending s.
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
    accesses: tuple[LaneAccess, ...] = ()
    heights: tuple[tuple[float, float, float], ...] = ()

    def height(self, s: float, t: float) -> float:
        """Height [m] of the lane above the road's surface at (s, t), for t on the lane (OpenDRIVE
        11.7.3).

        The standard does not say how the height changes between two records; it is interpolated
        linearly in s and in t.
        """
        if not self.heights:
            return 0.0
        index = max(bisect_right(self.heights, s, key=lambda record: record[0]) - 1, 0)
        start, inner, outer = self.heights[index]
        if index + 1 < len(self.heights):
            end, following_inner, following_outer = self.heights[index + 1]
            share = min(max((s - start) / (end - start), 0.0), 1.0) if end > start else 0.0
            inner += share * (following_inner - inner)
            outer += share * (following_outer - outer)
        width = self.width(s)
        across = min(max(abs(t - self.inner(s)) / width, 0.0), 1.0) if width > NO_WIDTH else 0.0
        return inner + across * (outer - inner)

    def closed(self, s: float, forward: bool) -> bool:
        """Whether the lane has narrowed to nothing at s, and has no width ahead in its section."""
        return s >= self.closes if forward else s <= self.opens


Borders: TypeAlias = tuple[list[float], list[int]]
"""Distances [m] of outer borders of lanes from the centre lane, ascending, and the lanes' ids."""


@dataclass(slots=True)
class LaneSection:
    """A stretch of road with an unchanging set of lanes.

    lanes: by id, including the centre lane 0 (no width). left, right: lane ids from the reference
    line outwards. borders: where all lanes keep their t, the ascending distances [m] of the outer
    borders from the centre lane, left and right, of lanes that have a width, with their ids; else
    None.
    """

    s: float
    end: float
    lanes: dict[int, Lane]
    left: tuple[int, ...] = field(init=False)
    right: tuple[int, ...] = field(init=False)
    borders: tuple[Borders, Borders] | None = field(init=False)

    def __post_init__(self) -> None:
        self.left = tuple(sorted(lane for lane in self.lanes if lane > 0))
        self.right = tuple(sorted((lane for lane in self.lanes if lane < 0), reverse=True))
        left, right = self._borders(self.left), self._borders(self.right)
        self.borders = None if left is None or right is None else (left, right)

    def _borders(self, lane_ids: tuple[int, ...]) -> Borders | None:
        center = self.lanes[0].center.constant
        borders: dict[int, float] = {}
        for lane_id in lane_ids:
            outer, width = self.lanes[lane_id].outer.constant, self.lanes[lane_id].width.constant
            if center is None or outer is None or width is None:
                return None
            if width > NO_WIDTH:
                # A lane without width lies nowhere.
                borders[lane_id] = abs(outer - center)
        distances = list(borders.values())
        # Widths below 0 lay borders back towards the centre, where bisection finds nothing.
        return (distances, list(borders)) if distances == sorted(distances) else None


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

    contact: which end of `connecting_road` is entered. In direct junctions `connecting_road` is the
    linked road. lane_links: (from, to) lanes; empty where the file leaves them out.
    """

    id: str
    incoming_road: str
    connecting_road: str
    contact: str
    lane_links: tuple[tuple[LaneRef, LaneRef], ...]


class CrossPathEnd(NamedTuple):
    """Place at which a cross path meets a lane: that lane at s of its road, and the lane of the
    cross path's own road."""

    road_id: str
    s: float
    lane_id: int
    own_lane: int


class CrossPath(NamedTuple):
    """A way for pedestrians or cyclists across a junction: a road of its own between lanes of
    others (OpenDRIVE 1.8)."""

    id: str
    road_id: str
    start: CrossPathEnd
    end: CrossPathEnd


class BoundarySegment(NamedTuple):
    """A stretch of a junction's boundary: along the outer border of a lane, or across a road (a
    joint).

    start, end: s along a lane; at a joint both are its s. lanes: the lane, or those that a joint
    begins and ends with, None for all lanes.
    """

    road_id: str
    start: float
    end: float
    lanes: tuple[int | None, int | None]
    joint: bool


@dataclass(slots=True)
class Junction:
    """A junction. type: "default", "direct", "virtual" or "crossing".

    priorities: pairs of connecting roads (high, low): traffic of the first has the right of way.
    boundary: counter-clockwise.
    """

    id: str
    name: str
    type: str
    connections: tuple[Connection, ...]
    controllers: tuple[str, ...] = ()
    priorities: tuple[tuple[str, str], ...] = ()
    cross_paths: tuple[CrossPath, ...] = ()
    boundary: tuple[BoundarySegment, ...] = ()


class Controller(NamedTuple):
    """A group of signals switched together."""

    id: str
    name: str
    sequence: int | None
    signals: tuple[str, ...]


@dataclass(slots=True)
class Signal:
    """A traffic sign or light.

    orientation: "+", "-" or "none": for traffic in that s direction. validity: (from, to) lane
    ranges; empty means all lanes. priority: its meaning for the right of way, as in the element
    `priority` of its semantics (since 1.8), e.g. "stopLine".
    """

    id: str
    road_id: str
    s: float
    t: float
    name: str = ""
    dynamic: bool = False
    type: str = ""
    subtype: str = ""
    country: str = ""
    orientation: str = "none"
    value: float | None = None
    unit: str = ""
    text: str = ""
    z_offset: float = 0.0
    h_offset: float = 0.0
    width: float | None = None
    height: float | None = None
    validity: tuple[tuple[int, int], ...] = ()
    priority: str = ""


class SignalReference(NamedTuple):
    """A signal of another road that also holds here."""

    signal_id: str
    s: float
    t: float
    orientation: str
    validity: tuple[tuple[int, int], ...]


class OutlineCorner(NamedTuple):
    """An outline's corner: (u, v, z) in the object's frame, or (s, t, dz) on the road where
    `on_road`."""

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
    name: str = ""
    type: str = ""
    subtype: str = ""
    orientation: str = "none"
    z_offset: float = 0.0
    heading: float = 0.0
    pitch: float = 0.0
    roll: float = 0.0
    length: float | None = None
    width: float | None = None
    radius: float | None = None
    height: float | None = None
    outlines: tuple[tuple[OutlineCorner, ...], ...] = ()
    validity: tuple[tuple[int, int], ...] = ()


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
    """Header of the file: version, name, PROJ string, and the offset that was applied to inertial
    coordinates.

    offset: (x, y, z, heading) as in the `offset` element of OpenDRIVE 1.5 and later.
    """

    version: tuple[int, int]
    name: str
    geo_reference: str | None
    offset: tuple[float, float, float, float]


# layers of lanes --------------------------------------------------------------------------------


NEAR = 1e-3
"""A border of lane sections so near [m] is taken for the place."""


class TemporaryStretch(NamedTuple):
    """A section of the temporary layer, and the s up to which its lanes hold on the left and on the
    right side of the road."""

    section: LaneSection
    left_end: float
    right_end: float


class _SectionInForce(NamedTuple):
    """A section in force, and the section of the file that each of its lanes is from."""

    section: LaneSection
    sources: dict[int, LaneSection]


def in_force(
    permanent: Sequence[LaneSection], temporary: Sequence[TemporaryStretch]
) -> list[LaneSection]:
    """Lane sections in force on a road: temporary lanes in place of permanent ones, linked anew."""
    # Files round: a border a hair off a permanent one would leave a section of that hair.
    stretches = [
        TemporaryStretch(stretch.section, *(_snapped(permanent, end) for end in stretch[1:]))
        for stretch in temporary
    ]
    starts = {_snapped(permanent, stretch.section.s) for stretch in stretches}
    borders = sorted(
        {
            permanent[0].s,
            permanent[-1].end,
            *starts,
            *(end for stretch in stretches for end in stretch[1:]),
        }
    )
    pieces = [
        piece
        for start, end in pairwise(borders)
        for piece in _pieces(permanent, stretches, start, end)
    ]
    for before, after in pairwise(pieces):
        for lane in before.section.lanes.values():
            back = {other.id: other.predecessors for other in after.section.lanes.values()}
            lane.successor = _linked(lane, lane.successors, back, before, after)
        for lane in after.section.lanes.values():
            back = {other.id: other.successors for other in before.section.lanes.values()}
            lane.predecessor = _linked(lane, lane.predecessors, back, after, before)
    return [piece.section for piece in pieces]


def _snapped(permanent: Sequence[LaneSection], s: float) -> float:
    border = min(
        (permanent[0].s, *(section.end for section in permanent)),
        key=lambda border: abs(border - s),
    )
    return border if abs(border - s) <= NEAR else s


def _pieces(
    permanent: Sequence[LaneSection],
    temporary: Sequence[TemporaryStretch],
    start: float,
    end: float,
) -> Iterator[_SectionInForce]:
    """The sections in force between two neighbouring borders of the temporary layer."""
    holding = [
        stretch.section
        for stretch in temporary
        if stretch.section.left and stretch.section.s - NEAR <= start < stretch.left_end
    ]
    # Of several that hold, the one that began last.
    left = holding[-1] if holding else None
    holding = [
        stretch.section
        for stretch in temporary
        if stretch.section.right and stretch.section.s - NEAR <= start < stretch.right_end
    ]
    right = holding[-1] if holding else None
    if left and right:
        yield _joined(start, end, right, ((left, left.left), (right, right.right)))
        return
    for usual in permanent:
        low, high = max(start, usual.s), min(end, usual.end)
        if low >= high:
            continue
        if left:
            yield _joined(
                low,
                high,
                left,
                ((left, left.left), (usual, _free(usual.right, usual, left, low, high))),
            )
        elif right:
            yield _joined(
                low,
                high,
                right,
                ((usual, _free(usual.left, usual, right, low, high)), (right, right.right)),
            )
        else:
            yield _joined(low, high, usual, ((usual, usual.left), (usual, usual.right)))


def _free(
    side: Sequence[int], usual: LaneSection, other: LaneSection, low: float, high: float
) -> list[int]:
    """Permanent lanes of one side with a centre that no temporary lane of the other side covers."""
    # The set of lanes is the same all along the piece, so its middle decides.
    s = 0.5 * (low + high)
    covered = [sorted((lane.inner(s), lane.outer(s))) for lane in other.lanes.values() if lane.id]
    centres = {lane_id: usual.lanes[lane_id].center(s) for lane_id in side}
    return [
        lane_id
        for lane_id in side
        if not any(inner < centres[lane_id] < outer for inner, outer in covered)
    ]


def _joined(
    start: float,
    end: float,
    middle: LaneSection,
    sides: Sequence[tuple[LaneSection, Sequence[int]]],
) -> _SectionInForce:
    """A section made of the centre lane of one section and lanes of others."""
    sources = {0: middle, **{lane_id: section for section, ids in sides for lane_id in ids}}
    lanes = {
        lane_id: cut(section.lanes[lane_id], start, end) for lane_id, section in sources.items()
    }
    return _SectionInForce(LaneSection(start, end, lanes), sources)


def _linked(
    lane: Lane,
    declared: Sequence[LaneRef],
    back: Mapping[int, Sequence[LaneRef]],
    here: _SectionInForce,
    there: _SectionInForce,
) -> int | None:
    """Lane of a neighbouring section that continues a lane.

    It is the lane itself where only the other side of the road changes.

    back: the links of the neighbouring section's lanes, for links that only one of two lanes
    declares.
    """
    # Cut out of one lane of the file, it goes on in itself; its links are for the ends of that.
    if not lane.id or here.sources[lane.id] is there.sources.get(lane.id):
        return lane.id or None
    found = [link.id for link in declared if has(there.section, link)]
    return next(
        iter(
            found
            or [other for other, links in back.items() if LaneRef(lane.id, lane.layer) in links]
        ),
        None,
    )


def has(section: LaneSection, link: LaneRef) -> bool:
    """Whether the lane that a link names is one of a section."""
    lane = section.lanes.get(link.id)
    return lane is not None and lane.layer == link.layer


def cut(lane: Lane, start: float, end: float) -> Lane:
    """A lane between two s, with the marks that hold there."""
    opens, closes = (
        # A lane that closes within its section may be open all along a part of it.
        exceeding(lane.width, NO_WIDTH, start, end) if lane.id else (lane.opens, lane.closes)
    )
    before, marks = (
        [mark for mark in lane.marks if mark.s < start],
        [mark for mark in lane.marks if start <= mark.s < end],
    )
    # The mark in force at the cut holds from there on.
    if before and not (marks and marks[0].s == start):
        marks.insert(0, before[-1]._replace(s=start))
    return replace(lane, opens=opens, closes=closes, marks=tuple(marks))
