"""Conversion of a Lanelet2 file to an OpenDRIVE file, and how far its lanes are from the lanelets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import chain
from os import PathLike
from pathlib import Path
from typing import NamedTuple

import numpy as np

from xodr.builders.elements import Geo
from xodr.lanelet2.assembly import build, with_crosswalks
from xodr.lanelet2.borders import completed
from xodr.lanelet2.lanelet import Lanelet, Points, across, lengths, places, points_at
from xodr.lanelet2.reader import Area, read_lanelets
from xodr.network import RoadNetwork
from xodr.reader import load
from xodr.road import Road

STEP = 0.5
"""Distance between the places that are compared, m."""


def deviation(lanelets: Sequence[Lanelet], where: Mapping[str, tuple[str, int]], network: RoadNetwork) -> dict[str, float]:
    """Largest distance [m] of each lanelet's bounds from the borders of its lane, and of the lane's centre from theirs.

    Bounds may also lie on lanes that lead on from it or to it: lanes begin a bit earlier or later than their lanelets.
    `where` gives the road and lane of each lanelet.
    """
    lines = {lane: _lines(network.roads[lane[0]], lane[1]) for lane in set(where.values())}
    found = {}
    for lanelet in lanelets:
        own = where[lanelet.id]
        links = chain(network.links(*own, True), network.links(*own, False))
        around = [lines[lane] for lane in (own, *((link.road_id, link.lane_id) for link in links)) if lane in lines]
        borders = (
            _farthest(lanelet.left, [lane.left for lane in around]),
            _farthest(lanelet.right, [lane.right for lane in around]),
        )
        found[lanelet.id] = max(*borders, _off_centre(lanelet, lines[own]))
    return found


class _Lines(NamedTuple):
    """Borders and centre of a lane, as seen in the direction of +s."""

    left: Points
    right: Points
    centre: Points


def _lines(road: Road, lane_id: int) -> _Lines:
    grid = np.linspace(0.0, road.length, places(road.length, STEP)).tolist()
    lane = road.lane(0.0, lane_id)
    return _Lines(*(np.array([road.pose(s, at(s))[:2] for s in grid]) for at in (lane.inner, lane.outer, lane.center)))


def _farthest(bound: Points, borders: list[Points]) -> float:
    from shapely import LineString, MultiLineString, distance, points

    total = lengths(bound)[-1]
    dense = np.concatenate([bound, points_at(bound, np.linspace(0.0, total, places(total, STEP)))])
    return float(distance(points(dense), MultiLineString([LineString(border) for border in borders])).max())


def _off_centre(lanelet: Lanelet, lane: _Lines) -> float:
    """Return the distance of a lane's centre from the middle between its bounds, across the road."""
    sideways = lane.left - lane.right
    onward = np.column_stack([sideways[:, 1], -sideways[:, 0]])
    wide = np.hypot(*sideways.T) > STEP
    left, right = (across(lane.centre[wide], onward[wide], bound) for bound in (lanelet.left, lanelet.right))
    return float(np.nanmax(np.abs(left + right) / 2, initial=0.0))


_ASTRAY = 0.5
"""Lanes farther away than this from their lanelets are named, m."""


class Conversion(NamedTuple):
    """Result of converting a Lanelet2 map.

    Attributes:
        path: the OpenDRIVE file.
        lanelets: road id and lane id of each lanelet that became a lane.
        notes: what was assumed, changed or left out, one sentence each.
        deviation: largest distance between a lanelet's borders or centre line and those of its lane, m.
    """

    path: Path
    lanelets: dict[str, tuple[str, int]]
    notes: list[str]
    deviation: float


def convert(osm: str | PathLike[str], origin: tuple[float, float] | None, target: str | PathLike[str]) -> Conversion:
    """Write a Lanelet2 map as OpenDRIVE, in the coordinates of the tracks that were recorded on it.

    Args:
        osm: the map.
        origin: latitude and longitude of the origin of the coordinates, degrees; None for that of the map's own local
            coordinates, or of INTERACTION (0, 0) where it has none.
        target: the OpenDRIVE file to write.

    Raises:
        InvalidFile: the map is malformed; names file, line and element.
        UsageError: the origin is no place on Earth.
    """
    source = Path(osm)
    found = read_lanelets(source, origin)
    lanelets, added = completed(found.lanes)
    made = write(lanelets, source.stem, target, found.crosswalks, found.geo, found.priorities)
    return made._replace(notes=[*found.notes, *added, *made.notes])


def write(
    lanelets: Sequence[Lanelet],
    name: str,
    target: str | PathLike[str],
    crosswalks: Sequence[Area] = (),
    geo: Geo | None = None,
    priorities: Sequence[tuple[str, str]] = (),
) -> Conversion:
    """Write lanelets of any origin as OpenDRIVE, in their coordinates.

    Args:
        lanelets, name, geo, priorities: as of `build`.
        target: the OpenDRIVE file to write.
        crosswalks: outlines on the road.

    Raises:
        UsageError: an id is used twice, or a lanelet refers to an unknown one.
    """
    built = build(lanelets, name, geo, priorities)
    written = replace(built.map, roads=with_crosswalks(built.map.roads, crosswalks)).write(target)
    away = deviation(built.parts, built.lanelets, load(written))
    astray = [f"{name} ({distance:.1f} m)" for name, distance in away.items() if distance > _ASTRAY]
    notes = [f"lanes that are not everywhere where their lanelets are: {', '.join(astray)}"] if astray else []
    return Conversion(written, built.lanelets, [*built.notes, *notes], max(away.values()))
