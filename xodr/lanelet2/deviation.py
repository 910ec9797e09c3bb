"""How far the lanes of a road network are from the lanelets that they were made of."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import chain

import numpy as np

from xodr.lanelet2.lanelet import Lanelet, Points
from xodr.lanelet2.polylines import joined, middle
from xodr.network import RoadNetwork
from xodr.road import Road

STEP = 0.5
"""Distance between the places that are compared, m."""

_PLACES = ("left", "right", "centre")


def deviation(lanelets: Sequence[Lanelet], where: Mapping[str, tuple[str, int]], network: RoadNetwork) -> dict[str, float]:
    """Largest distance [m] between the borders and centre line of each lanelet and those of the lanes, by lanelet.

    Each point of a lanelet is compared with its own lane and the lanes that lead on from it or to it: lanes may begin a bit
    earlier or later than their lanelets. `where` gives the road and lane of each lanelet.
    """
    lines = {lane: _lines(network.roads[lane[0]], lane[1]) for lane in set(where.values())}
    return {lanelet.id: _farthest(lanelet, where[lanelet.id], lines, network) for lanelet in lanelets}


def _lines(road: Road, lane_id: int) -> dict[str, Points]:
    """Left border, right border and centre of a lane as seen in the direction of +s."""
    places = np.linspace(0.0, road.length, max(int(road.length / STEP), 2) + 1).tolist()
    lane = road.lane(0.0, lane_id)
    profiles = {"left": lane.inner, "right": lane.outer, "centre": lane.center}
    return {name: np.array([road.pose(s, profile(s))[:2] for s in places]) for name, profile in profiles.items()}


def _farthest(
    lanelet: Lanelet, own: tuple[str, int], lines: dict[tuple[str, int], dict[str, Points]], network: RoadNetwork
) -> float:
    from shapely import LineString, MultiLineString, distance, points

    links = chain(network.links(*own, True), network.links(*own, False))
    lanes = [own, *((link.road_id, link.lane_id) for link in links)]
    mine = {"left": lanelet.left, "right": lanelet.right, "centre": middle(lanelet.left, lanelet.right)}
    worst = 0.0
    for place in _PLACES:
        known = MultiLineString([LineString(lines[lane][place]) for lane in lanes if lane in lines])
        worst = max(worst, float(distance(points(_dense(mine[place])), known).max()))
    return worst


def _dense(line: Points) -> Points:
    from shapely import LineString, get_coordinates

    return joined([get_coordinates(LineString(line).segmentize(STEP))])
