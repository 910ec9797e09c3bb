"""inD, rounD, exiD and uniD: three CSV files a recording, named as highD's, on Lanelet2 maps.

Source: Bock et al., "The inD Dataset" (IV 2020); Krajewski et al., "The rounD Dataset" (ITSC 2020);
Moers et al., "The exiD Dataset" (IV 2022). Positions are centres of boxes in metres of UTM, less
`xUtmOrigin` and `yUtmOrigin`; y points north, headings are degrees from x to the left. The frames
count from 0, which is time 0. Pedestrians and cyclists may have no size (0 or blank). The map of a
location is an `.osm` in a folder `maps`, `lanelets` or `lanelet2` near the tracks; the first number
in its name is that of the location (`location1.osm`, `1_bendplatz.osm`).
"""

from __future__ import annotations

import re
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from recognition.recordings.conditions import OddConditions, daylight_of
from recognition.recordings.intake import Report
from recognition.recordings.motion.smoothing import smoothed
from recognition.recordings.road_sources import converted
from recognition.recordings.rows import (
    Clock,
    Rows,
    beside,
    categories,
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
from recognition.recordings.table import Kind, Table, column_names, read_table
from runner.recording import Recording
from schemas.common.array_types import FloatArray, IntArray
from schemas.common.errors import InvalidFile
from xodr.formats.lanelet2.osm import utm_zone

FORMAT = "inD"
TITLE = "inD, rounD, exiD, uniD"
BY_CONTENT = False
_TRACKS: dict[str, Kind] = {
    "trackId": "whole", "frame": "whole", "xCenter": "number", "yCenter": "number",
    "heading": "number",
    "width": "optional", "length": "optional",
    "xVelocity": "number", "yVelocity": "number", "xAcceleration": "number",
    "yAcceleration": "number",
}  # fmt: skip
_PARTICIPANTS: dict[str, Kind] = {
    "trackId": "whole", "initialFrame": "whole", "finalFrame": "whole", "class": "text",
    "width": "optional", "length": "optional",
}  # fmt: skip
_PLACE: dict[str, Kind] = {
    "locationId": "whole",
    "lonLocation": "number",
    "xUtmOrigin": "number",
    "yUtmOrigin": "number",
}
_SIZES = ("length", "width")
_CATEGORIES = {
    "car": "car", "van": "van", "truck": "truck", "truck_bus": "truck", "bus": "bus",
    "trailer": "trailer",
    "motorcycle": "motorbike", "bicycle": "bicycle", "pedestrian": "pedestrian",
}  # fmt: skip
_UNSIZED = ("pedestrian", "bicycle")
_EXID = {"latLaneCenterOffset", "laneChange"}
"""Columns of exiD alone; its authors take sizes from the tracks, where the tables contradict each
other"""
_MAPS = ("maps", "lanelets", "lanelet2")
_NEAR = 1.0
"""Origin and place of a recording are no farther apart, degrees of longitude."""
_LEVELS = 3
"""Number of parent folders of the tracks that are searched for maps."""


def claims(path: Path) -> bool:
    """Whether a file is the track file of a recording."""
    return is_tracks(path, centred=True)


def sources(path: Path, roads: Path) -> list[Source]:
    """The recording of a track file.

    Raises:
        InvalidFile: the recording lacks a file, or several maps are of its location.
    """
    recording = recording_of(path, _PLACE)
    location = int(recording["locationId"][0])
    lanelets, origin = _map(path, location), _origin(recording)
    road = None if lanelets is None else lambda _, folder: converted(lanelets, origin, folder)
    name, site = f"{path.parent.name}/{number(path)}", f"location{location}"
    return [
        Source(
            name,
            site,
            FORMAT,
            path,
            partial(_read, path, float(recording["frameRate"][0])),
            lanelets,
            origin,
            road,
            odd=partial(_conditions, path, origin),
        )
    ]


def _conditions(path: Path, origin: tuple[float, float]) -> OddConditions:
    meta = beside(path, "recordingMeta")
    limit = None
    if "speedLimit" in column_names(meta):
        stated = float(read_table(meta, {"speedLimit": "optional"})["speedLimit"][0])
        limit = stated if stated > 0.0 else None
    return OddConditions(daylight=daylight_of(meta, *origin), limit=limit)


def _map(path: Path, location: int) -> Path | None:
    """The Lanelet2 map of a location, in the nearest folder that has one."""
    # Resolved, as the parents of a relative path end early.
    for parent in list(path.resolve().parents)[:_LEVELS]:
        found = sorted(
            osm
            for name in _MAPS
            for osm in (parent / name).rglob("*.osm")
            if _first_number(osm) == location
        )
        if len(found) > 1:
            raise InvalidFile(
                f"{found[0]} and {found[1]} are both maps of location {location}, one is expected",
                path=path,
            )
        if found:
            return found[0]
    return None


def _first_number(path: Path) -> int | None:
    digits = re.search(r"\d+", path.stem)
    return int(digits[0]) if digits else None


def _origin(recording: Table) -> tuple[float, float]:
    """Latitude and longitude of the origin, in the UTM zone that the recording is in."""
    import pyproj

    longitude, easting, northing = (
        float(recording[name][0]) for name in ("lonLocation", "xUtmOrigin", "yUtmOrigin")
    )
    zone = utm_zone(longitude)
    # The zone follows from the longitude, which the file gives; a wrong origin lands far from it.
    projection = pyproj.Proj(proj="utm", zone=zone, ellps="WGS84")
    east, north = projection(easting, northing, inverse=True)
    if not (abs(longitude) <= 180.0 and abs(east - longitude) < _NEAR and abs(north) <= 84.0):
        raise recording.fault(
            0,
            "xUtmOrigin",
            f"({easting:g}, {northing:g}) in UTM zone {zone} is not near {longitude:g}° east",
        )
    return north, east


def _read(path: Path, rate: float) -> tuple[Recording, Report]:
    table = read_table(path, _TRACKS)
    rows = in_order(table, table["trackId"], Clock("frame", table["frame"], rate, 1.0 / rate))
    meta = _sized(read_table(beside(path, "tracksMeta"), _PARTICIPANTS))
    index = matched(table, rows, meta, "trackId")
    kinds = categories(meta, "class", _CATEGORIES)
    table = _sized(table)
    tracks_count = set(column_names(path)) >= _EXID
    remarks = other_sizes(table, rows, meta, index, _SIZES, first_counts=tracks_count)
    if tracks_count:
        meta = _with_sizes(meta, index, table, rows)
    check_sizes(meta, _SIZES, np.isin(kinds, _UNSIZED))
    who = [_participant(meta, row, str(kinds[row])) for row in index.tolist()]
    names = [one.name for one in who]
    report = rows.report(names)
    report.remarks += changes(table, rows, names, _SIZES) + remarks
    x, y, vx, vy, ax, ay = (
        table[name][rows.order]
        for name in (
            "xCenter",
            "yCenter",
            "xVelocity",
            "yVelocity",
            "xAcceleration",
            "yAcceleration",
        )
    )
    # Headings are in degrees, unlike INTERACTION's.
    h = np.radians(table["heading"][rows.order])
    speed, acceleration = (_along(h, *vector) for vector in ((vx, vy), (ax, ay)))
    columns = columns_of(rows, who, x, y, h, speed, acceleration)
    return Recording(cut(*smoothed(rows, who, columns, report)), 1.0 / rate, None), report


def _along(h: FloatArray, x: FloatArray, y: FloatArray) -> FloatArray:
    return x * np.cos(h) + y * np.sin(h)


def _sized(table: Table) -> Table:
    """The same table, with blanks where it says 0 for a size that was not measured."""
    return replace(
        table,
        columns=table.columns
        | {name: np.where(table[name] == 0.0, np.nan, table[name]) for name in _SIZES},
    )


def _with_sizes(meta: Table, index: IntArray, table: Table, rows: Rows) -> Table:
    """The same table, with sizes from the first rows of the tracks, where they have some."""
    columns = dict(meta.columns)
    for side in _SIZES:
        own = table[side][rows.heads]
        columns[side] = columns[side].copy()
        columns[side][index] = np.where(np.isnan(own), columns[side][index], own)
    return replace(meta, columns=columns)


def _participant(meta: Table, row: int, category: str) -> TrackParticipant:
    name, (length, width) = str(meta["trackId"][row]), (float(meta[side][row]) for side in _SIZES)
    return (
        participant(name, category)
        if np.isnan(length + width)
        else participant(name, category, length, width)
    )
