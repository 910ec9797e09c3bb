"""Lanes of a map in any format: borders, meaning and links of each lane in the direction of its
traffic.

All formats are read into a `LaneMap` and written from one (OpenDRIVE is written by way of
`xodr.formats.lanelet2.build`); differences between maps are differences between their lanes.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import product
from typing import NamedTuple

import numpy as np
import shapely

from schemas.common.array_types import FloatArray
from xodr.graph.network import RoadNetwork
from xodr.lookup.arrays import Points
from xodr.lookup.lanelets import Key, Paint, lanelets
from xodr.lookup.signals import is_stop_line, lanes_at, signal_places
from xodr.model import RoadObject
from xodr.model.road import Road

LANE_TYPES = {
    "driving", "stop", "shoulder", "biking", "sidewalk", "walking", "border", "restricted",
    "parking", "bidirectional", "median", "entry", "exit", "offRamp", "onRamp", "rail", "tram",
    "bus", "taxi", "HOV", "curb", "connectingRamp", "slipLane", "mwyEntry", "mwyExit", "special1",
    "special2", "special3", "roadWorks", "shared",
}  # fmt: skip
"""Lane types of OpenDRIVE."""
ROAD_TYPES = {
    "unknown", "rural", "motorway", "town", "lowSpeed", "pedestrian", "bicycle", "townExpressway",
    "townCollector", "townArterial", "townPrivate", "townLocal", "townPlayStreet",
}  # fmt: skip
"""Road types of OpenDRIVE."""

UNPAINTED: Paint = ("none", "standard", None)
"""A border without a mark."""


@dataclass(eq=False)
class MapLane:
    """A lane between two borders, in the direction of its traffic.

    Attributes:
        id: its name in the map.
        left, right: its borders, world coordinates (n, 3) and (m, 3), m.
        type, road_type: as in OpenDRIVE.
        limit: speed limit, m/s; None where there is none.
        marks: type, colour and width (m) of the road mark on the left and on the right border.
        in_junction: whether it leads through a junction.
        successors: lanes that it leads to.
        beside: the lane to the left and the one to the right, and whether it leads the same way;
            None where none is.
    """

    id: str
    left: Points
    right: Points
    type: str = "driving"
    road_type: str = "unknown"
    limit: float | None = None
    marks: tuple[Paint, Paint] = (UNPAINTED, UNPAINTED)
    in_junction: bool = False
    successors: list[str] = field(default_factory=list)
    beside: tuple[tuple[str, bool] | None, tuple[str, bool] | None] = (None, None)

    @cached_property
    def centre(self) -> Points:
        """The line in the middle, (n, 3), m."""
        # Then points lie abreast as a rule, and the middle keeps each bend.
        if len(self.left) == len(self.right):
            return 0.5 * (self.left + self.right)
        return 0.5 * (resampled(self.left, _MIDDLE) + resampled(self.right, _MIDDLE))

    @cached_property
    def length(self) -> float:
        """Length of the middle as seen from above, m."""
        return float(np.hypot(*np.diff(self.centre[:, :2], axis=0).T).sum())


_MIDDLE = 50
"""Points of a middle between lines of unequally many points."""


class MapSignal:
    """A sign or light.

    Args:
        id: its name in the map.
        kind: "light" or "sign".
        type, subtype, country, value, unit: as in OpenDRIVE.
        place: x, y, z of the middle of its face, m.
        heading: direction in which the face looks, rad.
        lanes: lanes on which it holds.
    """

    def __init__(
        self, id: str, kind: str, what: tuple[str, str, str, float | None, str],
        place: tuple[float, float, float],
        heading: float, lanes: tuple[str, ...],
    ) -> None:  # fmt: skip
        self.id, self.kind, self.place, self.heading, self.lanes = id, kind, place, heading, lanes
        self.type, self.subtype, self.country, self.value, self.unit = what


class MapCrosswalk(NamedTuple):
    """A crosswalk: its id in the map, and the corners of its area in their order, (n, 3), m."""

    id: str
    outline: Points


class MapStopLine(NamedTuple):
    """A line across lanes at which traffic stops.

    Attributes:
        id: its name in the map.
        line: from one of its ends to the other, (n, 3), m.
        lanes: lanes whose traffic stops there.
    """

    id: str
    line: Points
    lanes: tuple[str, ...]


class MapPole(NamedTuple):
    """A pole: its name in the map, x, y, z of its foot and its height, m (0: not known)."""

    id: str
    place: tuple[float, float, float]
    height: float


@dataclass(eq=False)
class LaneMap:
    """A map.

    Attributes:
        name: of the map.
        lanes: by id.
        signals: signs and lights.
        projection: PROJ string or code of the projection; None where the map says nothing of it.
        offset: x, y, z (m) and heading (rad) of the map's coordinates in the projection, as in
            OpenDRIVE's header.
        left_hand: whether traffic keeps to the left.
        notes: what was assumed or left out when it was read, one sentence each.
        crosswalks: areas where pedestrians cross.
        priorities: pairs of lanes of which the first has the right of way over the second.
        stop_lines, poles: at and beside the lanes.
        objects: number of the other objects by type, which no format but OpenDRIVE has.
    """

    name: str
    lanes: dict[str, MapLane]
    signals: list[MapSignal] = field(default_factory=list)
    projection: str | None = None
    offset: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    left_hand: bool = False
    notes: list[str] = field(default_factory=list)
    crosswalks: list[MapCrosswalk] = field(default_factory=list)
    priorities: list[tuple[str, str]] = field(default_factory=list)
    stop_lines: list[MapStopLine] = field(default_factory=list)
    poles: list[MapPole] = field(default_factory=list)
    objects: dict[str, int] = field(default_factory=dict)


def name_of(key: Key) -> str:
    """Name of a lane of an OpenDRIVE map: road/section/lane."""
    return "/".join(map(str, key))


def of_network(network: RoadNetwork) -> LaneMap:
    """The lanes of an OpenDRIVE map."""
    found = {
        name_of(key): MapLane(
            name_of(key), lanelet.left, lanelet.right, lanelet.lane_type, lanelet.road_type,
            lanelet.limit,
            lanelet.paint, lanelet.in_junction,
            [name_of(other) for other in lanelet.successors],
            (_named(lanelet.beside[0]), _named(lanelet.beside[1])),
        )
        for key, lanelet in lanelets(network).items()
    }  # fmt: skip
    # A map has one rule here: that of most of its roads.
    rules = [road.rule for road in network.roads.values()]
    left_hand = rules.count("LHT") > len(rules) / 2
    areas, notes = with_area(
        MapCrosswalk(f"{road.id}/{item.id}", outline_of(road, item))
        for road in network.roads.values()
        for item in road.objects
        if item.type == "crosswalk"
    )
    return LaneMap(
        network.path.stem, found, _signals(network), network.geo_reference, network.header.offset,
        left_hand, notes=notes, crosswalks=areas, priorities=_priorities(network, found),
        stop_lines=[*_marked_stop_lines(network, found), *_signed_stop_lines(network, found)],
        poles=list(_poles(network)), objects=_other_objects(network),
    )  # fmt: skip


def with_area(crosswalks: Iterable[MapCrosswalk]) -> tuple[list[MapCrosswalk], list[str]]:
    """The crosswalks that have an area, and a sentence on the others."""
    areas, lines = list[MapCrosswalk](), list[str]()
    for crosswalk in crosswalks:
        hull = shapely.MultiPoint(crosswalk.outline[:, :2]).convex_hull
        if hull.area > _LEAST_AREA:
            areas.append(crosswalk)
        else:
            lines.append(crosswalk.id)
    return areas, [f"crosswalks without an area are left out: {' '.join(lines)}"] if lines else []


_LEAST_AREA = 0.01
"""Area (m²) below which a crosswalk is none"""


def outline_of(road: Road, item: RoadObject) -> Points:
    """The corners of an object of a road, (n, 3), m: its first outline, or else its rectangle."""
    heading = road.pose(item.s, item.t).h + item.heading
    cos, sin = math.cos(heading), math.sin(heading)
    x, y, z = road.pose(item.s, item.t)[:3]
    corners = [
        (corner.u, corner.v, corner.z, corner.on_road) for corner in (item.outlines or [()])[0]
    ]
    if not corners:
        along, across = 0.5 * (item.length or 0.0), 0.5 * (item.width or 0.0)
        signs = ((1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0))
        corners = [(i * along, j * across, 0.0, False) for i, j in signs]
    found = []
    for u, v, height, on_road in corners:
        if on_road:
            pose = road.pose(u, v)
            found.append((pose.x, pose.y, pose.z + height))
        else:
            found.append((x + cos * u - sin * v, y + sin * u + cos * v, z + item.z_offset + height))
    return np.array(found)


def _priorities(network: RoadNetwork, lanes: dict[str, MapLane]) -> list[tuple[str, str]]:
    """The pairs of lanes that lead on of each two roads that a junction ranks."""
    on: dict[str, list[str]] = defaultdict(list)
    for name, lane in lanes.items():
        # Lanes that lead nowhere have nobody to let go first.
        if lane.type != "none" and lane.successors:
            on[name.split("/")[0]].append(name)
    pairs = (pair for junction in network.junctions.values() for pair in junction.priorities)
    return [pair for high, low in pairs for pair in product(on[high], on[low])]


_POLES = {"pole", "streetLamp", "rail-pole"}
"""Types of objects that are poles; street lamps until 1.4"""


def _poles(network: RoadNetwork) -> Iterator[MapPole]:
    for road in network.roads.values():
        for item in road.objects:
            if item.type in _POLES:
                x, y, z = road.pose(item.s, item.t)[:3]
                place = (x, y, z + item.z_offset)
                yield MapPole(f"{road.id}/{item.id}", place, item.height or 0.0)


def _is_stop_line(item: RoadObject) -> bool:
    """Whether an object is a stop line: `roadMark` of subtype `signalLines` (OpenDRIVE 1.9,
    13.14.8), or one that its name says to be one, as editors write it."""
    named = item.subtype in ("signalLines", "stopLine") or item.name.lower().startswith("stopline")
    return named and item.type in ("roadMark", "-1", "none", "")


def _other_objects(network: RoadNetwork) -> dict[str, int]:
    """Number of the objects by type that are no crosswalks, poles or stop lines."""
    return dict(
        Counter(
            item.type or "none"
            for road in network.roads.values()
            for item in road.objects
            if item.type not in _POLES | {"crosswalk"} and not _is_stop_line(item)
        )
    )


def _marked_stop_lines(network: RoadNetwork, lanes: Mapping[str, MapLane]) -> Iterator[MapStopLine]:
    """The stop lines that are objects, along the middle of their longer side."""
    index = LanesByPlace(lanes)
    for road in network.roads.values():
        for item in filter(_is_stop_line, road.objects):
            outline = outline_of(road, item)
            if shapely.MultiPoint(outline[:, :2]).convex_hull.area > _LEAST_AREA:
                left, right = sides_of(outline)
                line = 0.5 * (left[[0, -1]] + right[[0, -1]])
            else:
                line = outline[_ends(outline)]
            held = [name_of(key) for key in lanes_at(road, item)] if item.validity else []
            yield MapStopLine(f"{road.id}/{item.id}", line, tuple(held) or index.of(line))


def _ends(points: Points) -> list[int]:
    """The two of points along a line that are farthest apart."""
    # Of all pairs: outlines of degenerate lines have their corners in any order.
    away = np.hypot(*(points[:, None, :2] - points[None, :, :2]).T)
    return list(map(int, np.unravel_index(int(np.argmax(away)), away.shape)))


def _signed_stop_lines(network: RoadNetwork, lanes: Mapping[str, MapLane]) -> Iterator[MapStopLine]:
    """The stop lines that are signals: across each row of lanes that they hold."""
    for road in network.roads.values():
        for signal in filter(is_stop_line, road.signals):
            rows: list[tuple[float, float, list[str]]] = []
            # By id, so that neighbours follow each other from right to left.
            for key in sorted(lanes_at(road, signal), key=lambda key: key[2]):
                name, lane = name_of(key), road.sections[key[1]].lanes[key[2]]
                if name not in lanes or lanes[name].type in STILL:
                    continue
                low, high = sorted((lane.inner(signal.s), lane.outer(signal.s)))
                if rows and abs(rows[-1][1] - low) < _APART:
                    low, names = rows[-1][0], [*rows.pop()[2], name]
                else:
                    names = [name]
                rows.append((low, high, names))
            for number, (low, high, names) in enumerate(rows):
                line = np.array([road.pose(signal.s, t)[:3] for t in (high, low)])
                suffix = f"/{number}" if len(rows) > 1 else ""
                yield MapStopLine(f"{road.id}/{signal.id}{suffix}", line, tuple(names))


_APART = 0.1
"""Distance (m) of lanes that are no neighbours."""


def _named(beside: tuple[Key, bool] | None) -> tuple[str, bool] | None:
    return (name_of(beside[0]), beside[1]) if beside is not None else None


def _signals(network: RoadNetwork) -> list[MapSignal]:
    return [
        MapSignal(
            place.signal.id, "light" if place.signal.dynamic else "sign",
            (place.signal.type, place.signal.subtype, place.signal.country, place.signal.value,
                place.signal.unit),
            (place.x, place.y, place.z), place.h, tuple(name_of(key) for key in place.lanes),
        )
        for place in signal_places(network)
        if not is_stop_line(place.signal)
    ]  # fmt: skip


def sides_exchanged(lane: MapLane) -> bool:
    """Whether the left border lies to the right of the right one, in the direction of traffic."""
    left, right = (resampled(line, 5)[:, :2] for line in (lane.left, lane.right))
    ahead, across = (left + right)[3] - (left + right)[1], left[2] - right[2]
    return bool(ahead[0] * across[1] - ahead[1] * across[0] < 0.0)


# stop lines --------------------------------------------------------------------------------------

STILL = {
    "none", "border", "median", "curb", "sidewalk", "walking", "shoulder", "stop", "restricted",
    "parking",
}  # fmt: skip
"""Types of lanes without traffic that stops."""
_UNDER, _STOREY = 0.5, 3.0
"""Distance (m) of a stop line from the middle of a lane that it crosses, perhaps just beyond its
end, and difference of heights (m) from which on a lane is one of a bridge."""


class LanesByPlace:
    """Lanes by place, to look up those that stop lines cross.

    Args:
        lanes: by id.
    """

    def __init__(self, lanes: Mapping[str, MapLane]) -> None:
        self._lanes = [lane for lane in lanes.values() if lane.type not in STILL]
        self._tree = shapely.STRtree(
            [shapely.LineString(lane.centre[:, :2]) for lane in self._lanes]
        )

    def of(self, line: Points) -> tuple[str, ...]:
        """Ids of the lanes that a line crosses: those that lead into a junction, not through it,
        and of lanes that follow each other the first."""
        spot = shapely.LineString(line[:, :2])
        under = []
        for number in sorted(self._tree.query(spot, "dwithin", _UNDER).tolist()):
            lane = self._lanes[number]
            height = heights_on(line[:1, :2], [lane.centre])[0]
            if abs(height - line[0, 2]) < _STOREY:
                under.append(lane)
        under = [lane for lane in under if not lane.in_junction] or under
        onward = {name for lane in under for name in lane.successors}
        # Of lanes that lead to each other in a ring all stay.
        return tuple(lane.id for lane in under if lane.id not in onward) or tuple(
            lane.id for lane in under
        )


# areas -------------------------------------------------------------------------------------------


def sides_of(outline: Points) -> tuple[Points, Points]:
    """The left and the right long side of an area, (n, 3) and (m, 3), m, in one direction.

    They lie between the corners that are nearest to those of the smallest rectangle around it.
    """
    rectangle = shapely.get_coordinates(shapely.oriented_envelope(shapely.Polygon(outline[:, :2])))[
        :4
    ]
    if math.dist(rectangle[0], rectangle[1]) < math.dist(rectangle[1], rectangle[2]):
        rectangle = np.roll(rectangle, -1, axis=0)
    nearest = [int(np.argmin(np.hypot(*(outline[:, :2] - corner).T))) for corner in rectangle]
    if len(set(nearest)) < 4:
        heights = heights_on(rectangle, [outline])
        corners = np.column_stack([rectangle, heights])
        sides = corners[[0, 1]], corners[[3, 2]]
    else:
        sides = (
            _chain(outline, nearest[0], nearest[1], nearest[2]),
            _chain(outline, nearest[3], nearest[2], nearest[0]),
        )
    one, other = sides
    ahead, across = (one[-1] - one[0])[:2], (other[0] - one[0])[:2]
    return (one, other) if ahead[0] * across[1] < ahead[1] * across[0] else (other, one)


def _chain(outline: Points, start: int, end: int, avoided: int) -> Points:
    """Corners from one to another, the way round that does not pass a third."""
    count = len(outline)
    forward = [(start + step) % count for step in range((end - start) % count + 1)]
    backward = [(start - step) % count for step in range((start - end) % count + 1)]
    return outline[backward if avoided in forward else forward]


# lines -------------------------------------------------------------------------------------------


def gone(line: FloatArray) -> FloatArray:
    """Length of a line as seen from above up to each of its points, (n,), m."""
    return np.append(0.0, np.cumsum(np.hypot(*np.diff(line[:, :2], axis=0).T)))


def resampled(line: FloatArray, count: int) -> FloatArray:
    """`count` points at equal distances along a line, its ends included."""
    return at_lengths(line, np.linspace(0.0, gone(line)[-1], count))


def at_lengths(line: FloatArray, lengths: FloatArray) -> FloatArray:
    """Points at lengths (m) along a line."""
    along = gone(line)
    return np.column_stack(
        [np.interp(lengths, along, line[:, axis]) for axis in range(line.shape[1])]
    )


def shifted(line: FloatArray, aside: FloatArray | float) -> FloatArray:
    """A line so far (m) to the left of a line, with its heights; mitred at its corners."""
    steps = np.diff(line[:, :2], axis=0)
    lengths = np.maximum(np.hypot(*steps.T), 1e-9)
    normals = np.column_stack([-steps[:, 1], steps[:, 0]]) / lengths[:, None]
    before, after = np.vstack([normals[:1], normals]), np.vstack([normals, normals[-1:]])
    mean = before + after
    mean /= np.maximum(np.hypot(*mean.T), 1e-9)[:, None]
    # Twice as far at most: at a hairpin a mitre would shoot off to infinity.
    stretch = 1.0 / np.maximum(np.einsum("ij,ij->i", mean, after), 0.5)
    moved = line.copy()
    moved[:, :2] += mean * (stretch * aside)[:, None]
    return moved


def heights_on(points: FloatArray, lines: Sequence[FloatArray]) -> FloatArray:
    """Heights (n,) at the places of lines (m, 3) that are nearest to points (n, 2)."""
    flat = [shapely.LineString(line[:, :2]) for line in lines]
    spots = shapely.points(points)
    away = np.array([shapely.distance(line, spots) for line in flat])
    heights = np.array(
        [
            np.interp(shapely.line_locate_point(line, spots), gone(known), known[:, 2])
            for line, known in zip(flat, lines, strict=True)
        ]
    )
    return heights[np.argmin(away, axis=0), np.arange(len(points))]
