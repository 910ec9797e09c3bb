"""What stands beside the road as it is drawn: outlines of objects, and signals with their states over time."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from xodr.lookup.sampling import sample

if TYPE_CHECKING:
    from runner.interpreter.event_log import LogEntry
    from runner.replay.scene.roads import Area, Line
    from xodr.model import Corner, RoadObject
    from xodr.network import RoadNetwork
    from xodr.road import Road

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
