"""Whether a map that was found for a recording, and did not come with it, is that of its place."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from runner.recording import Recording, Track
from schemas.errors import InvalidFile
from xodr.array_types import FloatArray, IntArray
from xodr.lookup import placing
from xodr.model import RoadPoint
from xodr.network import RoadNetwork

_LEAST_ON_ROAD = 1.0 / 3.0
"""Least share of the vehicles' places that are on a road: on its own map it is 65 % in the worst of the real recordings."""
_MOST_ASTRAY = 1.0 / 3.0
"""Greatest share of places where vehicles go astray: on its own map it is 3 % in the worst of the real recordings, on that of
another junction, or turned or mirrored, mostly 45 % and more where five move. Of four, two may have ways that it lacks."""
_ASTRAY = math.radians(45.0)
"""Vehicles whose motion is more than this away from the traffic of their lane (rad) go across it or against it."""
_MOVING = 2.0
"""Least speed of vehicles whose direction of motion counts, m/s."""
_SAMPLED = 500
"""Rows of a recording that are looked at."""


def require_fit(recording: Recording, network: RoadNetwork, name: str, path: Path) -> None:
    """Refuse a map that can't be that of a recording.

    Raises:
        InvalidFile: few vehicles are on its roads, or many go across its lanes or against their traffic; says so of the map's
            `name`, and of the recording's `path`.
    """
    on_road, astray = share_on_road(recording, network), share_astray(recording, network)
    if on_road < _LEAST_ON_ROAD:
        found = f"only {on_road:.0%} of the vehicles' places are on a road of {name}"
    elif astray > _MOST_ASTRAY:
        found = f"at {astray:.0%} of their places vehicles go across the lanes of {name} or against the traffic there"
    else:
        return
    raise InvalidFile(f"{found}: a map of this place is needed, in the same coordinates", path=path)


def share_on_road(recording: Recording, network: RoadNetwork) -> float:
    """Share of the places of vehicles that are on a lane, by some of all; 1 where there is no vehicle.

    Vehicles that never move may be parked beside the road: they count only where no other is.
    """
    vehicles = [track for track in recording.tracks.values() if track.kind == "vehicle"]
    movers = [track for track in vehicles if (np.abs(track.columns["speed"]) >= _MOVING).any()]
    points = _on_lanes(_sampled(movers or vehicles), network)
    return float(np.mean([point is not None for point in points])) if points else 1.0


def share_astray(recording: Recording, network: RoadNetwork) -> float:
    """Share of the places on lanes where moving vehicles go across the lane or against its traffic, by some of all.

    Cyclists don't count, nor does the vehicle that goes astray most: a single one may turn where the map has no lane. 0 where
    there is no other.
    """
    motor = [track for track in recording.tracks.values() if track.kind == "vehicle" and track.category != "bicycle"]
    sample = _sampled(motor, _MOVING)
    points = _on_lanes(sample, network)
    on = np.array([point is not None for point in points], bool)
    ways = np.array([_way(network, point) for point in points if point is not None])
    astray = np.abs(np.remainder(sample.h[on] - ways + math.pi, math.tau) - math.pi) > _ASTRAY
    track = sample.track[on]
    others = track != np.bincount(track, astray, minlength=1).argmax()
    return float(astray[others].mean()) if others.any() else 0.0


class _Sample(NamedTuple):
    """Some rows of tracks: number of the track, place (m), direction of motion (rad)."""

    track: IntArray
    x: FloatArray
    y: FloatArray
    z: FloatArray
    h: FloatArray


def _sampled(tracks: Sequence[Track], slowest: float = 0.0) -> _Sample:
    """Rows spread evenly over those that are no slower (m/s)."""
    columns = [track.columns for track in tracks]
    x, y, z, h, speed = (np.concatenate([np.zeros(0), *(one[name] for one in columns)]) for name in ("x", "y", "z", "h", "speed"))
    track = np.repeat(np.arange(len(columns)), np.array([len(one["x"]) for one in columns], int))
    fast = np.flatnonzero(np.abs(speed) >= slowest)
    rows = fast[np.linspace(0, len(fast) - 1, _SAMPLED).astype(int)] if len(fast) else fast
    return _Sample(track[rows], x[rows], y[rows], z[rows], np.where(speed < 0.0, h + math.pi, h)[rows])


def _on_lanes(sample: _Sample, network: RoadNetwork) -> list[RoadPoint | None]:
    """The road point of each row, None where that is on no lane."""
    places = placing.place(network, sample.x, sample.y, sample.z, sample.h)
    columns = (places.road_id, places.s, places.t, places.lane_id, places.offset)
    points = (RoadPoint(*row) for row in zip(*(column.tolist() for column in columns), strict=True))
    return [point if network.on_road(point) else None for point in points]


def _way(network: RoadNetwork, point: RoadPoint) -> float:
    """Heading of the traffic of a point's lane, rad."""
    road = network.roads[point.road_id]
    return road.heading(point.s) + (math.pi if road.direction(point.lane_id, point.s) < 0 else 0.0)
