"""highD: three CSV files a recording, `NN_tracks.csv`, `NN_tracksMeta.csv`, `NN_recordingMeta.csv`.

Source: Krajewski, Bock, Kloeker, Eckstein, "The highD Dataset" (ITSC 2018). Positions are upper
left corners of boxes in an image whose y points downwards; `width` is the length of the vehicle
along x, `height` its width. The frames count from 1, which is time 0. The data set's own lane ids,
counted over all markings from above, stay in the column `source_lane`.
"""

from __future__ import annotations

import math
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np

from recognition.recordings.conditions import OddConditions, daylight_of
from recognition.recordings.intake import Report
from recognition.recordings.motion.smoothing import smoothed
from recognition.recordings.road_sources import Highway
from recognition.recordings.rows import (
    Clock,
    Columns,
    Rows,
    beside,
    changes,
    check_sizes,
    columns_of,
    cut,
    in_order,
    is_tracks,
    matched,
    number,
    other_sizes,
    recording_of,
)
from recognition.recordings.source import Source, TrackParticipant, participant
from recognition.recordings.table import GREATEST, Kind, Table, read_table
from runner.recording import Recording
from schemas.common.array_types import FloatArray, IntArray
from xodr.reader import load

FORMAT = "highD"
TITLE = "highD"
BY_CONTENT = False
_TRACKS: dict[str, Kind] = {
    "frame": "whole", "id": "whole", "x": "number", "y": "number", "width": "number",
    "height": "number",
    "xVelocity": "number", "yVelocity": "number", "xAcceleration": "number",
    "yAcceleration": "number", "laneId": "whole",
}  # fmt: skip
_VEHICLES: dict[str, Kind] = {
    "id": "whole", "width": "number", "height": "number", "class": "text",
    "drivingDirection": "whole",
    "initialFrame": "whole", "finalFrame": "whole",
}  # fmt: skip
_RECORDING: dict[str, Kind] = {
    "speedLimit": "number",
    "upperLaneMarkings": "text",
    "lowerLaneMarkings": "text",
}
_SIZES = ("width", "height")
_CATEGORIES = {"car": "car", "truck": "truck"}
_UPPER, _LOWER = 1, 2
_PLACE = (50.9, 7.0)
"""Latitude and longitude (degrees) about which all recordings of the data set were made: Cologne"""
_NO_LIMIT = -1.0
_STEADY = 5.0
"""Below this speed (m/s) the boxes' lateral noise would turn slow vehicles: they head along the
road ever more."""
_ROUND = 10.0
"""The road ends at multiples of this, m."""
_FARTHEST = 10_000.0
"""Distance of a vehicle from the middle one that the road is made for, m; the recordings show 420
m."""


def claims(path: Path) -> bool:
    """Whether a file is the track file of a recording."""
    return is_tracks(path, centred=False)


def sources(path: Path, roads: Path) -> list[Source]:
    """The recording of a track file; its road is written into the folder `roads`
    when it is loaded.
    """
    return [
        Source(
            f"{path.parent.name}/{number(path)}",
            number(path),
            FORMAT,
            path,
            partial(_read, path, roads),
            odd=partial(_conditions, path),
        )
    ]


def _conditions(path: Path) -> OddConditions:
    return OddConditions(daylight=daylight_of(beside(path, "recordingMeta"), *_PLACE))


def _read(path: Path, roads: Path) -> tuple[Recording, Report]:
    recording = recording_of(path, _RECORDING)
    rate = float(recording["frameRate"][0])
    vehicles = read_table(beside(path, "tracksMeta"), _VEHICLES)
    table = read_table(path, _TRACKS)
    # Frames count from 1.
    rows = in_order(table, table["id"], Clock("frame", table["frame"], rate, 1.0 / rate, zero=1))
    check_sizes(table, _SIZES)
    check_sizes(vehicles, _SIZES)
    index = matched(table, rows, vehicles, "id")
    who = [_participant(vehicles, row) for row in index.tolist()]
    columns = _columns(table, rows, who, vehicles["drivingDirection"][index])
    # Before the road is made, which would reach as far.
    far = np.abs(columns["x"] - np.median(columns["x"]))
    if far.max() > _FARTHEST:
        raise table.fault(
            int(rows.order[far.argmax()]),
            "x",
            f"the vehicle is {far.max():.0f} m away from the others",
        )
    names = [one.name for one in who]
    report = rows.report(names)
    report.remarks += changes(table, rows, names, _SIZES) + other_sizes(
        table, rows, vehicles, index, _SIZES
    )
    rows, who, columns = smoothed(rows, who, columns, report)
    highway = _highway(recording, columns["x"])
    # Places on the road are those of the smoothed tracks.
    columns |= highway.places(columns["x"], columns["y"])
    network = load(highway.write(f"highD_{number(path)}", roads))
    return Recording(cut(rows, who, columns), 1.0 / rate, network), report


