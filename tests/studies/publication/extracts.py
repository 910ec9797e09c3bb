"""Small recordings with the files and all columns of highD and INTERACTION, as their public
descriptions have them.

highD: Krajewski et al., "The highD Dataset", ITSC 2018, and its page of formats: `NN_tracks.csv`,
`NN_tracksMeta.csv`, `NN_recordingMeta.csv`. INTERACTION: Zhan et al., arXiv:1910.03088:
`recorded_trackfiles/SITE/vehicle_tracks_NNN.csv` beside `maps/SITE.osm`, a Lanelet2 map.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from schemas.common.array_types import FloatArray

# highD ------------------------------------------------------------------------------------------

_RATE, _LENGTH = 25, 420.0
_UPPER, _LOWER = (8.51, 12.59, 16.43), (21.0, 24.96, 28.8)
_TRACKS = (
    *("frame", "id", "x", "y", "width", "height", "xVelocity", "yVelocity", "xAcceleration"),
    *("yAcceleration", "frontSightDistance", "backSightDistance", "dhw", "thw", "ttc"),
    *("precedingXVelocity", "precedingId", "followingId", "leftPrecedingId", "leftAlongsideId"),
    *("leftFollowingId", "rightPrecedingId", "rightAlongsideId", "rightFollowingId", "laneId"),
)
_VEHICLES = (
    *("id", "width", "height", "initialFrame", "finalFrame", "numFrames", "class"),
    *("drivingDirection", "traveledDistance", "minXVelocity", "maxXVelocity", "meanXVelocity"),
    *("minDHW", "minTHW", "minTTC", "numLaneChanges"),
)
_RECORDING = (
    *("id", "frameRate", "locationId", "speedLimit", "month", "weekDay", "startTime", "duration"),
    *("totalDrivenDistance", "totalDrivenTime", "numVehicles", "numCars", "numTrucks"),
    *("upperLaneMarkings", "lowerLaneMarkings"),
)


class _Drive(NamedTuple):
    """A car.

    Attributes:
        along: distance from the start of the stretch, m. speed: m/s.
        lane: from the right; 0 or 1. to: that it changes to in the middle of its drive.
        takes: duration of the change, s. at: its middle, from that of the drive, s.
        gain: acceleration for 2.5 s, m/s². late: its time after the middle of the drive, s.
    """

    along: float
    speed: float
    lane: int
    to: int | None = None
    gain: float = 0.0
    late: float = 0.0
    takes: float = 4.0
    at: float = 0.0

    def varied(self, draw: np.random.Generator, faster: float) -> _Drive:
        """Another one like it."""
        return self._replace(
            along=self.along + draw.uniform(0.0, 40.0) * (self.along > 0.0),
            speed=self.speed + faster + draw.uniform(-0.5, 0.5),
            gain=self.gain + draw.uniform(-0.3, 0.6),
            late=self.late + draw.uniform(-3.0, 3.0),
            takes=self.takes + draw.uniform(-0.8, 0.8),
            at=self.at + draw.uniform(-1.5, 1.5),
        )


_SCENES: tuple[tuple[_Drive, ...], ...] = (
    (_Drive(0.0, 33.0, 0),),  # free cruise
    (_Drive(0.0, 28.0, 0), _Drive(42.0, 28.0, 0)),  # car following
    (_Drive(0.0, 28.0, 0, gain=-3.0, late=1.0), _Drive(54.0, 28.0, 0, gain=-3.0)),
    # Cut in; soon after the start of the stretch and just before its end too.
    *[(_Drive(0.0, 30.0, 0), _Drive(60.0, 28.0, 1, 0, at=at)) for at in (0.0, -4.0, 4.0)],
    *[(_Drive(0.0, 29.0, 0), _Drive(45.0, 29.0, 0, 1))] * 2,  # cut out
    # Slow traffic, as roads in towns need, early and late: cut in, and braking.
    *[
        (_Drive(0.0, 10.0, 0), _Drive(10.0, 10.0, 1, 0, gain=0.2, late=at, at=at))
        for at in (-15.0, -15.0, 13.0, 13.0)
    ],
    *[
        (
            _Drive(0.0, 14.0, 0, gain=-2.4, late=late + 1.0),
            _Drive(27.0, 14.0, 0, gain=-2.4, late=late),
        )
        for late in (-9.0, 8.0)
    ],
    (_Drive(0.0, 31.0, 0, 1),),  # left lane change
    (_Drive(0.0, 31.0, 1, 0),),  # right lane change
)


def write_highd(folder: Path, numbers: Iterable[int]) -> None:
    """Write recordings of two carriageways with one scene after the other."""
    for number in numbers:
        draw = np.random.default_rng(number)
        tracks, vehicles = list[list[object]](), list[list[object]]()
        first = 1
        for scene in _SCENES:
            for direction in (1, 2):
                faster = draw.uniform(-2.0, 2.0)
                last = first
                for drive in scene:
                    own = drive.varied(draw, faster)
                    rows = _rows(len(vehicles) + 1, own, direction, first)
                    tracks += rows
                    last = max(last, first + len(rows) - 1)
                    vehicles.append(_vehicle(rows, direction, drive.to is not None))
            first = last + 10 * _RATE
        recording = (number, _RATE, 2, -1, "09.2017", "Tue", "08:38", first / _RATE, 0, 0)
        markings = (";".join(map(str, each)) for each in (_UPPER, _LOWER))
        counts = (len(vehicles), len(vehicles), 0)
        for name, header, table in (
            ("tracks", _TRACKS, tracks),
            ("tracksMeta", _VEHICLES, vehicles),
            ("recordingMeta", _RECORDING, [[*recording, *counts, *markings]]),
        ):
            _write(folder / f"{number:02}_{name}.csv", header, table)


def _rows(number: int, drive: _Drive, direction: int, first: int) -> list[list[object]]:
    """Rows of a car from the start of the stretch to its end. The image's y points downwards."""
    length, width = 4.6, 1.9
    middle = 0.5 * (_LENGTH - drive.along) / drive.speed
    time = np.arange(0.0, 4.0 * middle, 1.0 / _RATE)
    since = np.clip(time - middle - drive.late, 0.0, 2.5)
    speed = drive.speed + drive.gain * since
    along = drive.along + np.concatenate([[0.0], np.cumsum(speed[:-1])]) / _RATE
    share = np.clip((time - middle - drive.at) / drive.takes + 0.5, 0.0, 1.0)
    moved = 0.5 - 0.5 * np.cos(np.pi * share)
    rate = np.pi / (2.0 * drive.takes) * np.sin(np.pi * share)
    start = _middle(direction, drive.lane)
    end = _middle(direction, drive.lane if drive.to is None else drive.to)
    y = start + (end - start) * moved
    forward = 1.0 if direction == 2 else -1.0
    x = along if direction == 2 else _LENGTH - along - length
    acceleration = np.where((since > 0.0) & (since < 2.5), drive.gain, 0.0)
    borders = np.array((*_UPPER, *_LOWER))
    return [
        [
            *(first + k, number, f"{x[k]:.2f}", f"{y[k] - width / 2:.2f}", length, width),
            *(f"{forward * speed[k]:.2f}", f"{(end - start) * rate[k]:.2f}"),
            *(f"{forward * acceleration[k]:.2f}", 0.0),
            # Distances to others and their numbers: not read.
            *([0.0] * 6),
            *([0] * 8),
            1 + int(np.searchsorted(borders, y[k])),
        ]
        for k in range(int(np.searchsorted(along, _LENGTH - length)))
    ]


