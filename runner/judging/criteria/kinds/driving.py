"""Criteria of driving: collisions, speed, distance, places to reach, lanes that a participant
drives on, and marks it crosses."""

from __future__ import annotations

import math

import numpy as np

from runner.judging.criteria.criterion import (
    Contact,
    CriterionFinding,
    Drive,
    criterion,
    duration_of,
    intervals,
    share_left,
)
from xodr.lookup import arrays
from xodr.lookup.placing import Places, lanes_under, place

CARRIAGEWAY = frozenset(
    (
        *("driving", "parking", "entry", "exit", "onRamp", "offRamp", "connectingRamp", "slipLane"),
        *("bidirectional", "shared", "mwyEntry", "mwyExit", "bus", "taxi", "HOV"),
    )
)
"""Lane types of OpenDRIVE on which cars drive or park."""
SIDEWALK = frozenset(("sidewalk", "walking"))


def on_lanes(
    drive: Drive, place: tuple[np.ndarray, np.ndarray], types: frozenset[str]
) -> np.ndarray:
    """Mask (n,) of a drive's places (x and y, each (n,), m) that are on a lane of these types, on
    any road."""
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
    summary="its centre is off all lanes for driving and parking for no longer than "
    "`duration` (s), added up",
    parameters={"duration": 0.0},
    on_roads=True,
)
def off_road(drive: Drive, duration: float) -> CriterionFinding:
    """Add up the times off the lanes."""
    off = ~on_lanes(drive, drive.centre(), CARRIAGEWAY)
    total = duration_of(off, drive.columns["time"])
    if not off.any():
        stayed = "stayed on lanes for driving and parking"
        return CriterionFinding(True, 0.0, stayed, _room(drive, CARRIAGEWAY))
    since = drive.columns["time"][intervals(off)[0][0]]
    reason = f"was off all lanes for driving and parking for {total:.2f} s, first at {since:.2f} s"
    allowed = f"{reason} ({duration:g} s are allowed)"
    left = share_left(duration - total, duration)
    return CriterionFinding(total <= duration, total, allowed, left)


_ASIDE, _HALVED = 4.0, 5
"""Greatest room (m) to the side that is looked for, and how often it is halved"""


def _room(drive: Drive, types: frozenset[str]) -> float:
    """Least distance (m) to the left and right of a drive's centre at which lanes of these types
    end, up to `_ASIDE`."""
    box, low, high = drive.track.box, 0.0, _ASIDE
    for number in range(_HALVED + 1):
        aside = high if number == 0 else (low + high) / 2.0
        sides = (drive.at(box.x, box.y + sign * aside) for sign in (1.0, -1.0))
        if all(on_lanes(drive, side, types).all() for side in sides):
            low = aside
        else:
            high = aside
    return low


@criterion(
    "OnSidewalkTest",
    unit="s",
    summary="it is on a sidewalk, or wholly off lanes for driving and parking, for no longer than "
    "`duration` (s), added up",
    parameters={"duration": 0.0},
    on_roads=True,
)
def on_sidewalk(drive: Drive, duration: float) -> CriterionFinding:
    """Judge the box's centre, and off the carriageway its corners."""
    time, corners = drive.columns["time"], drive.corners()
    on_carriageway = on_lanes(drive, drive.centre(), CARRIAGEWAY)
    outside = ~on_carriageway & ~np.any(
        [on_lanes(drive, corner, CARRIAGEWAY) for corner in corners], axis=0
    )
    sidewalk = ~on_carriageway & on_lanes(drive, drive.centre(), SIDEWALK)
    sidewalk |= outside & np.any([on_lanes(drive, corner, SIDEWALK) for corner in corners], axis=0)
    wrong = sidewalk | outside
    if not wrong.any():
        clear = "was on no sidewalk and did not leave the carriageway"
        return CriterionFinding(True, 0.0, clear, _room(drive, CARRIAGEWAY))
    total, first = duration_of(wrong, time), intervals(wrong)[0][0]
    where = "on a sidewalk" if sidewalk[first] else "off the carriageway"
    reason = (
        f"was on sidewalks or off the carriageway for {total:.2f} s, first {where} at "
        f"{time[first]:.2f} s"
    )
    allowed = f"{reason} ({duration:g} s are allowed)"
    left = share_left(duration - total, duration)
    return CriterionFinding(total <= duration, total, allowed, left)