def _columns(table: Table, rows: Rows, who: list[TrackParticipant], direction: IntArray) -> Columns:
    values = {name: table[name][rows.order] for name in _TRACKS}
    # From the image's upper left corner to the centre, and from y downwards to y to the left.
    x, y = values["x"] + 0.5 * values["width"], -(values["y"] + 0.5 * values["height"])
    vx, vy, ax, ay = (
        values["xVelocity"],
        -values["yVelocity"],
        values["xAcceleration"],
        -values["yAcceleration"],
    )
    h = _heading(vx, vy, rows.each(np.where(direction == _UPPER, -1.0, 1.0)))
    speed, acceleration = (
        along * np.cos(h) + across * np.sin(h) for along, across in ((vx, vy), (ax, ay))
    )
    columns = columns_of(rows, who, x, y, h, speed, acceleration)
    return columns | {"source_lane": values["laneId"]}


def _heading(vx: FloatArray, vy: FloatArray, ahead: FloatArray) -> FloatArray:
    """Direction of motion within a right angle of the driving direction, `ahead`
    = ±1 along x; rad.
    """
    # A lower bound of the speed along the road: the slower a vehicle, the nearer its heading to the
    # road.
    onwards = np.maximum(ahead * vx, _STEADY)
    return np.arctan2(vy, ahead * onwards)


def _participant(vehicles: Table, row: int) -> TrackParticipant:
    kind = vehicles["class"][row]
    category = _CATEGORIES.get(kind.strip().lower())
    if category is None:
        raise vehicles.fault(row, "class", f"{kind!r} is none of Car and Truck")
    if vehicles["drivingDirection"][row] not in (_UPPER, _LOWER):
        raise vehicles.fault(
            row,
            "drivingDirection",
            f"{vehicles['drivingDirection'][row]} is neither {_UPPER} nor {_LOWER}",
        )
    return participant(
        str(vehicles["id"][row]),
        category,
        float(vehicles["width"][row]),
        float(vehicles["height"][row]),
    )


def _highway(recording: Table, x: FloatArray) -> Highway:
    """The road that the markings describe, as long as the reference points need it."""
    upper, lower = (
        _markings(recording, name) for name in ("upperLaneMarkings", "lowerLaneMarkings")
    )
    # y downwards: the upper carriageway has the smaller values.
    if upper and lower and upper[-1] > lower[0]:
        raise recording.fault(
            0,
            "lowerLaneMarkings",
            f"the lower carriageway begins at {lower[0]:g}, inside the upper one",
        )
    limit = float(recording["speedLimit"][0])
    if limit <= 0.0 and limit != _NO_LIMIT:
        raise recording.fault(
            0, "speedLimit", f"{limit:g} m/s is no speed limit; {_NO_LIMIT:g} stands for none"
        )
    start, end = _ROUND * math.floor(x.min() / _ROUND), _ROUND * math.ceil(x.max() / _ROUND)
    return Highway(
        upper, lower, start, max(end, start + _ROUND), limit if limit > 0.0 else math.inf
    )


def _markings(recording: Table, name: str) -> tuple[float, ...]:
    try:
        markings = tuple(float(text) for text in recording[name][0].split(";") if text.strip())
    except ValueError:
        markings = ()
    rising = all(-GREATEST <= a < b <= GREATEST for a, b in pairwise(markings))
    if len(markings) < 2 or not rising:
        raise recording.fault(
            0,
            name,
            f"{recording[name][0]!r} are not two or more rising numbers, separated by semicolons",
        )
    return markings
