"""NGSIM tables, as CSV, Parquet or the FHWA's text without a header, in two layouts.

Public: the columns of the FHWA's files (Vehicle_ID, Frame_ID, Local_X, … in any case), in feet, or
in metres where they are called Local_X(m) and so on. Local_Y runs along the road, Local_X to its
right, and both are of the middle of the front bumper. The world has x along the road and y to its
left. A vehicle id that appears in several periods of recording stands for several vehicles. Where
there is a column Location, each location is a source. Text (.txt) has the 18 columns of the
motorways' files (US-101, I-80), always in feet.

Metric: vehicle_id, sim_time, position_x, position_y, heading_rad, speed, lane_id, type, length,
width; positions are taken as centres.

Source: U.S. FHWA, "NGSIM Vehicle Trajectories and Supporting Data" (2016). The data set's own lane
ids stay in `source_lane`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from functools import lru_cache, partial
from pathlib import Path

import numpy as np

from recognition.recordings.intake import Report
from recognition.recordings.motion.smoothing import smoothed
from recognition.recordings.road_sources import keep_road, straight_road
from recognition.recordings.rows import (
    Clock,
    Columns,
    Rows,
    changes,
    check_sizes,
    columns_of,
    cut,
    heading_of_motion,
    in_order,
    rate,
)
from recognition.recordings.source import SiteRoad, Source, TrackParticipant, participant
from recognition.recordings.table import (
    HEADLESS,
    PARQUET,
    Kind,
    Table,
    column_names,
    first_numbers,
    read_table,
)
from runner.recording import Recording
from schemas.common.array_types import FloatArray, IntArray
from schemas.common.errors import InvalidFile

FORMAT = "NGSIM"
TITLE = "NGSIM"
BY_CONTENT = True
STEP = 0.1
FOOT = 0.3048
_MISTAKEN_FOOT = 0.3084
"""A slip of the pen in files that were converted to metres; they give it away, being whole
hundredths of a foot only with it."""
_MILLISECONDS, _FRAMES = 1000.0, 10.0
_PERIOD = 60_000
"""Clocks of two periods of recording differ by more than this, ms."""

_PUBLIC: dict[str, Kind] = {
    "vehicle_id": "whole", "frame_id": "whole", "local_x": "number", "local_y": "number",
    "v_vel": "number",
}  # fmt: skip
_PUBLIC_MORE: dict[str, Kind] = {
    "global_time": "whole", "v_length": "number", "v_width": "number", "v_class": "whole",
    "v_acc": "number", "lane_id": "whole",
    "location": "text",
}  # fmt: skip
_METRIC: dict[str, Kind] = {
    "vehicle_id": "whole", "sim_time": "number", "position_x": "number", "position_y": "number",
    "heading_rad": "number",
    "speed": "number", "lane_id": "whole", "type": "whole", "length": "number", "width": "number",
}  # fmt: skip
_PUBLIC_CONSTANTS, _METRIC_CONSTANTS = (
    ("v_class", "v_length", "v_width"),
    ("type", "length", "width"),
)
"""Columns with what a vehicle is, and its sizes"""
_HEADLESS = (
    "vehicle_id", "frame_id", "total_frames", "global_time", "local_x", "local_y", "global_x",
    "global_y", "v_length", "v_width", "v_class", "v_vel", "v_acc", "lane_id", "preceding",
    "following", "space_headway", "time_headway",
)  # fmt: skip
"""Columns of the text without a header"""
_CATEGORIES = {1: "motorbike", 2: "car", 3: "truck"}


def claims(path: Path) -> bool:
    """Whether a file is a table in one of the layouts."""
    if path.suffix == HEADLESS:
        return len(first_numbers(path)) == len(_HEADLESS)
    if path.suffix not in (".csv", PARQUET):
        return False
    names = {_plain(name) for name in column_names(path)}
    return "vehicle_id" in names and ("frame_id" in names or "sim_time" in names)


def sources(path: Path, roads: Path) -> list[Source]:
    """The recording of a table, or one for each of its locations."""
    spelling = _spelling(path)
    if "sim_time" in spelling:
        return [_source(path, path.stem, path.stem, partial(_read_metric, path))]
    if "location" not in spelling:
        return [_source(path, path.stem, path.stem, partial(_read_public, path, None))]
    column = spelling["location"]
    places = dict.fromkeys(read_table(path, {column: "text"})[column])
    return [
        _source(path, f"{path.stem}/{place}", place, partial(_read_public, path, place))
        for place in places
    ]


def _source(
    path: Path, name: str, site: str, read: Callable[[], tuple[Recording, Report]]
) -> Source:
    """A recording; there is no map, but its lateral positions show the lanes."""

    def road(recording: Recording, folder: Path) -> SiteRoad:
        return SiteRoad(keep_road(straight_road(recording, site).to_xml(), site, folder))

    return Source(name, site, FORMAT, path, read, road=road)


def _names(path: Path) -> Sequence[str]:
    return _HEADLESS if path.suffix == HEADLESS else column_names(path)


def _plain(name: str) -> str:
    return name.lower().removesuffix("(m)")


def _spelling(path: Path) -> dict[str, str]:
    """Return a file's spelling of its columns, by their plain names.

    Raises:
        InvalidFile: two of its columns differ in spelling only.
    """
    spelling: dict[str, str] = {}
    for name in _names(path):
        other = spelling.setdefault(_plain(name), name)
        if other != name:
            raise InvalidFile(
                f"this column is there as {other!r} too", path=path, element=f"column {name}"
            )
    return spelling


def _renamed(path: Path, kinds: dict[str, Kind], more: dict[str, Kind] | None = None) -> Table:
    """Columns by their plain names; those of `more` where the file has them."""
    spelling = _spelling(path)
    chosen = kinds | {name: kind for name, kind in (more or {}).items() if name in spelling}
    table = read_table(
        path, {spelling.get(name, name): kind for name, kind in chosen.items()}, _HEADLESS
    )
    return Table(
        path, {_plain(name): values for name, values in table.columns.items()}, table.lines
    )


@lru_cache(maxsize=1)
def _public(path: Path, _version: int) -> Table:
    """A public table, kept while its locations are read one after the other."""
    return _renamed(path, _PUBLIC, _PUBLIC_MORE)


def _read_public(path: Path, location: str | None) -> tuple[Recording, Report]:
    if location is None:
        table = _renamed(path, _PUBLIC, _PUBLIC_MORE)
    else:
        table = _public(path, path.stat().st_mtime_ns)
        table = table.where(table["location"] == location)
    remarks: list[str] = []
    unit = _unit(table, any(name.endswith("(m)") for name in _names(path)), remarks)
    track, names = _vehicles(table)
    # Public tables come in any order, some with repeated rows.
    rows = in_order(table, track, _clock(table), sort=True, repeats=True)
    who = _participants(table, rows, names, _PUBLIC_CONSTANTS, unit, remarks)
    if not {"v_length", "v_width"} <= table.columns.keys():
        remarks.append("sizes are the usual ones of the category")
    columns = _public_columns(table, rows, who, unit, remarks)
    return _finished(rows, who, columns, remarks)


def _public_columns(
    table: Table, rows: Rows, who: list[TrackParticipant], unit: float, remarks: list[str]
) -> Columns:
    # Local_Y runs along the road, Local_X to its right; y points to the left.
    x, y = unit * table["local_y"][rows.order], -unit * table["local_x"][rows.order]
    h = heading_of_motion(rate(x, rows), rate(y, rows), rows)
    remarks.append("headings are the directions of motion")
    # Local_X and Local_Y are of the middle of the front bumper.
    half = 0.5 * rows.each([one.box.length for one in who])
    speed = unit * table["v_vel"][rows.order]
    if "v_acc" in table.columns:
        acceleration = unit * table["v_acc"][rows.order]
    else:
        acceleration = rate(speed, rows)
        remarks.append("accelerations are derived from the speeds")
    columns = columns_of(
        rows, who, x - half * np.cos(h), y - half * np.sin(h), h, speed, acceleration
    )
    return columns | (
        {"source_lane": table["lane_id"][rows.order]} if "lane_id" in table.columns else {}
    )


def _unit(table: Table, metres: bool, remarks: list[str]) -> float:
    """Metres in one unit of the table's lengths."""
    if not metres:
        return FOOT
    speeds = table["v_vel"]
    # Speeds were published in hundredths of a foot per second: which factor gives them back tells
    # which one was used.
    if _hundredths(speeds / _MISTAKEN_FOOT) and not _hundredths(speeds / FOOT):
        remarks.append(
            f"lengths were converted at {_MISTAKEN_FOOT} m a foot: they are corrected to {FOOT}"
        )
        return FOOT / _MISTAKEN_FOOT
    return 1.0


