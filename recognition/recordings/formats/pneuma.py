"""pNEUMA: drone recordings of a whole district, by latitude and longitude.

Source: Barmpounakis and Geroliminis, "On the new era of urban traffic monitoring with massive drone
data: The pNEUMA large-scale field experiment" (Transportation Research Part C, 2020), and the
columns that the data set's page states. A line is a vehicle, with values between semicolons: four
about it, then six for each of its frames, so that lines have unlike lengths. Speeds are km/h, times
seconds from the start, 0.04 s apart. Headings and sizes are not recorded: headings are those of the
motion, sizes the usual ones of a category.

Places become metres east and north of an origin in the UTM zone: the nearest tenths of a degree, so
that recordings of one district share a frame. A Lanelet2 map is the only `.osm` file beside it.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from recognition.recordings.formats.interaction import made_of
from recognition.recordings.intake import Report
from recognition.recordings.motion.smoothing import smoothed
from recognition.recordings.rows import (
    Clock,
    columns_of,
    cut,
    heading_of_motion,
    in_order,
    rate,
)
from recognition.recordings.source import Source, TrackParticipant, participant
from recognition.recordings.table import GREATEST, Table
from runner.recording import Recording
from schemas.common.array_types import FloatArray
from schemas.common.errors import InvalidFile
from xodr.formats.lanelet2.osm import utm_zone

FORMAT = "pNEUMA"
TITLE = "pNEUMA"
BY_CONTENT = True
STEP = 0.04
"""Time between frames, s"""
_ABOUT = ("track_id", "type", "traveled_d", "avg_speed")
_FRAME = ("lat", "lon", "speed", "lon_acc", "lat_acc", "time")
_HEADER = [*_ABOUT, *_FRAME]
_CATEGORIES = {
    "car": "car", "taxi": "car", "bus": "bus", "medium vehicle": "van", "heavy vehicle": "truck",
    "motorcycle": "motorbike", "bicycle": "bicycle", "pedestrian": "pedestrian",
}  # fmt: skip
_KILOMETRES_PER_HOUR = 3.6
_POLES = 84.0
"""Greatest latitude of UTM, degrees"""
_MICRO = 1_000_000
_LONGEST_HEADER = 200


def claims(path: Path) -> bool:
    """Whether a file begins with the names of the columns."""
    if path.suffix.lower() != ".csv":
        return False
    with path.open("rb") as file:
        first = file.readline(_LONGEST_HEADER).decode(errors="replace").removeprefix("\ufeff")
    return _values(first) == _HEADER


def sources(path: Path, roads: Path) -> list[Source]:
    """The recording of a file; its folder is the site."""
    maps = sorted(path.parent.glob("*.osm"))
    lanelets = maps[0] if len(maps) == 1 else None
    origin = _origin(path) if lanelets is not None else None
    road = made_of(lanelets, origin, signalised=False)
    site = path.parent.name or path.stem
    return [Source(path.stem, site, FORMAT, path, partial(_read, path), lanelets, origin, road)]


class _Line(NamedTuple):
    """Vehicle of a line: its name, category, and a row of values for each frame (n, 6)."""

    number: int
    name: str
    category: str
    frames: FloatArray


def _values(line: str) -> list[str]:
    """The values of a line, which may end in a separator."""
    return [value.strip() for value in line.strip().rstrip(";").split(";")]


def _lines(path: Path) -> Iterator[_Line]:
    """Yield the vehicles of a file.

    Raises:
        InvalidFile: a line is malformed; names line and column.
    """
    try:
        with path.open(encoding="utf-8-sig") as file:
            next(file)
            for number, text in enumerate(file, 2):
                if text.strip():
                    yield _line(path, number, _values(text))
    except UnicodeDecodeError:
        raise InvalidFile("this is not UTF-8 text", path=path) from None


def _line(path: Path, number: int, values: list[str]) -> _Line:
    about, rest = values[: len(_ABOUT)], values[len(_ABOUT) :]
    if not rest or len(rest) % len(_FRAME):
        told = (
            f"{len(values)} values in this line: {len(_ABOUT)} about the vehicle and "
            f"{len(_FRAME)} for each of its frames are expected"
        )
        raise InvalidFile(told, path=path, line=number)
    name, word = about[0], about[1]
    if not name or not name.isprintable():
        told = f"{name!r} is no name of a track"
        raise InvalidFile(told, path=path, line=number, element=f"column {_ABOUT[0]}")
    category = _CATEGORIES.get(word.lower())
    if category is None:
        told = f"{word!r} is none of {', '.join(_CATEGORIES)}"
        raise InvalidFile(told, path=path, line=number, element=f"column {_ABOUT[1]}")
    frames = _numbers(path, number, rest)
    later = np.diff(frames[:, -1]) > 0.0
    if not later.all():
        frame = int(later.argmin()) + 1
        told = (
            f"time {frames[frame, -1]:g} of track {name} follows {frames[frame - 1, -1]:g}: "
            "times must increase"
        )
        raise InvalidFile(told, path=path, line=number, element=_column(frame, len(_FRAME) - 1))
    return _Line(number, name, category, frames)


def _column(frame: int, index: int) -> str:
    return f"column {_FRAME[index]} of frame {frame + 1}"


def _numbers(path: Path, line: int, values: list[str]) -> FloatArray:
    """Values of the frames (n, 6); each is measured and each place on Earth."""
    try:
        found = np.array(values, dtype=np.float64)
        bad = ~(np.abs(found) <= GREATEST)
    except ValueError:
        bad = np.array([not _is_number(value) for value in values])
    if bad.any():
        frame, index = divmod(int(bad.argmax()), len(_FRAME))
        told = f"{values[int(bad.argmax())]!r} is no measured value"
        raise InvalidFile(told, path=path, line=line, element=_column(frame, index))
    frames = found.reshape(-1, len(_FRAME))
    off = (np.abs(frames[:, 0]) > _POLES) | (np.abs(frames[:, 1]) > 180.0)
    if off.any():
        frame = int(off.argmax())
        told = f"({frames[frame, 0]:g}, {frames[frame, 1]:g}) is no latitude and longitude of UTM"
        raise InvalidFile(told, path=path, line=line, element=_column(frame, 0))
    return frames


def _is_number(value: str) -> bool:
    try:
        return abs(float(value)) <= GREATEST
    except ValueError:
        return False


def _origin(path: Path) -> tuple[float, float]:
    """Latitude and longitude (degrees) of the origin: the first place, to tenths."""
    first = next(_lines(path), None)
    if first is None:
        raise InvalidFile("there is no vehicle below the header", path=path)
    return round(float(first.frames[0, 0]), 1), round(float(first.frames[0, 1]), 1)


def _metres(origin: tuple[float, float], frames: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Metres east and north of the origin, in its UTM zone."""
    import pyproj

    projection = pyproj.Proj(proj="utm", zone=utm_zone(origin[1]), ellps="WGS84")
    x, y = projection(frames[:, 1], frames[:, 0])
    zero_x, zero_y = projection(origin[1], origin[0])
    return x - zero_x, y - zero_y


