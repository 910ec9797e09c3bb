"""Criteria of lanes: which lanes a participant drives on, and which marks it crosses."""

from __future__ import annotations

import math

import numpy as np

from runner.criteria.criterion import Drive, Finding, criterion, duration_of, intervals
from xodr.lookup import arrays
from xodr.lookup.placing import lanes_under, place

CARRIAGEWAY = frozenset(
    (
        *("driving", "parking", "entry", "exit", "onRamp", "offRamp", "connectingRamp", "slipLane"),
        *("bidirectional", "shared", "mwyEntry", "mwyExit", "bus", "taxi", "HOV"),
    )
)
"""Lane types of OpenDRIVE on which cars drive or park."""
SIDEWALK = frozenset(("sidewalk", "walking"))


def on_lanes(drive: Drive, place: tuple[np.ndarray, np.ndarray], types: frozenset[str]) -> np.ndarray:
    """Which of a drive's places (x and y, each (n,), m) are on a lane of these types, on whatever road; shape (n,)."""
    found = np.zeros(len(place[0]), bool)
    for lanes in lanes_under(drive.network, *place, drive.columns["z"]):
        here = [
            lanes.road.section(s).lanes[lane].type in types
            for lane, s in zip(lanes.lane_id.tolist(), lanes.s.tolist(), strict=True)
        ]
        found[lanes.rows[here]] = True
    return found


@criterion(
    "OffRoadTest",
    unit="s",
    summary="its centre is off all lanes for driving and parking for no longer than `duration` (s), added up",
    parameters={"duration": 0.0},
    on_roads=True,
)
def off_road(drive: Drive, duration: float) -> Finding:
    """Add up the times off the lanes."""
    off = ~on_lanes(drive, drive.centre(), CARRIAGEWAY)
    total = duration_of(off, drive.columns["time"])
    if not off.any():
        return Finding(True, 0.0, "stayed on lanes for driving and parking")
    since = drive.columns["time"][intervals(off)[0][0]]
    reason = f"was off all lanes for driving and parking for {total:.2f} s, first at {since:.2f} s"
    return Finding(total <= duration, total, f"{reason} ({duration:g} s are allowed)")


@criterion(
    "OnSidewalkTest",
    unit="s",
    summary="it is on a sidewalk, or wholly off lanes for driving and parking, for no longer than `duration` (s), added up",
    parameters={"duration": 0.0},
    on_roads=True,
)
def on_sidewalk(drive: Drive, duration: float) -> Finding:
    """Look at the box's centre, and where that is off the carriageway at its corners."""
    time, corners = drive.columns["time"], drive.corners()
    on_carriageway = on_lanes(drive, drive.centre(), CARRIAGEWAY)
    outside = ~on_carriageway & ~np.any([on_lanes(drive, corner, CARRIAGEWAY) for corner in corners], axis=0)
    sidewalk = ~on_carriageway & on_lanes(drive, drive.centre(), SIDEWALK)
    sidewalk |= outside & np.any([on_lanes(drive, corner, SIDEWALK) for corner in corners], axis=0)
    wrong = sidewalk | outside
    if not wrong.any():
        return Finding(True, 0.0, "was on no sidewalk and did not leave the carriageway")
    total, first = duration_of(wrong, time), intervals(wrong)[0][0]
    where = "on a sidewalk" if sidewalk[first] else "off the carriageway"
    reason = f"was on sidewalks or off the carriageway for {total:.2f} s, first {where} at {time[first]:.2f} s"
    return Finding(total <= duration, total, f"{reason} ({duration:g} s are allowed)")


@criterion(
    "KeepLaneTest",
    unit="crossings",
    summary="no corner of its box comes from one lane to another while it is outside of junctions",
    on_roads=True,
)
def keep_lane(drive: Drive) -> Finding:
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


_AGAINST = math.radians(120.0)
"""Angle between heading and the lane's traffic from which it drives against it."""


@criterion(
    "WrongLaneTest",
    unit="m",
    summary="outside junctions it does not drive on a lane whose traffic comes towards it",
    on_roads=True,
)
def wrong_lane(drive: Drive) -> Finding:
    """Compare the heading with the direction of the lane under the reference point."""
    columns = drive.columns
    wrong = np.array(
        [_against(drive, *row) for row in zip(*(columns[name] for name in ("road_id", "lane_id", "s", "h")), strict=True)]
    )
    if not wrong.any():
        return Finding(True, 0.0, "drove on no lane of the opposite direction")
    distance = float(drive.steps[wrong[1:]].sum())
    first = intervals(wrong)[0][0]
    where = f"lane {columns['lane_id'][first]} of road {columns['road_id'][first]}"
    return Finding(
        False, distance, f"drove {distance:.1f} m against the traffic, first at {columns['time'][first]:.2f} s on {where}"
    )


def _against(drive: Drive, road_id: str, lane_id: int, s: float, h: float) -> bool:
    """Whether a heading (rad) is against the traffic of a lane outside of junctions."""
    road = drive.network.roads[road_id]
    inside = min(max(s, 0.0), road.length)
    lane = road.section(inside).lanes.get(lane_id)
    if road.junction_id is not None or lane is None or lane.type not in CARRIAGEWAY or lane.direction == "both":
        return False
    way = road.heading(inside) + (0.0 if road.direction(lane_id, inside) > 0 else math.pi)
    return abs(math.remainder(h - way, math.tau)) > _AGAINST


@criterion(
    "EndofRoadTest",
    unit="s",
    summary="it does not come to another road and drive on for longer than `duration` (s)",
    parameters={"duration": 0.0},
    on_roads=True,
)
def end_of_road(drive: Drive, duration: float) -> Finding:
    """Find when it first was on another road than at the beginning."""
    roads, time = drive.columns["road_id"], drive.columns["time"]
    left = np.flatnonzero(roads != roads[0])
    if not len(left):
        return Finding(True, 0.0, f"stayed on road {roads[0]}")
    when, after = float(time[left[0]]), float(time[-1] - time[left[0]])
    reason = f"left road {roads[0]} for road {roads[left[0]]} at {when:.2f} s, {after:.2f} s before the end"
    return Finding(after <= duration, after, f"{reason} ({duration:g} s are allowed)")