@criterion(
    "KeepLaneTest",
    unit="crossings",
    summary="no corner of its box comes from one lane to another while it is outside of junctions",
    on_roads=True,
)
def keep_lane(drive: Drive) -> CriterionFinding:
    """Follow the four corners from row to row, and compare lanes within one lane section.

    Corners that swing out behind a junction do not count while the reference point still is inside.
    """
    columns = drive.columns
    outside = _stretches(drive, columns["road_id"], columns["s"]) >= 0
    crossed, room = np.zeros(len(drive.steps), bool), math.inf
    lanes = []
    for x, y in drive.corners():
        places = place(drive.network, x, y, columns["z"], columns["h"])
        stretch = _stretches(drive, places.road_id, places.s)
        # Lane ids mean the same within one lane section only.
        crossed |= (
            (stretch[1:] == stretch[:-1])
            & (stretch[1:] >= 0)
            & (places.lane_id[1:] != places.lane_id[:-1])
        )
        lanes.append(places)
        room = min(room, _to_marking(drive, places, outside & (stretch >= 0)))
    times = np.flatnonzero(crossed & outside[1:])
    if not len(times):
        return CriterionFinding(True, 0.0, "crossed no lane marking", room)
    row = int(times[0])
    here = next(corner for corner in lanes if corner.lane_id[row] != corner.lane_id[row + 1])
    way = (
        f"from lane {here.lane_id[row]} to lane {here.lane_id[row + 1]} of road {here.road_id[row]}"
    )
    return CriterionFinding(
        False,
        float(len(times)),
        f"crossed a lane marking at {columns['time'][row + 1]:.2f} s, {way}",
    )


def _to_marking(drive: Drive, places: Places, rows: np.ndarray) -> float:
    """Least distance (m) of some places to the borders of their lanes; infinite without places."""
    roads = drive.network.roads
    at = zip(
        *(
            column[rows].tolist()
            for column in (places.road_id, places.s, places.lane_id, places.offset)
        ),
        strict=True,
    )
    # A place off all lanes has lane 0, which has no borders.
    return min(
        (
            roads[road_id].lane_width(min(max(s, 0.0), roads[road_id].length), lane_id) / 2.0
            - abs(offset)
            for road_id, s, lane_id, offset in at
            if lane_id
        ),
        default=math.inf,
    )


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
def wrong_lane(drive: Drive) -> CriterionFinding:
    """Compare the heading with the direction of the lane under the reference point."""
    columns = drive.columns
    wrong = np.array(
        [
            _against(drive, *row)
            for row in zip(
                *(columns[name] for name in ("road_id", "lane_id", "s", "h")), strict=True
            )
        ]
    )
    if not wrong.any():
        return CriterionFinding(True, 0.0, "drove on no lane of the opposite direction")
    distance = float(drive.steps[wrong[1:]].sum())
    first = intervals(wrong)[0][0]
    where = f"lane {columns['lane_id'][first]} of road {columns['road_id'][first]}"
    return CriterionFinding(
        False,
        distance,
        f"drove {distance:.1f} m against the traffic, first at "
        f"{columns['time'][first]:.2f} s on {where}",
    )


def _against(drive: Drive, road_id: str, lane_id: int, s: float, h: float) -> bool:
    """Whether a heading (rad) is against the traffic of a lane outside of junctions."""
    road = drive.network.roads[road_id]
    # Rounding may put a place beyond its road, where there is no lane section.
    inside = min(max(s, 0.0), road.length)
    lane = road.section(inside).lanes.get(lane_id)
    # Lanes of a junction overlap, and one for both directions (`both`) has no wrong one.
    if (
        road.junction_id is not None
        or lane is None
        or lane.type not in CARRIAGEWAY
        or lane.direction == "both"
    ):
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
def end_of_road(drive: Drive, duration: float) -> CriterionFinding:
    """Find when it first was on another road than at the beginning."""
    roads, time = drive.columns["road_id"], drive.columns["time"]
    left = np.flatnonzero(roads != roads[0])
    if not len(left):
        return CriterionFinding(True, 0.0, f"stayed on road {roads[0]}")
    when, after = float(time[left[0]]), float(time[-1] - time[left[0]])
    reason = (
        f"left road {roads[0]} for road {roads[left[0]]} at {when:.2f} s, "
        f"{after:.2f} s before the end"
    )
    allowed = f"{reason} ({duration:g} s are allowed)"
    margin = share_left(duration - after, duration)
    return CriterionFinding(after <= duration, after, allowed, margin)