def _middle(direction: int, lane: int) -> float:
    """Middle of a lane, counted from the right of its direction, in the image (m)."""
    borders = _LOWER[::-1] if direction == 2 else _UPPER
    return 0.5 * (borders[lane] + borders[lane + 1])


def _vehicle(rows: Sequence[Sequence[object]], direction: int, changes: bool) -> list[object]:
    first, last = rows[0], rows[-1]
    speed = abs(float(str(first[6])))
    return [
        *(first[1], first[4], first[5], first[0], last[0], len(rows), "Car", direction),
        *(f"{speed * len(rows) / _RATE:.2f}", speed, speed, speed, -1, -1, -1, int(changes)),
    ]


# INTERACTION ------------------------------------------------------------------------------------

_SITE = "DR_TEST_Intersection_XX"
_INTERACTION = (
    *("track_id", "frame_id", "timestamp_ms", "agent_type", "x", "y", "vx", "vy", "psi_rad"),
    *("length", "width"),
)
_ARM, _MOUTH, _LANE = 70.0, 10.0, 3.5
"""Length of an arm, its distance from the centre, and the width of a lane (m)"""


def write_interaction(folder: Path, numbers: Iterable[int]) -> None:
    """Write a crossing of four arms, and recordings of cars that cross it alone, one every 12 s:
    straight on, to the right and to the left."""
    (folder / "maps").mkdir(parents=True)
    (folder / "maps" / f"{_SITE}.osm").write_text(_map(), encoding="utf-8")
    for number in numbers:
        draw, rows = np.random.default_rng(100 + number), list[list[object]]()
        for track, (arm, turn) in enumerate((arm, turn) for turn in (2, 1, 3) for arm in range(4)):
            places = _route(arm, turn)
            speed = draw.uniform(8.0, 10.0) if turn == 2 else draw.uniform(5.0, 6.5)
            rows += _crossing(track + 1, places, speed, 120 * track)
        path = folder / "recorded_trackfiles" / _SITE / f"vehicle_tracks_{number:03}.csv"
        _write(path, _INTERACTION, rows)


