"""Roads in replays: lane surfaces and marks near a run, outlines of objects, signals with their states over time."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from xodr.lookup.arrays import lane_borders, sample, stations
from xodr.model import PERMANENT, TEMPORARY

if TYPE_CHECKING:
    from runner.recording import LogEntry
    from xodr.model import Corner, LaneSection, RoadMark, RoadObject
    from xodr.network import RoadNetwork
    from xodr.road import Road

Line = NDArray[np.float64]
"""A polyline: rows x, y, m."""
_WIDTH = 0.12
"""Width of marks whose file does not give one, m"""
_APART = 2.0
"""Distance between the middles of two marks side by side, in widths"""
_TOLERANCE = 0.02
"""Tolerance (m) of simplified lines"""
_PAIRS = {"solid solid": "ss", "solid broken": "sb", "broken solid": "bs", "broken broken": "bb"}
_DASHES = {"broken": "broken", "botts dots": "dots"}
_UNMARKED = "unmarked"

SURFACES = {
    **dict.fromkeys(("shoulder", "stop", "border", "parking", "restricted"), "shoulder"),
    **dict.fromkeys(("sidewalk", "walking", "curb"), "walk"),
    **dict.fromkeys(("biking",), "bike"),
    **dict.fromkeys(("none", "median", "tram", "rail"), "verge"),
}
"""Appearance of lanes by type; the others are carriageway."""


class Area(NamedTuple):
    """A rectangle of the world: west, south, east, north, m."""

    west: float
    south: float
    east: float
    north: float

    def wider(self, margin: float) -> Area:
        """The same with a margin (m) all around."""
        return Area(self.west - margin, self.south - margin, self.east + margin, self.north + margin)

    def meets(self, other: Area) -> bool:
        """Whether two rectangles have something in common."""
        return self.west <= other.east and other.west <= self.east and self.south <= other.north and other.south <= self.north


class Marks(NamedTuple):
    """Appearance of marks: `pattern` solid, broken, dots or unmarked (a border without marks), colour, width in m."""

    pattern: str
    colour: str
    width: float


def surfaces(network: RoadNetwork, area: Area) -> dict[str, list[Line]]:
    """Outlines of lanes within an area, by how they look: the permanent ones, which the surface is made of."""
    found: dict[str, list[Line]] = defaultdict(list)
    for road in network.on(PERMANENT).roads.values():
        types = [section.lanes[lane].type for section in road.sections for lane in (*section.left, *section.right)]
        for kind, (_, inner, outer) in zip(types, lane_borders(road), strict=True):
            found[SURFACES.get(kind, "road")].append(np.concatenate([inner[:, :2], outer[::-1, :2]]))
    return {look: _clipped(shapely.polygons, rings, area) for look, rings in sorted(found.items())}


def marks(network: RoadNetwork, area: Area) -> dict[Marks, list[Line]]:
    """Lines of marks within an area, by how they look; those of temporary lanes come last, to lie above the permanent ones."""
    layers: dict[str, dict[Marks, list[Line]]] = {PERMANENT: defaultdict(list), TEMPORARY: defaultdict(list)}
    for layer, found in layers.items():
        for road in network.on(layer).roads.values():
            everywhere = stations(road)
            for section in road.sections:
                for lane_id in sorted(section.lanes):
                    if section.lanes[lane_id].layer == layer:
                        for look, line in _marks_of(road, section, lane_id, everywhere):
                            found[look].append(line)
    usual, temporary = layers.values()
    looks = [*sorted(usual.keys() - temporary.keys()), *sorted(temporary)]
    return {look: _clipped(shapely.linestrings, [*usual[look], *temporary[look]], area) for look in looks}


def _marks_of(road: Road, section: LaneSection, lane_id: int, everywhere: Line) -> Iterator[tuple[Marks, Line]]:
    lane = section.lanes[lane_id]
    declared = lane.marks
    if lane.layer == TEMPORARY:
        declared = tuple(mark._replace(color="yellow") if mark.color == "standard" else mark for mark in declared)
    elif not declared and road.junction_id is None:
        yield Marks(_UNMARKED, "standard", _WIDTH), _along(road, lane_id, section.s, section.end, everywhere, 0.0)
    for mark, end in zip(declared, [*(mark.s for mark in declared), section.end][1:], strict=True):
        start, end = max(mark.s, section.s), min(end, section.end)
        if start < end and mark.type != "none":
            for look, aside in _strokes(mark):
                outwards = aside if lane_id > 0 else -aside
                yield look, _along(road, lane_id, start, end, everywhere, outwards)


def _strokes(mark: RoadMark) -> Iterator[tuple[Marks, float]]:
    """The single lines of a mark, and how far outside (left, on the centre line: right) of the border each is, m."""
    width = mark.width or _WIDTH
    if mark.type in _PAIRS:
        for letter, aside in zip(_PAIRS[mark.type], (-0.5, 0.5), strict=True):
            yield Marks("solid" if letter == "s" else "broken", mark.color, width), aside * _APART * width
    else:
        yield Marks(_DASHES.get(mark.type, "solid"), mark.color, width), 0.0


def _along(road: Road, lane_id: int, start: float, end: float, everywhere: Line, aside: float) -> Line:
    """The outer border of a lane from s to s, moved by `aside` (m) to the left."""
    inside = [start, *everywhere[(everywhere > start) & (everywhere < end)].tolist(), end]
    outer = road.section(start).lanes[lane_id].outer
    return sample(road, inside, [outer(s) + aside for s in inside])[:, :2]


def _clipped(build: Callable[[Line], Any], lines: Iterable[Line], area: Area) -> list[Line]:
    """Clip rings or lines to an area, with no more points than needed."""
    kept = []
    for line in lines:
        west, south = line.min(axis=0)
        east, north = line.max(axis=0)
        if west <= area.east and east >= area.west and south <= area.north and north >= area.south:
            whole = shapely.simplify(build(line), _TOLERANCE)
            for part in shapely.get_parts(shapely.clip_by_rect(whole, *area)):
                ring = shapely.get_exterior_ring(part) or part
                kept.append(shapely.get_coordinates(ring))
    return [line for line in kept if len(line) > 1]


_POINT = 0.15
"""Radius of what has no size, m"""
_CORNERS = 12
"""Corners of what is round"""


def objects(network: RoadNetwork, area: Area) -> dict[str, list[Line]]:
    """Outlines of the objects within an area: those of crosswalks, and of all else."""
    found: dict[str, list[Line]] = defaultdict(list)
    for road in network.roads.values():
        for thing in road.objects:
            for ring in _rings(road, thing):
                if _touches(ring, area):
                    found["crosswalk" if thing.type == "crosswalk" else "object"].append(ring)
    return dict(sorted(found.items()))


def _touches(ring: Line, area: Area) -> bool:
    (west, south), (east, north) = ring.min(axis=0), ring.max(axis=0)
    return bool(west <= area.east and east >= area.west and south <= area.north and north >= area.south)


def _rings(road: Road, thing: RoadObject) -> list[Line]:
    outlines = [outline for outline in thing.outlines if outline]
    if outlines:
        return [_outline(road, thing, outline) for outline in outlines]
    if thing.length and thing.width:
        u, v = thing.length / 2, thing.width / 2
        return [_placed(road, thing, np.array([(u, v), (-u, v), (-u, -v), (u, -v)]))]
    angles = np.linspace(0.0, math.tau, _CORNERS, endpoint=False)
    return [_placed(road, thing, (thing.radius or _POINT) * np.column_stack([np.cos(angles), np.sin(angles)]))]


def _outline(road: Road, thing: RoadObject, corners: tuple[Corner, ...]) -> Line:
    points = np.array([(corner.u, corner.v) for corner in corners])
    return sample(road, points[:, 0], points[:, 1])[:, :2] if corners[0].on_road else _placed(road, thing, points)


def _placed(road: Road, thing: RoadObject, points: Line) -> Line:
    """Points of an object's frame in the world."""
    pose = road.pose(thing.s, thing.t)
    h = pose.h + thing.heading + (math.pi if thing.orientation == "-" else 0.0)
    turned = points @ np.array([(math.cos(h), math.sin(h)), (-math.sin(h), math.cos(h))])
    return turned + np.array([pose.x, pose.y])


def signals(network: RoadNetwork, area: Area) -> list[dict[str, Any]]:
    """Signals within an area: id, place (m), name, and whether it changes."""
    found = []
    for signal in network.signals.values():
        x, y, *_ = network.road(signal.road_id).pose(signal.s, signal.t)
        if area.west <= x <= area.east and area.south <= y <= area.north:
            found.append({"id": signal.id, "x": x, "y": y, "name": signal.name or signal.type, "dynamic": signal.dynamic})
    return found


def signal_states(events: Iterable[LogEntry]) -> dict[str, list[tuple[float, str]]]:
    """By signal, since when (s) it has shown what."""
    states: dict[str, list[tuple[float, str]]] = defaultdict(list)
    for entry in events:
        if entry.kind == "trafficSignal":
            states[entry.subject].append((entry.time, entry.text))
    return dict(states)