def _hundredths(values: FloatArray) -> bool:
    """Whether all values are whole hundredths."""
    return bool((np.abs(100.0 * values - np.round(100.0 * values)) < 1e-6).all())


def _clock(table: Table) -> Clock:
    if "global_time" in table.columns:
        return Clock(
            "Global_Time",
            table["global_time"],
            _MILLISECONDS,
            STEP,
            zero=int(table["global_time"].min()),
        )
    return Clock("Frame_ID", table["frame_id"], _FRAMES, STEP, zero=int(table["frame_id"].min()))


def _vehicles(table: Table) -> tuple[IntArray, list[str]]:
    """Key of each row's vehicle, and the name for each key in ascending order."""
    period = np.zeros(len(table), np.int64)
    if "global_time" in table.columns:
        # Global time less the frames' time is when a period began: vehicles of two periods share
        # ids.
        period = np.round(
            (table["global_time"] - table["frame_id"] * STEP * _MILLISECONDS) / _PERIOD
        ).astype(np.int64)
    pairs, key = np.unique(np.stack([table["vehicle_id"], period]), axis=1, return_inverse=True)
    ids = pairs[0].tolist()
    count, seen = Counter(ids), Counter[int]()
    names = []
    for vehicle in ids:
        seen[vehicle] += 1
        names.append(f"{vehicle}.{seen[vehicle]}" if count[vehicle] > 1 else str(vehicle))
    return key.reshape(-1), names


