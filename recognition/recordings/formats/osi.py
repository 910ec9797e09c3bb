"""ASAM OSI ground truth: `.osi` and `.mcap` traces of GroundTruth or SensorView messages,
omega-prime's files among them, and the tables (CSV, Parquet) that omega-prime makes of these.

Source: ASAM OSI 3.8; see `runner.exchange.traces`; omega-prime's documented columns. Ground truth
is taken as it is, without smoothing. Traces need the extra `osi`, tables do not. A row of a table
is an object at a time, by the numbers of OSI's types; places are centres of boxes. Parquet files
may hold their OpenDRIVE map and the number of the host vehicle in the metadata.
"""

from __future__ import annotations

import math
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from recognition.recordings.conditions import UNKNOWN, OddConditions, phase_of
from recognition.recordings.formats.rosbag import is_mcap
from recognition.recordings.intake import Exclusion, Gap, Report
from recognition.recordings.rows import (
    Clock,
    check_sizes,
    columns_of,
    cut,
    in_order,
)
from recognition.recordings.source import SiteRoad, Source, TrackParticipant, participant
from recognition.recordings.table import PARQUET, Kind, Table, column_names, read_table
from runner.exchange.traces.maps import road_of
from runner.exchange.traces.reading import TraceRecording
from runner.exchange.traces.reading import read as read_trace
from runner.recording import Recording, Track
from schemas.common.errors import InvalidFile, UsageError
from schemas.common.storage import digest, keep
from schemas.osi.traces import SUFFIXES

FORMAT = "OSI"
TITLE = "ASAM OSI traces (.osi, .mcap) and omega-prime's tables"
BY_CONTENT = True
_SNOW = 274.15
"""Temperature (K) below which precipitation is snow"""
_LATE = 1.5
"""Steps after which messages are missing between two rows of a track"""
_COLUMNS: dict[str, Kind] = {
    "total_nanos": "stamp", "idx": "stamp",
    "x": "number", "y": "number", "z": "number",
    "vel_x": "number", "vel_y": "number", "acc_x": "number", "acc_y": "number",
    "length": "number", "width": "number", "height": "number",
    "roll": "number", "pitch": "number", "yaw": "number",
    "type": "integer", "subtype": "integer",
}  # fmt: skip
_NANO = 1_000_000_000
_VEHICLE, _TYPES = 2, {3: "pedestrian"}
"""OSI's number of the type of vehicles, and categories by those of other moving objects; all others
are obstacles"""
_SUBTYPES = {
    6: "van", 7: "truck", 8: "trailer", 9: "trailer", 10: "motorbike", 11: "bicycle", 12: "bus",
    13: "tram", 14: "tram", 16: "truck", 17: "bicycle", 18: "bicycle", 19: "truck",
}  # fmt: skip
"""Categories by OSI's number of the type of a vehicle; all others are cars"""


def claims(path: Path) -> bool:
    """Whether a file is a trace, by its name, or a table of omega-prime, by its columns."""
    suffix = path.suffix.lower()
    return (suffix in SUFFIXES and not is_mcap(path)) or (
        suffix in (".csv", PARQUET) and set(column_names(path)) >= set(_COLUMNS)
    )


def sources(path: Path, roads: Path) -> list[Source]:
    """The recording of a trace or table, which is a site of its own."""
    name = path.stem
    if path.suffix.lower() not in SUFFIXES:
        read, metadata = partial(_read_table, path), _metadata(path)
        host = metadata.get(b"host_vehicle_idx")
        road = partial(_attached, path, metadata[b"xodr"]) if b"xodr" in metadata else None
        ego = partial(_host, host)
        return [Source(name, name, FORMAT, path, read, road=road, ego=ego)]
    return [
        Source(
            path.stem,
            path.stem,
            FORMAT,
            path,
            partial(_read, path),
            road=partial(_road, path),
            ego=partial(_ego, path),
            odd=partial(_conditions, path),
        )
    ]


@lru_cache(maxsize=1)
def _trace(path: Path, _version: int) -> TraceRecording:
    """Read a trace; the result is cached for its road, which is read next."""
    return read_trace(path)


def _ego(path: Path) -> str | None:
    """Name of the host vehicle of a trace; None where it names none."""
    return _trace(path, path.stat().st_mtime_ns).ego


def _conditions(path: Path) -> OddConditions:
    return conditions_in(_trace(path, path.stat().st_mtime_ns).truth.environmental_conditions)