def _read(path: Path) -> tuple[Recording, Report]:
    origin = _origin(path)
    who, parts = list[TrackParticipant](), list[FloatArray]()
    first: dict[str, int] = {}
    for line in _lines(path):
        before = first.setdefault(line.name, line.number)
        if before != line.number:
            told = f"track {line.name} is in line {before} already"
            raise InvalidFile(told, path=path, line=line.number, element=f"column {_ABOUT[0]}")
        who.append(participant(line.name, line.category))
        parts.append(line.frames)
    frames = np.concatenate(parts)
    track = np.repeat(np.arange(len(parts)), [len(part) for part in parts])
    counts = np.round(frames[:, -1] * _MICRO).astype(np.int64)
    table = Table(path, {"time": counts}, lines=False)
    rows = in_order(table, track, Clock("time", counts, _MICRO, STEP))
    x, y = _metres(origin, frames)
    vx, vy = rate(x, rows), rate(y, rows)
    h = heading_of_motion(vx, vy, rows)
    speed = frames[:, 2] / _KILOMETRES_PER_HOUR
    columns = columns_of(rows, who, x, y, h, speed, frames[:, 3])
    report = rows.report([one.name for one in who])
    report.remarks += (
        f"places are metres east and north of {origin[0]:g}, {origin[1]:g} (UTM)",
        "headings are not recorded: they are those of the motion",
        "sizes are not recorded: they are the usual ones of each category",
    )
    return Recording(cut(*smoothed(rows, who, columns, report)), STEP, None), report
