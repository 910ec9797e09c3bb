"""OpenDRIVE from the lanes of a map, by way of lanelets: roads of neighbouring lanes, junctions, lights, speed limits.

Roads are flat: heights of lanes are left out. All lanes are right-hand lanes of roads that run in
the direction of traffic.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from shapely import LineString

from xodr.builders.elements import Geo
from xodr.formats.lanelet2 import Lanelet, LaneletNeighbour, build
from xodr.formats.lanelet2.lanelet import joined
from xodr.formats.maps.lane_map import LaneMap, MapLane, resampled

_TOLERANCE = 0.02
"""Largest distance (m) of borders from those of the lanes, but for the ends of roads."""
_SHORTEST = 0.3
"""Lanes shorter than this (m) are ways without a length between others, which are linked directly."""
_NARROWEST = 0.1
"""Lanes nowhere wider than this (m) are left out."""
_BESIDE = 0.05
"""Greatest distance (m) of the borders of neighbours that share one."""
_HIGH = 0.5
"""Heights (m) that are worth a remark"""


def write(lane_map: LaneMap) -> tuple[bytes, list[str]]:
    """The content of a file, and what is changed or left out, one sentence each.

    Raises:
        UsageError: the lanes make no roads.
    """
    lanes, notes = _usable(lane_map)
    lights = {
        name: [
            signal.id
            for signal in lane_map.signals
            if signal.kind == "light" and name in signal.lanes
        ]
        for name in lanes
    }
    lanelets = [_lanelet(lane, lanes, tuple(lights[lane.id])) for lane in lanes.values()]
    geo = None
    if lane_map.projection is not None:
        x, y, z, heading = lane_map.offset
        geo = Geo(lane_map.projection, (x, y), z, heading)
    built = build(lanelets, lane_map.name, geo, tolerance=_TOLERANCE)
    signs = sum(signal.kind == "sign" for signal in lane_map.signals)
    if signs:
        notes.append(f"{signs} signs are left out, but for speed limits of lanes")
    heights = [float(np.abs(lane.left[:, 2]).max()) for lane in lanes.values()]
    if max(heights, default=0.0) > _HIGH:
        notes.append("the roads are flat at height 0, without the heights of the lanes")
    if lane_map.left_hand:
        notes.append("traffic keeps to the left: roads are one-way, so the rule says right")
    return built.map.to_xml(), [*notes, *built.notes]


def _usable(lane_map: LaneMap) -> tuple[dict[str, MapLane], list[str]]:
    """Lanes with length and width, and what is left out."""
    short = {name for name, lane in lane_map.lanes.items() if lane.length < _SHORTEST}
    narrow = {name for name, lane in lane_map.lanes.items() if _width(lane) < _NARROWEST} - short
    closed = {name for name, lane in lane_map.lanes.items() if lane.type == "none"} - short - narrow
    notes = [f"{len(narrow)} lanes without width are left out"] if narrow else []
    notes += [f"{len(closed)} lanes of type none are left out"] if closed else []
    gone = narrow | closed
    kept = {}
    for name, lane in lane_map.lanes.items():
        if name not in short | gone:
            following = list(dict.fromkeys(_following(lane_map.lanes, lane, short, gone, 4)))
            kept[name] = replace(lane, successors=[each for each in following if each != name])
    return kept, notes


def _following(
    lanes: dict[str, MapLane], lane: MapLane, short: set[str], gone: set[str], depth: int
) -> Iterator[str]:
    for name in lane.successors:
        if name in short and depth:
            yield from _following(lanes, lanes[name], short, gone, depth - 1)
        elif name in lanes and name not in gone and name not in short:
            yield name


def _width(lane: MapLane) -> float:
    """Greatest distance of the ends and the middles of the borders, m."""
    left, right = (resampled(line, 3)[:, :2] for line in (lane.left, lane.right))
    return float(np.hypot(*(left - right).T).max())


def _lanelet(lane: MapLane, lanes: dict[str, MapLane], lights: tuple[str, ...]) -> Lanelet:
    right = _neighbour(lane, lanes)
    bound = lanes[right].left if right is not None else lane.right
    return Lanelet(
        lane.id, joined([lane.left[:, :2]]), joined([bound[:, :2]]), (), tuple(lane.successors), None,
        LaneletNeighbour(right, True) if right is not None else None, lane.type,
        lane.road_type if lane.road_type != "unknown" else "town", math.inf if lane.limit is None else lane.limit,
        lane.marks[0][0], lane.marks[1][0], lights,
    )  # fmt: skip


def _neighbour(lane: MapLane, lanes: dict[str, MapLane]) -> str | None:
    """The lane to the right that leads the same way and shares the border."""
    beside = lane.beside[1]
    if beside is None or not beside[1] or beside[0] not in lanes:
        return None
    other = lanes[beside[0]]
    if other.beside[0] is None or other.beside[0][0] != lane.id:
        return None
    ends = [np.hypot(*(lane.right[at, :2] - other.left[at, :2])) for at in (0, -1)]
    apart = (
        LineString(lane.right[:, :2]).hausdorff_distance(LineString(other.left[:, :2]))
        if max(ends) < _BESIDE
        else math.inf
    )
    return other.id if apart < _BESIDE else None