def conditions_in(told: Any) -> OddConditions:
    """Rain, snow, fog and daylight of OSI's EnvironmentalConditions."""
    weather = UNKNOWN
    if told.precipitation > told.PRECIPITATION_NONE:
        # The message has one kind of precipitation; what falls below 1 °C is snow.
        weather = "snow" if 0.0 < told.temperature < _SNOW else "rain"
    elif told.fog >= told.FOG_MIST:
        weather = "fog"
    elif told.precipitation == told.PRECIPITATION_NONE:
        weather = "clear"
    sun = math.degrees(told.sun.elevation) if told.HasField("sun") else None
    return OddConditions(weather, UNKNOWN if sun is None else phase_of(sun))


def _read(path: Path) -> tuple[Recording, Report]:
    # The time of change is part of the key: a trace that was written anew is read anew.
    found = _trace(path, path.stat().st_mtime_ns)
    tracks = [
        Track(track.name, track.kind, track.category, track.box, track.read)
        for track in found.recording.tracks.values()
    ]
    recording = Recording(tracks, found.recording.timestep, None)
    exclusions = [Exclusion(*omission) for omission in found.left_out]
    report = Report(
        sum(len(track.columns["time"]) for track in tracks),
        len(tracks),
        exclusions=exclusions,
        remarks=[*found.remarks],
    )
    for track in tracks:
        time = track.columns["time"]
        for row in np.flatnonzero(np.diff(time) > _LATE * recording.timestep).tolist():
            start, end = float(time[row]), float(time[row + 1])
            report.gaps.append(
                Gap(track.name, start, end, round((end - start) / recording.timestep) - 1)
            )
    return recording, report


def _road(path: Path, _recording: Recording, folder: Path) -> SiteRoad:
    found = road_of(path, _trace(path, path.stat().st_mtime_ns), folder)
    if found is None:
        raise UsageError(
            f"{path.stem} has no road: no map, no lanes, and no {path.stem}.xodr beside it; give "
            "one by --road",
            path=path,
        )
    return SiteRoad(found.path, notes=found.notes)


# tables of omega-prime --------------------------------------------------------------------------


def _metadata(path: Path) -> dict[bytes, bytes]:
    """Metadata of a Parquet file; other tables have none."""
    import pyarrow.parquet as pq

    return (pq.read_schema(path).metadata or {}) if path.suffix == PARQUET else {}


def _host(host: bytes | None) -> str | None:
    return host.decode(errors="replace") if host is not None else None


def _attached(path: Path, content: bytes, _recording: Recording, folder: Path) -> SiteRoad:
    """The road in the metadata of a table."""
    made = keep(content, folder / f"{digest(path.stem.encode())}-{digest(content)}.xodr")
    return SiteRoad(made, notes=("the road is the one in the table's metadata",))


def _read_table(path: Path) -> tuple[Recording, Report]:
    table = read_table(path, _COLUMNS)
    check_sizes(table, ("length", "width", "height"))
    counts = table["total_nanos"]
    zero = int(counts.min())
    clock = Clock("total_nanos", counts, _NANO, _step(table), zero)
    rows = in_order(table, table["idx"], clock, sort=True)
    heads = rows.heads
    who = [_participant(table, row) for row in heads]
    h, vx, vy, ax, ay, z, pitch, roll = (
        table[name][rows.order]
        for name in ("yaw", "vel_x", "vel_y", "acc_x", "acc_y", "z", "pitch", "roll")
    )
    along, across = np.cos(h), np.sin(h)
    columns = columns_of(
        rows, who, table["x"][rows.order], table["y"][rows.order], h,
        vx * along + vy * across, ax * along + ay * across,
    )  # fmt: skip
    columns |= {"z": z - rows.each(table["height"][heads]) / 2, "pitch": pitch, "roll": roll}
    report = rows.report([one.name for one in who])
    others = sorted({int(kind) for kind in table["type"][heads]} - {_VEHICLE, *_TYPES})
    report.remarks += (f"moving objects of type {kind} are taken as obstacles" for kind in others)
    return Recording(cut(rows, who, columns), clock.step, None), report


def _step(table: Table) -> float:
    """Median time between the messages of a table, s."""
    apart = np.diff(np.unique(table["total_nanos"]))
    if not len(apart):
        raise InvalidFile("all rows are of one time", path=table.path)
    return float(np.median(apart)) / _NANO


def _participant(table: Table, row: int) -> TrackParticipant:
    kind, subtype = int(table["type"][row]), int(table["subtype"][row])
    vehicle = kind == _VEHICLE
    category = _SUBTYPES.get(subtype, "car") if vehicle else _TYPES.get(kind, "obstacle")
    size = float(table["length"][row]), float(table["width"][row])
    return participant(str(table["idx"][row]), category, *size)