_STANDING = 0.1
"""Speed below which a collision is not its own fault, m/s"""
_SAME_TIME, _SAME_PLACE = 5.0, 5.0
"""A contact with the same entity within this time (s), or with any within this distance (m), is the
same collision."""


@criterion(
    "CollisionTest",
    unit="collisions",
    summary="it hits no other participant while it moves; being hit in standstill does not count",
)
def collision(drive: Drive) -> CriterionFinding:
    """Count the collisions."""
    counted: list[tuple[Contact, int]] = []
    standing: list[Contact] = []
    columns = drive.columns
    for contact in drive.contacts:
        row = min(
            int(np.searchsorted(columns["time"], contact.time - 1e-9)), len(columns["time"]) - 1
        )
        if counted and _same(contact, row, *counted[-1], columns):
            continue
        if abs(columns["speed"][max(row - 1, 0)]) < _STANDING:
            standing.append(contact)
        else:
            counted.append((contact, row))
    if counted:
        contact, row = counted[0]
        speed = abs(columns["speed"][max(row - 1, 0)])
        return CriterionFinding(
            False,
            float(len(counted)),
            f"hit {contact.other} at {contact.time:.2f} s with {speed:.1f} m/s",
        )
    if standing:
        return CriterionFinding(
            True,
            0.0,
            f"no collision: it stood when {standing[0].other} touched it at "
            f"{standing[0].time:.2f} s",
        )
    return CriterionFinding(True, 0.0, "no collision")


def _same(
    contact: Contact, row: int, before: Contact, place: int, columns: dict[str, np.ndarray]
) -> bool:
    """Whether a contact belongs to the collision before it."""
    if contact.other == before.other and contact.time - before.time <= _SAME_TIME:
        return True
    x, y = columns["x"], columns["y"]
    return math.hypot(x[row] - x[place], y[row] - y[place]) <= _SAME_PLACE


@criterion(
    "ActorBlockedTest",
    unit="s",
    summary="it is never slower than `min_speed` (m/s) for longer than `max_time` (s)",
    parameters={"min_speed": None, "max_time": None},
)
def actor_blocked(drive: Drive, min_speed: float, max_time: float) -> CriterionFinding:
    """Find the longest time below the speed."""
    time = drive.columns["time"]
    slow = [
        (float(time[b] - time[a]), float(time[a]))
        for a, b in intervals(np.abs(drive.columns["speed"]) < min_speed)
    ]
    longest, since = max(slow, default=(0.0, 0.0))
    blocked = longest > max_time
    when = f" from {since:.2f} s on" if slow else ""
    return CriterionFinding(
        not blocked,
        longest,
        f"was slower than {min_speed:g} m/s for {longest:.2f} s{when}, {max_time:g} s are allowed",
        share_left(max_time - longest, max_time),
    )


@criterion(
    "AverageVelocityTest",
    unit="m/s",
    summary="the way divided by the time of the run is more than `velocity` (m/s)",
    parameters={"velocity": None},
)
def average_velocity(drive: Drive, velocity: float) -> CriterionFinding:
    """Divide the way of the reference point by the simulation time."""
    time = float(drive.columns["time"][-1])
    if time <= 0.0:
        return CriterionFinding(None, None, "the run has no duration")
    average = float(drive.steps.sum()) / time
    fast = average > velocity
    return CriterionFinding(
        fast,
        average,
        f"drove {average:.2f} m/s on average, {'more' if fast else 'not more'} "
        f"than {velocity:g} m/s",
        share_left(average - velocity, velocity),
    )


