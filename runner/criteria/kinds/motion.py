"""Criteria of motion: collisions, speed, distance, and places to reach."""

from __future__ import annotations

import math

import numpy as np

from runner.criteria.criterion import Contact, Drive, Finding, criterion, intervals

_STANDING = 0.1
"""Speed below which a collision is not its own fault, m/s"""
_SAME_TIME, _SAME_PLACE = 5.0, 5.0
"""A contact with the same entity within this time (s), or with any within this distance (m), is the same collision."""


@criterion(
    "CollisionTest",
    unit="collisions",
    summary="it hits no other participant while it moves; being hit in standstill does not count",
)
def collision(drive: Drive) -> Finding:
    """Count the collisions."""
    counted: list[tuple[Contact, int]] = []
    standing: list[Contact] = []
    columns = drive.columns
    for contact in drive.contacts:
        row = min(int(np.searchsorted(columns["time"], contact.time - 1e-9)), len(columns["time"]) - 1)
        if counted and _same(contact, row, *counted[-1], columns):
            continue
        if abs(columns["speed"][max(row - 1, 0)]) < _STANDING:
            standing.append(contact)
        else:
            counted.append((contact, row))
    if counted:
        contact, row = counted[0]
        speed = abs(columns["speed"][max(row - 1, 0)])
        return Finding(False, float(len(counted)), f"hit {contact.other} at {contact.time:.2f} s with {speed:.1f} m/s")
    if standing:
        return Finding(True, 0.0, f"no collision: it stood when {standing[0].other} touched it at {standing[0].time:.2f} s")
    return Finding(True, 0.0, "no collision")


def _same(contact: Contact, row: int, before: Contact, place: int, columns: dict[str, np.ndarray]) -> bool:
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
def actor_blocked(drive: Drive, min_speed: float, max_time: float) -> Finding:
    """Find the longest time below the speed."""
    time = drive.columns["time"]
    slow = [(float(time[b] - time[a]), float(time[a])) for a, b in intervals(np.abs(drive.columns["speed"]) < min_speed)]
    longest, since = max(slow, default=(0.0, 0.0))
    blocked = longest > max_time
    when = f" from {since:.2f} s on" if slow else ""
    return Finding(
        not blocked, longest, f"was slower than {min_speed:g} m/s for {longest:.2f} s{when}, {max_time:g} s are allowed"
    )


@criterion(
    "AverageVelocityTest",
    unit="m/s",
    summary="the way divided by the time of the run is more than `velocity` (m/s)",
    parameters={"velocity": None},
)
def average_velocity(drive: Drive, velocity: float) -> Finding:
    """Divide the way of the reference point by the simulation time."""
    time = float(drive.columns["time"][-1])
    if time <= 0.0:
        return Finding(None, None, "the run has no duration")
    average = float(drive.steps.sum()) / time
    fast = average > velocity
    return Finding(fast, average, f"drove {average:.2f} m/s on average, {'more' if fast else 'not more'} than {velocity:g} m/s")


@criterion(
    "MaxVelocityTest", unit="m/s", summary="it never drives faster than `max_velocity` (m/s)", parameters={"max_velocity": None}
)
def max_velocity(drive: Drive, max_velocity: float) -> Finding:
    """Find the greatest speed, forwards or backwards."""
    speed = np.abs(drive.columns["speed"])
    fastest = float(speed.max())
    over = np.flatnonzero(speed > max_velocity)
    if len(over):
        since = drive.columns["time"][over[0]]
        return Finding(False, fastest, f"drove up to {fastest:.2f} m/s, from {since:.2f} s on more than {max_velocity:g} m/s")
    return Finding(True, fastest, f"drove {fastest:.2f} m/s at most, {max_velocity:g} m/s are allowed")


@criterion(
    "DrivenDistanceTest", unit="m", summary="it drives further than `distance_success` (m)", parameters={"distance_success": None}
)
def driven_distance(drive: Drive, distance_success: float) -> Finding:
    """Measure the way of the reference point."""
    distance = float(drive.steps.sum())
    far = distance > distance_success
    return Finding(far, distance, f"drove {distance:.1f} m, {'more' if far else 'not more'} than {distance_success:g} m")


@criterion(
    "ReachedRegionTest",
    unit="m",
    summary="it comes into the rectangle from (`min_x`, `min_y`) to (`max_x`, `max_y`) of the road network (m)",
    parameters={"min_x": None, "max_x": None, "min_y": None, "max_y": None},
)
def reached_region(drive: Drive, min_x: float, max_x: float, min_y: float, max_y: float) -> Finding:
    """Find the least distance of the box's centre from the rectangle, and when it is inside."""
    x, y = drive.centre()
    inside = np.flatnonzero((min_x < x) & (x < max_x) & (min_y < y) & (y < max_y))
    if len(inside):
        return Finding(True, 0.0, f"reached the region at {drive.columns['time'][inside[0]]:.2f} s")
    away = np.hypot(np.maximum(np.maximum(min_x - x, x - max_x), 0.0), np.maximum(np.maximum(min_y - y, y - max_y), 0.0))
    nearest = float(away.min())
    return Finding(False, nearest, f"did not reach the region; the nearest that it came was {nearest:.1f} m")
