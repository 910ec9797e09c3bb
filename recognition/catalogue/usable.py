"""Which vehicles of a recording are egos of scenes, and why others are not."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from recognition.datasets.source import Exclusion
from runner.recording import Recording, Track
from xodr.model import RoadPoint
from xodr.network import RoadNetwork


@dataclass(frozen=True)
class Usable:
    """What a vehicle has to be like.

    Attributes:
        duration: least time that it was recorded, s.
        extent: least diagonal of the area that it moves in, m.
        gap: greatest time without a row, s.
        speed: greatest speed from row to row, m/s: beyond, tracks jump.
        on_road: least share of rows on a lane.
    """

    duration: float = 1.5
    extent: float = 10.0
    gap: float = 2.0
    speed: float = 80.0
    on_road: float = 0.5


class Vehicle(NamedTuple):
    """A vehicle that is an ego: its name, when it was recorded first and last (s), and how it passes."""

    name: str
    start: float
    end: float
    passage: str


def vehicles(recording: Recording, network: RoadNetwork, needs: Usable) -> tuple[list[Vehicle], list[Exclusion]]:
    """The vehicles that are egos, and an exclusion for each other vehicle.

    The recording must have its road coordinates.
    """
    found, exclusions = [], []
    for track in recording.tracks.values():
        if track.kind != "vehicle":
            continue
        reasons = list(_reasons(track, network, needs))
        if reasons:
            exclusions.append(Exclusion(track.name, len(track.columns["time"]), "; ".join(reasons)))
        else:
            time = track.columns["time"]
            found.append(Vehicle(track.name, float(time[0]), float(time[-1]), passage(track)))
    return found, exclusions


def _reasons(track: Track, network: RoadNetwork, needs: Usable) -> Iterator[str]:
    columns = track.columns
    time, (x, y) = columns["time"], centre(track)
    if time[-1] - time[0] < needs.duration:
        yield f"recorded for {time[-1] - time[0]:.1f} s only"
        return
    extent = math.hypot(np.ptp(x), np.ptp(y))
    if extent < needs.extent:
        yield f"moves within {extent:.1f} m only"
    steps = np.diff(time)
    if steps.max() > needs.gap:
        yield f"not recorded for {steps.max():.1f} s in between"
    speed = float((np.hypot(np.diff(x), np.diff(y)) / steps).max())
    if speed > needs.speed:
        yield f"jumps at {speed:.0f} m/s"
    share = _on_road(track, network)
    if share < needs.on_road:
        yield f"on a road for {share:.0%} of its rows only"


def centre(track: Track) -> tuple[np.ndarray, np.ndarray]:
    """World x and y of the middle of a track's box, m."""
    columns, box = track.columns, track.box
    cos, sin = np.cos(columns["h"]), np.sin(columns["h"])
    return columns["x"] + box.x * cos - box.y * sin, columns["y"] + box.x * sin + box.y * cos


def _on_road(track: Track, network: RoadNetwork) -> float:
    columns = track.columns
    names = ("road_id", "s", "t", "lane_id", "lane_offset")
    return float(
        np.mean([network.on_road(RoadPoint(*place)) for place in zip(*(columns[name].tolist() for name in names), strict=True)])
    )


def passage(track: Track, reach: float = 5.0) -> str:
    """How a vehicle passes (left, right, straight, back), by the change of its direction from its first to its last metres.

    Args:
        reach: way (m) over which the direction is taken.
    """
    x, y = centre(track)
    way = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))])
    reach = min(reach, way[-1] / 3)
    a, b = int(np.searchsorted(way, reach)), int(np.searchsorted(way, way[-1] - reach))
    first, last = math.atan2(y[a] - y[0], x[a] - x[0]), math.atan2(y[-1] - y[b], x[-1] - x[b])
    turn = math.degrees(math.remainder(last - first, math.tau))
    if abs(turn) > 135.0:
        return "back"
    return "straight" if abs(turn) < 45.0 else "left" if turn > 0.0 else "right"