@criterion(
    "MaxVelocityTest",
    unit="m/s",
    summary="it never drives faster than `max_velocity` (m/s)",
    parameters={"max_velocity": None},
)
def max_velocity(drive: Drive, max_velocity: float) -> CriterionFinding:
    """Find the greatest speed, forwards or backwards."""
    speed = np.abs(drive.columns["speed"])
    fastest = float(speed.max())
    over, left = (
        np.flatnonzero(speed > max_velocity),
        share_left(max_velocity - fastest, max_velocity),
    )
    if len(over):
        since = drive.columns["time"][over[0]]
        return CriterionFinding(
            False,
            fastest,
            f"drove up to {fastest:.2f} m/s, from {since:.2f} s on more than {max_velocity:g} m/s",
            left,
        )
    return CriterionFinding(
        True, fastest, f"drove {fastest:.2f} m/s at most, {max_velocity:g} m/s are allowed", left
    )


@criterion(
    "SpeedLimitTest",
    unit="m/s",
    summary="it is never faster than the speed limit of its road, or its lane, by more than "
    "`tolerance` (m/s)",
    parameters={"tolerance": 0.0},
    on_roads=True,
)
def speed_limit(drive: Drive, tolerance: float) -> CriterionFinding:
    """Compare the speed with the limit at each place that has one."""
    columns = drive.columns
    places = zip(*(columns[name].tolist() for name in ("road_id", "s", "lane_id")), strict=True)
    allowed = np.array([_limit(drive, *place) for place in places]) + tolerance
    speed = np.abs(columns["speed"])
    if np.isinf(allowed).all():
        return CriterionFinding(None, None, "no road that it was on has a speed limit")
    row = int((speed - allowed).argmax())
    left = share_left(float(allowed[row] - speed[row]), float(allowed[row]))
    told = (
        f"drove {speed[row]:.2f} m/s at {columns['time'][row]:.2f} s, where {allowed[row]:.2f} m/s "
        "are allowed"
    )
    return CriterionFinding(bool(speed[row] <= allowed[row]), float(speed[row]), told, left)


def _limit(drive: Drive, road_id: str, s: float, lane_id: int) -> float:
    """Speed limit (m/s) at a place; infinite without one."""
    found = drive.network.roads[road_id].speed_limit(s, lane_id)
    return math.inf if found is None else found


@criterion(
    "DrivenDistanceTest",
    unit="m",
    summary="it drives further than `distance_success` (m)",
    parameters={"distance_success": None},
)
def driven_distance(drive: Drive, distance_success: float) -> CriterionFinding:
    """Measure the way of the reference point."""
    distance = float(drive.steps.sum())
    far = distance > distance_success
    return CriterionFinding(
        far,
        distance,
        f"drove {distance:.1f} m, {'more' if far else 'not more'} than {distance_success:g} m",
        share_left(distance - distance_success, distance_success),
    )


@criterion(
    "ReachedRegionTest",
    unit="m",
    summary="it comes into the rectangle from (`min_x`, `min_y`) to (`max_x`, `max_y`) of "
    "the road network (m)",
    parameters={"min_x": None, "max_x": None, "min_y": None, "max_y": None},
)
def reached_region(
    drive: Drive, min_x: float, max_x: float, min_y: float, max_y: float
) -> CriterionFinding:
    """Find the least distance of the box's centre from the rectangle, and when it is inside."""
    x, y = drive.centre()
    inside = np.flatnonzero((min_x < x) & (x < max_x) & (min_y < y) & (y < max_y))
    if len(inside):
        return CriterionFinding(
            True, 0.0, f"reached the region at {drive.columns['time'][inside[0]]:.2f} s"
        )
    away = np.hypot(
        np.maximum(np.maximum(min_x - x, x - max_x), 0.0),
        np.maximum(np.maximum(min_y - y, y - max_y), 0.0),
    )
    nearest = float(away.min())
    return CriterionFinding(
        False,
        nearest,
        f"did not reach the region; the nearest that it came was {nearest:.1f} m",
        -nearest,
    )
