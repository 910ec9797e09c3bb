"""KeepLaneTest: the participant crosses no lane marking."""

from __future__ import annotations

import numpy as np

from runner.criteria.criterion import Drive, Finding
from xodr.lookup import arrays
from xodr.lookup.placing import place

CRITERION = {
    "name": "KeepLaneTest",
    "unit": "crossings",
    "summary": "no corner of its box comes from one lane to another while it is outside of junctions",
    "parameters": {},
    "on_roads": True,
}


def evaluate(drive: Drive) -> Finding:
    """Follow the four corners from row to row, and compare lanes within one lane section.

    Corners that swing out behind a junction do not count while the reference point still is inside.
    """
    columns = drive.columns
    outside = _stretches(drive, columns["road_id"], columns["s"]) >= 0
    crossed = np.zeros(len(drive.steps), bool)
    lanes = []
    for x, y in drive.corners():
        places = place(drive.network, x, y, columns["z"], columns["h"])
        stretch = _stretches(drive, places.road_id, places.s)
        crossed |= (stretch[1:] == stretch[:-1]) & (stretch[1:] >= 0) & (places.lane_id[1:] != places.lane_id[:-1])
        lanes.append(places)
    times = np.flatnonzero(crossed & outside[1:])
    if not len(times):
        return Finding(True, 0.0, "crossed no lane marking")
    row = int(times[0])
    here = next(corner for corner in lanes if corner.lane_id[row] != corner.lane_id[row + 1])
    way = f"from lane {here.lane_id[row]} to lane {here.lane_id[row + 1]} of road {here.road_id[row]}"
    return Finding(False, float(len(times)), f"crossed a lane marking at {columns['time'][row + 1]:.2f} s, {way}")


def _stretches(drive: Drive, road_ids: np.ndarray, s: np.ndarray) -> np.ndarray:
    """A number (n,) for each lane section of each road; -1 in junctions, where lanes overlap."""
    numbers = np.full(len(s), -1, np.int64)
    count = 0
    for road_id in dict.fromkeys(road_ids.tolist()):
        road = drive.network.roads[road_id]
        rows = road_ids == road_id
        if road.junction_id is None:
            numbers[rows] = count + arrays.sections(road, s[rows])
            count += len(road.sections)
    return numbers