def _crossing(track: int, places: FloatArray, speed: float, first: int) -> list[list[object]]:
    """Rows of a car along places (n, 2) at a speed, 10 a second."""
    steps = np.hypot(*np.diff(places, axis=0).T)
    way = np.concatenate([[0.0], np.cumsum(steps)])
    at = np.arange(0.0, way[-1], 0.1 * speed)
    x, y = (np.interp(at, way, places[:, axis]) for axis in (0, 1))
    heading = np.arctan2(np.gradient(y), np.gradient(x))
    return [
        [
            *(track, first + k + 1, 100 * (first + k + 1), "car", f"{x[k]:.3f}", f"{y[k]:.3f}"),
            *(f"{speed * math.cos(heading[k]):.3f}", f"{speed * math.sin(heading[k]):.3f}"),
            *(f"{heading[k]:.3f}", 4.5, 1.8),
        ]
        for k in range(len(at))
    ]


def _point(arm: int, along: float, aside: float) -> tuple[float, float]:
    """A point of an arm: distance from the centre, and to the left of the way outwards (m)."""
    angle = 0.5 * math.pi * arm
    cos, sin = math.cos(angle), math.sin(angle)
    return along * cos - aside * sin, along * sin + aside * cos


def _line(arm: int, turn: int, right: float) -> FloatArray:
    """Points (n, 2) from an arm to another one, `right` of the middle lines (m): traffic keeps to
    the right."""
    start, end = (np.array(_point(*one)) for one in ((arm, _MOUTH, right), _out(arm, turn, right)))
    t = np.linspace(0.0, 1.0, 9)[:, None]
    if turn == 2:
        return (1 - t) * start + t * end
    # A parabola whose corner is where the two lines meet.
    ahead, across = _point(arm, 1.0, 0.0), _point(arm + turn, 1.0, 0.0)
    back = np.linalg.solve(np.stack([ahead, -np.array(across)], axis=1), end - start)[0]
    return (1 - t) ** 2 * start + 2 * t * (1 - t) * (start + back * np.array(ahead)) + t**2 * end


def _out(arm: int, turn: int, right: float) -> tuple[int, float, float]:
    return arm + turn, _MOUTH, -right


def _route(arm: int, turn: int) -> FloatArray:
    """Middle of the lanes (n, 2) from the end of an arm to that of another one."""
    middle = 0.5 * _LANE
    ends = _point(arm, _ARM, middle), _point(arm + turn, _ARM, -middle)
    return np.concatenate([[ends[0]], _line(arm, turn, middle), [ends[1]]])


def _map() -> str:
    """The crossing in Lanelet2: lanes into it, out of it, and through it."""
    nodes, parts = dict[tuple[float, float], int](), list[str]()

    def way(places: FloatArray, kind: str) -> int:
        number = 10_000 + len(parts)
        refs = "".join(
            f"<nd ref='{nodes.setdefault((x, y), 1000 + len(nodes))}'/>"
            for x, y in places.round(4).tolist()
        )
        parts.append(f"<way id='{number}'>{refs}<tag k='type' v='{kind}'/></way>")
        return number

    def lanelet(left: FloatArray, right: FloatArray, kind: str) -> None:
        sides = zip(("left", "right"), (way(left, kind), way(right, kind)), strict=True)
        members = "".join(f"<member type='way' ref='{ref}' role='{side}'/>" for side, ref in sides)
        tags = "".join(
            f"<tag k='{key}' v='{value}'/>"
            for key, value in (
                ("type", "lanelet"), ("subtype", "road"), ("location", "urban"),
                ("one_way", "yes"), ("speed_limit", "50km/h"),
            )
        )  # fmt: skip
        parts.append(f"<relation id='{10_000 + len(parts)}'>{members}{tags}</relation>")

    for arm in range(4):
        into, out = (
            [np.array([_point(arm, each, side) for each in ends]) for side in (0.0, aside)]
            for ends, aside in (((_ARM, _MOUTH), _LANE), ((_MOUTH, _ARM), -_LANE))
        )
        lanelet(into[0], into[1], "line_thin")
        lanelet(out[0], out[1], "line_thin")
        for turn in (1, 2, 3):
            lanelet(_line(arm, turn, 0.0), _line(arm, turn, _LANE), "virtual")
    # As in the data set: about latitude and longitude 0.
    degree = 111_319.5
    points = "".join(
        f"<node id='{number}' lat='{y / degree:.10f}' lon='{x / degree:.10f}'/>"
        for (x, y), number in nodes.items()
    )
    ways, relations = (
        [one for one in parts if one.startswith(f"<{kind}")] for kind in ("way", "relation")
    )
    return f"<?xml version='1.0'?><osm version='0.6'>{points}{''.join((*ways, *relations))}</osm>"


def _write(path: Path, header: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file).writerows([header, *rows])