def _participants(
    table: Table,
    rows: Rows,
    names: Sequence[str],
    columns: Sequence[str],
    unit: float,
    remarks: list[str],
) -> list[TrackParticipant]:
    """Return the participants of the tracks from the columns class, length and width, where
    present."""
    kind, *sizes = columns
    if kind in table.columns:
        unknown = ~np.isin(table[kind], list(_CATEGORIES))
        if unknown.any():
            row = int(unknown.argmax())
            raise table.fault(
                row, kind, f"{table[kind][row]} is none of 1 (motorcycle), 2 (car) and 3 (truck)"
            )
    check_sizes(table, [side for side in sizes if side in table.columns])
    remarks += changes(table, rows, names, [name for name in columns if name in table.columns])
    who = []
    for name, row in zip(names, rows.heads, strict=True):
        category = _CATEGORIES[int(table[kind][row])] if kind in table.columns else "car"
        sized = [unit * float(table[side][row]) for side in sizes if side in table.columns]
        who.append(participant(name, category, *(sized if len(sized) == len(sizes) else ())))
    return who


def _read_metric(path: Path) -> tuple[Recording, Report]:
    table = _renamed(path, _METRIC)
    remarks: list[str] = []
    frame = np.round(table["sim_time"] / STEP).astype(np.int64)
    keys, track = np.unique(table["vehicle_id"], return_inverse=True)
    rows = in_order(table, track, Clock("sim_time", frame, _FRAMES, STEP), sort=True, repeats=True)
    who = _participants(
        table, rows, [str(key) for key in keys.tolist()], _METRIC_CONSTANTS, 1.0, remarks
    )
    x, y, h, speed = (
        table[name][rows.order] for name in ("position_x", "position_y", "heading_rad", "speed")
    )
    h = h + _turn(x, y, h, rows, remarks)
    remarks.append(
        "positions are taken as centres of the boxes; accelerations are derived from the speeds"
    )
    columns = columns_of(rows, who, x, y, h, speed, rate(speed, rows))
    return _finished(rows, who, columns | {"source_lane": table["lane_id"][rows.order]}, remarks)


def _turn(x: FloatArray, y: FloatArray, h: FloatArray, rows: Rows, remarks: list[str]) -> float:
    """Quarter turns between the direction that headings count from and the x axis, from the motion,
    rad."""
    vx, vy = rate(x, rows), rate(y, rows)
    # Sums over all rows: vehicles drive forwards on the whole, so their mean direction is 0 if
    # headings count from x.
    ahead, aside = (vx * np.cos(h) + vy * np.sin(h)).sum(), (vy * np.cos(h) - vx * np.sin(h)).sum()
    quarters = round(float(np.arctan2(aside, ahead)) / (0.5 * np.pi))
    if quarters:
        remarks.append(f"headings are turned by {90 * quarters} degrees, to count from the x axis")
    return quarters * 0.5 * np.pi


def _finished(
    rows: Rows, who: list[TrackParticipant], columns: Columns, remarks: list[str]
) -> tuple[Recording, Report]:
    report = rows.report([one.name for one in who])
    report.remarks += remarks
    return Recording(cut(*smoothed(rows, who, columns, report)), STEP, None), report
