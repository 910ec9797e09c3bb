"""OpenDRIVE roads as lanelets: each lane of each lane section with its bounds, in the direction of
its traffic.

This module owns the sides: left and right of a lanelet are those of its traffic, whatever the
lane's sign and whether the traffic keeps to the right or the left.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache

from schemas.common.array_types import FloatArray
from xodr.graph.links import next_lane
from xodr.graph.network import RoadNetwork
from xodr.lookup.arrays import Points, sample, section_stations
from xodr.model import NO_WIDTH, Lane, LaneSection
from xodr.model.road import Road

SPACING = 2.0
"""Greatest distance (m) of the points of a bound, along the road."""
CHORD_ERROR = 0.01
"""Greatest distance (m) of a bound from the lines between its points."""

_INSIDE = 1e-5
"""Distance (m) from its borders at which a raised lane is looked at."""

Key = tuple[str, int, int]
"""A lane: road id, number of its section, lane id."""
Paint = tuple[str, str, float | None]


@dataclass(eq=False)
class ExportedLanelet:
    """A lanelet.

    Attributes:
        key: the lane that it is.
        left, right: its bounds in driving direction, world coordinates (n, 3) in m.
        paint: type, colour and width (m, None where the file does not say) of the road marks on the
            left and right bound, as in OpenDRIVE; type "none" where there are none.
        lane_type, road_type: as in OpenDRIVE.
        in_junction: whether its road connects others in a junction.
        limit: speed limit in m/s, None where there is none.
        successors, predecessors: lanelets ahead and behind.
        beside: the lanelet to the left and the one to the right, and whether it leads the same way;
            None where none is.
    """

    key: Key
    left: Points
    right: Points
    paint: tuple[Paint, Paint]
    lane_type: str
    road_type: str
    in_junction: bool
    limit: float | None
    successors: list[Key] = field(default_factory=list)
    predecessors: list[Key] = field(default_factory=list)
    beside: tuple[tuple[Key, bool] | None, tuple[Key, bool] | None] = (None, None)

    @property
    def marks(self) -> tuple[str, str]:
        """Types of the road marks on the left and right bound."""
        return self.paint[0][0], self.paint[1][0]

    @property
    def centre(self) -> Points:
        """The line in the middle, in driving direction, world coordinates (n, 3) in m."""
        return 0.5 * (self.left + self.right)


@lru_cache(maxsize=8)
def lanelets(network: RoadNetwork) -> dict[Key, ExportedLanelet]:
    """All lanes with a width and a use, with their links and neighbours.

    Runs on one network share them, so they are not to be changed.
    """
    found = {
        lanelet.key: lanelet
        for road in network.roads.values()
        for number in range(len(road.sections))
        for lanelet in _of_section(network, road, number)
    }
    # Only now: lanes link and lie beside others that are built after them.
    for lanelet in found.values():
        lanelet.successors = [key for key in _ahead(network, lanelet.key) if key in found]
        lanelet.beside = (
            _beside(network, found, lanelet.key, 1),
            _beside(network, found, lanelet.key, -1),
        )
    for lanelet in found.values():
        for key in lanelet.successors:
            found[key].predecessors.append(lanelet.key)
    return found


def _of_section(network: RoadNetwork, road: Road, number: int) -> Iterator[ExportedLanelet]:
    section = road.sections[number]
    along = section_stations(road, section, CHORD_ERROR, SPACING)
    for lane in section.lanes.values():
        widths = [lane.width(s) for s in along.tolist()]
        if not lane.id or lane.type == "none" or max(widths) <= NO_WIDTH:
            continue
        marks = (_mark(_inwards(section, lane)), _mark(lane))
        towards_s = road.direction(lane.id, section.s) > 0
        left, right = sides(road, lane, along, towards_s)
        yield ExportedLanelet(
            key=(road.id, number, lane.id),
            left=left,
            right=right,
            # Marks are (inner, outer); the inner one is to the left where traffic has the centre
            # there.
            paint=marks if (lane.id < 0) == towards_s else marks[::-1],
            lane_type=lane.type,
            road_type=road.road_type(section.s),
            in_junction=road.junction_id in network.junctions,
            limit=road.speed_limit(section.s, lane.id),
        )


def sides(road: Road, lane: Lane, along: FloatArray, towards_s: bool) -> tuple[Points, Points]:
    """Left and right bound of a lane for traffic that goes towards +s or against it.

    Args:
        along: places in ascending order of s, (n,), m.

    Returns:
        World coordinates in the direction of the traffic, (n, 3) each, m.
    """
    inner, outer = _bounds(road, lane, along)
    left, right = (inner, outer) if (lane.id < 0) == towards_s else (outer, inner)
    step = 1 if towards_s else -1
    return left[::step], right[::step]


def _bounds(road: Road, lane: Lane, along: FloatArray) -> tuple[Points, Points]:
    """Inner and outer border of a lane at its own height, which differs on both sides of a kerb."""
    aside = [(lane.inner(s), lane.outer(s)) for s in along.tolist()]
    if lane.heights:
        # On the very border the height would be that of the neighbour, below the kerb.
        towards = _INSIDE if lane.id > 0 else -_INSIDE
        aside = [(inner + towards, outer - towards) for inner, outer in aside]
    inner, outer = (sample(road, along, [pair[side] for pair in aside]) for side in (0, 1))
    return inner, outer


def _inwards(section: LaneSection, lane: Lane) -> Lane:
    """Next lane towards the centre: its mark lies on the inner border."""
    return section.lanes.get(lane.id - 1 if lane.id > 0 else lane.id + 1, section.lanes[0])


def _mark(lane: Lane) -> Paint:
    return lane.marks[0][1:4] if lane.marks else ("none", "standard", None)


def _ahead(network: RoadNetwork, key: Key) -> Iterator[Key]:
    """The lanes that a lane's traffic goes on in."""
    road_id, number, lane_id = key
    road = network.roads[road_id]
    lane = road.sections[number].lanes[lane_id]
    forward = road.direction(lane_id, road.sections[number].s) > 0
    following = number + (1 if forward else -1)
    if 0 <= following < len(road.sections):
        onward = next_lane(lane, road.sections[following], forward)
        if onward is not None:
            yield road_id, following, onward
        return
    for link in network.links(road_id, lane_id, forward):
        other = network.roads[link.road_id]
        entered = 0 if link.at_start else len(other.sections) - 1
        # Links join lanes, whatever their traffic; it enters only where it drives away from the
        # road's end.
        if (other.direction(link.lane_id, other.sections[entered].s) > 0) == link.at_start:
            yield link.road_id, entered, link.lane_id


def _beside(
    network: RoadNetwork, found: dict[Key, ExportedLanelet], key: Key, left: int
) -> tuple[Key, bool] | None:
    road_id, number, lane_id = key
    road = network.roads[road_id]
    s = road.sections[number].s
    direction = road.direction(lane_id, s)
    # lane_beside counts towards +t, which is to the right of traffic against s.
    neighbour = road.lane_beside(s, lane_id, left * direction)
    other = (road_id, number, neighbour or 0)
    return (other, road.direction(other[2], s) == direction) if other in found else None
