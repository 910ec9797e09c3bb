"""One road: from (s, t) to the world, and its lanes at every s.

This module owns the conventions of OpenDRIVE roads: s runs along the reference line, t to its left;
lane ids are positive on the left, negative on the right and count outwards from the centre lane 0,
which has no width. Traffic in right-hand traffic (RHT) drives towards +s on the right lanes and
towards −s on the left ones; left-hand traffic (LHT) is the mirror. The surface is tilted by
superelevation about the reference line: t is measured on the tilted surface.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from dataclasses import dataclass, field, replace

from xodr.model import (
    NO_WIDTH,
    PERMANENT,
    Lane,
    LaneSection,
    RoadError,
    RoadLink,
    RoadObject,
    RoadPoint,
    RoadType,
    Signal,
    SignalReference,
    Structure,
    WorldPose,
)
from xodr.model.geometry import ZERO, Profile, ReferenceLine

_ON_BORDER = 1e-6
"""Distance [m] beyond the border of a lane that counts as on it."""


@dataclass(slots=True)
class Surface:
    """Height above the reference line's plane, as a function of s and t (`shape` and, until 1.4,
    `crossfall`).

    shape: (s, records in t) in ascending s, heights interpolated linearly in s between them.
    crossfall_left, crossfall_right: angles [rad], positive where the road falls outwards.
    """

    shape: list[tuple[float, Profile]] = field(default_factory=list)
    crossfall_left: Profile = ZERO
    crossfall_right: Profile = ZERO

    def height(self, s: float, t: float) -> float:
        """Height [m] to be added at (s, t)."""
        crossfall = self.crossfall_left if t > 0.0 else self.crossfall_right
        height = -abs(t) * math.tan(crossfall(s))
        if not self.shape:
            return height
        index = bisect_right(self.shape, s, key=lambda record: record[0]) - 1
        start, profile = self.shape[max(index, 0)]
        # Nothing to interpolate with before the first record and after the last.
        if index < 0 or index + 1 == len(self.shape):
            return height + profile(t)
        end, following = self.shape[index + 1]
        share = (s - start) / (end - start)
        return height + (1.0 - share) * profile(t) + share * following(t)


@dataclass(slots=True, eq=False)
class Road:
    """A road with its geometry, lanes and road objects.

    path: the file, for complaints. junction_id: the junction that a connecting road belongs to.
    rule: "RHT" or "LHT". in_force: of a road without its temporary lanes, the one with them; else
    None. sections: the lanes in force. permanent: the permanent ones where the road has temporary
    lanes, too, else None; see `on`. flat: no elevation, superelevation, surface shape or raised
    lane: z, pitch and roll are 0 everywhere.
    """

    path: str
    id: str
    name: str
    length: float
    junction_id: str | None
    rule: str
    line: ReferenceLine
    sections: list[LaneSection]
    elevation: Profile = ZERO
    superelevation: Profile = ZERO
    surface: Surface | None = None
    types: list[RoadType] = field(default_factory=list)
    predecessor: RoadLink | None = None
    successor: RoadLink | None = None
    signals: list[Signal] = field(default_factory=list)
    signal_references: list[SignalReference] = field(default_factory=list)
    objects: list[RoadObject] = field(default_factory=list)
    structures: list[Structure] = field(default_factory=list)
    permanent: list[LaneSection] | None = None
    flat: bool = field(init=False)
    _starts: list[float] = field(init=False)
    _levels: bool = field(init=False)
    _raised: bool = field(init=False)
    _left_direction: int = field(init=False)
    _standard: bool = field(init=False)
    in_force: Road | None = field(init=False, default=None)
    _on_permanent: Road | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        lanes = [lane for section in self.sections for lane in section.lanes.values()]
        surface = [
            lane for section in self.permanent or self.sections for lane in section.lanes.values()
        ]
        self._raised = any(lane.heights for lane in surface)
        # Most roads are flat, for which a pose is much cheaper.
        level = (
            self.elevation.constant == 0.0
            and self.superelevation.constant == 0.0
            and self.surface is None
        )
        self.flat = level and not self._raised
        self._starts = [section.s for section in self.sections]
        # `level` means that superelevation does not tilt the lane: without it, all are alike.
        self._levels = (
            any(lane.level for lane in surface if lane.id) and self.superelevation.constant != 0.0
        )
        self._left_direction = -1 if self.rule == "RHT" else 1
        self._standard = all(lane.direction != "reversed" for lane in lanes)

    def on(self, layer: str) -> Road:
        """The road for road users that keep to a layer of lanes: itself, or without its temporary
        lanes for PERMANENT."""
        if layer != PERMANENT or self.permanent is None:
            return self
        if self._on_permanent is None:
            self._on_permanent = replace(self, sections=self.permanent, permanent=None)
            self._on_permanent.in_force = self
        return self._on_permanent

    # geometry -------------------------------------------------------------------------------

    def pose(self, s: float, t: float = 0.0) -> WorldPose:
        """World pose of (s, t); before 0 and beyond the length the road goes on straight."""
        if self.flat:
            x, y, h = self.from_above(s, t)
            return WorldPose(x, y, 0.0, h, 0.0, 0.0)
        roll = self.superelevation(s)
        slope = self.elevation.slope(s)
        z = self.elevation(s) + (self.surface.height(s, t) if self.surface else 0.0)
        # Turned about the reference line: the tilted part shortens as seen from above, what lies
        # beyond it is only raised.
        if roll:
            tilted = self._tilted_part(s, t)
            z += tilted * math.sin(roll)
            z += self.lane_height(s, t) * math.cos(roll)
            t += tilted * (math.cos(roll) - 1.0)
        elif self._raised:
            z += self.lane_height(s, t)
        x, y, h = self.from_above(s, t)
        return WorldPose(x, y, z, h, -math.atan(slope), roll)

    def lane_height(self, s: float, t: float) -> float:
        """Height [m] of the lane at (s, t) above the road's surface, along its normal: 0.15 on a
        raised sidewalk.

        Permanent lanes count: temporary ones have no height. Beyond the road it is 0.
        """
        if not self._raised:
            return 0.0
        section = self.on(PERMANENT).section(s)
        lane = section.lanes[lane_in(section, s, t)]
        low, high = sorted((lane.inner(s), lane.outer(s)))
        return lane.height(s, t) if low - _ON_BORDER <= t <= high + _ON_BORDER else 0.0

    def from_above(self, s: float, aside: float) -> tuple[float, float, float]:
        """x, y and heading of the place `aside` [m] to the left of the reference line, measured
        horizontally."""
        return self.line.beside(s, aside)

    def t_of(self, s: float, aside: float) -> float:
        """t of the place that lies `aside` [m] to the left of the reference line, measured
        horizontally."""
        if self.superelevation.constant == 0.0:
            return aside
        cos = math.cos(self.superelevation(s))
        t = aside / cos
        tilted = self._tilted_part(s, t)
        # What lies beyond the tilted part is horizontal and has its true length.
        return tilted + (aside - tilted * cos) if tilted != t else t

    def heading(self, s: float) -> float:
        """Heading [rad] of the reference line at s, not wrapped."""
        return self.line.at(s)[2]

    def curvature(self, s: float) -> float:
        """Curvature [1/m] of the reference line at s, positive to the left."""
        return self.line.curvature(s)

    def _tilted_part(self, s: float, t: float) -> float:
        """The part of t that superelevation tilts: `level` lanes and all beyond them stay
        horizontal."""
        if not self._levels:
            return t
        section = self.on(PERMANENT).section(s)
        for lane_id in section.left if t > 0.0 else section.right:
            lane = section.lanes[lane_id]
            if lane.level:
                return min(t, lane.inner(s)) if t > 0.0 else max(t, lane.inner(s))
        return t

    # lanes ----------------------------------------------------------------------------------

    def section(self, s: float) -> LaneSection:
        """Lane section at s (the nearest one outside the road)."""
        return self.sections[self.section_index(s)]

    def section_index(self, s: float) -> int:
        """Index of the lane section at s."""
        return max(bisect_right(self._starts, s) - 1, 0) if len(self._starts) > 1 else 0

    def lane(self, s: float, lane_id: int) -> Lane:
        """The lane with that id at s, the centre lane 0 included.

        Raises:
            RoadError: the road has no such lane there.
        """
        lanes = self.section(s).lanes
        found = lanes.get(lane_id)
        if found is None:
            there = ", ".join(str(lane) for lane in lanes if lane) or "none"
            raise RoadError(
                f"road {self.id!r} has no lane {lane_id} at s = {s:.2f} m; its "
                f"lanes there: {there}",
                path=self.path,
            )
        return found

    def lane_ids(self, s: float) -> tuple[int, ...]:
        """Lane ids at s from right to left (ascending t), without the centre lane."""
        section = self.section(s)
        return (*reversed(section.right), *section.left)

    def lane_t(self, s: float, lane_id: int) -> float:
        """t [m] of the lane's centre at s."""
        return self.lane(s, lane_id).center(s)

    def lane_slope(self, s: float, lane_id: int) -> float:
        """dt/ds of the lane's centre at s: its slope against the reference line."""
        return self.lane(s, lane_id).center.slope(s)

    def lane_width(self, s: float, lane_id: int) -> float:
        """Width [m] of the lane at s, never negative."""
        return max(self.lane(s, lane_id).width(s), 0.0)

    def lane_type(self, s: float, lane_id: int) -> str:
        """The lane's type as in the file: "driving", "sidewalk", …"""
        return self.lane(s, lane_id).type

    def lane_at(self, s: float, t: float) -> int:
        """The lane that (s, t) lies on; outside the road the nearest lane. Lanes without width are
        never meant.

        On a border the inner lane is meant, on the centre the right one. 0 only where the road has
        no lane at all.
        """
        return lane_in(self.section(s), s, t)

    def lane_beside(self, s: float, lane_id: int, steps: int) -> int | None:
        """The lane `steps` lanes away, positive towards +t (left of the s direction), the centre
        lane not counted.

        None where the road has no such lane. RelativeTargetLane of OpenSCENARIO counts towards the
        reference entity's own left: negate steps where it faces −s.
        """
        if steps == 0:
            return lane_id
        section = self.section(s)
        if lane_id == 0:
            outwards = section.left if steps > 0 else section.right
            return outwards[abs(steps) - 1] if abs(steps) <= len(outwards) else None
        ids = self.lane_ids(s)
        index = (ids.index(lane_id) if lane_id in ids else len(ids)) + steps
        return ids[index] if 0 <= index < len(ids) else None

    def point(self, s: float, t: float) -> RoadPoint:
        """The road point at (s, t) with the lane that it lies on; before and beyond the road with
        the lane at its end."""
        inside = min(max(s, 0.0), self.length)
        lane_id = self.lane_at(inside, t)
        return RoadPoint(
            self.id, s, t, lane_id, t - self.section(inside).lanes[lane_id].center(inside)
        )

    def lane_point(self, s: float, lane_id: int, offset: float = 0.0) -> RoadPoint:
        """The road point at a lane's centre, `offset` [m] towards +t; the lane id is kept however
        large the offset."""
        return RoadPoint(self.id, s, self.lane(s, lane_id).center(s) + offset, lane_id, offset)

    def edges(self, s: float) -> tuple[float, float]:
        """t of the right and left edge of the road at s, lanes of all types and layers included."""
        section = self.section(s)
        lanes = section.lanes
        right = lanes[section.right[-1] if section.right else 0].outer(s)
        left = lanes[section.left[-1] if section.left else 0].outer(s)
        if self.permanent is None:
            return right, left
        # The surface is that of both layers: temporary lanes may leave a side of the road unused.
        usual = self.on(PERMANENT).edges(s)
        return min(right, usual[0]), max(left, usual[1])

    def direction(self, lane_id: int, s: float = 0.0) -> int:
        """+1 where the lane's traffic drives towards +s, −1 where towards −s.

        s matters only on roads that reverse single lanes (OpenDRIVE 1.8). Lanes open both ways
        count by their side.
        """
        usual = self._left_direction if lane_id > 0 else -self._left_direction
        # Spares the look-up of the lane on nearly all roads.
        if self._standard or self.lane(s, lane_id).direction != "reversed":
            return usual
        return -usual

    # regulations ----------------------------------------------------------------------------

    def road_type(self, s: float) -> str:
        """Type of the road at s ("motorway", "town", …), "unknown" where the file does not say."""
        record = self._record(s)
        return record.type if record else "unknown"

    def speed_limit(self, s: float, lane_id: int | None = None) -> float | None:
        """Speed limit [m/s] of the lane, or of the road where the lane has none; None where there
        is no limit."""
        if lane_id is not None:
            speeds = [speed for start, speed in self.lane(s, lane_id).speeds if start <= s]
            if speeds:
                return speeds[-1]
        record = self._record(s)
        return record.speed if record else None

    def _record(self, s: float) -> RoadType | None:
        index = bisect_right(self.types, s, key=lambda record: record.s) - 1
        return self.types[index] if index >= 0 else None


def lane_in(section: LaneSection, s: float, t: float) -> int:
    """`Road.lane_at` within one lane section, for callers that stand on the border of two."""
    lanes = section.lanes
    center = lanes[0].center(s)
    if section.borders is not None:  # as nearly everywhere on motorways, where lanes change
        left, right = section.borders
        distances, ids = left if t > center else right
        if ids:
            # bisect_left: on a border the inner lane is meant.
            return ids[min(bisect_left(distances, abs(t - center)), len(ids) - 1)]
        distances, ids = right if t > center else left
        return ids[0] if ids else 0
    here, beyond = (section.left, section.right) if t > center else (section.right, section.left)
    nearest = 0
    for lane_id in here:
        lane = lanes[lane_id]
        if lane.width(s) > NO_WIDTH:
            nearest = lane_id
            if abs(t - center) <= abs(lane.outer(s) - center):
                break
    return nearest or next((lane_id for lane_id in beyond if lanes[lane_id].width(s) > NO_WIDTH), 0)
