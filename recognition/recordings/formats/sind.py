"""SinD: drone recordings of signalised intersections, at 9.99 Hz.

Source: Xu et al., "SIND: A Drone Dataset at Signalized Intersection in China" (ITSC 2022), and the
data set's Format.md. A recording is a folder with `Veh_smoothed_tracks.csv` and perhaps
`Ped_smoothed_tracks.csv`, in columns like those of INTERACTION: `yaw_rad` is the direction of the
box, `heading_rad` that of the motion, and `timestamp_ms` has decimals. Positions are centres, in
the frame of the site's Lanelet2 map: the only `.osm` file beside the tracks, or in the nearest
folder above that has one.

Beside them is a file with the phases of the traffic lights, by numbers that only a picture of the
site places: it says that the site has lights, and their states are not read.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np

from recognition.recordings.formats.interaction import made_of, median_step, tracks_of
from recognition.recordings.intake import Report
from recognition.recordings.rows import Clock
from recognition.recordings.source import Source
from recognition.recordings.table import Kind, Table, read_table
from runner.recording import Recording, Track

FORMAT = "SinD"
TITLE = "SinD"
BY_CONTENT = False
STEP = 1.0 / 9.99
"""Time between frames (s): every third one of a camera with 29.97 Hz"""

VEHICLES, PEDESTRIANS = "Veh_smoothed_tracks.csv", "Ped_smoothed_tracks.csv"
_COLUMNS: dict[str, Kind] = {
    "track_id": "text", "timestamp_ms": "number", "agent_type": "text",
    "x": "number", "y": "number", "vx": "number", "vy": "number",
}  # fmt: skip
_BOX: dict[str, Kind] = {"yaw_rad": "number", "length": "number", "width": "number"}
_MICROSECONDS = 1e6
_LEVELS = 3
"""Number of parent folders of the tracks that are searched for maps."""


def claims(path: Path) -> bool:
    """Whether a file is the (main) track file of a recording."""
    return path.name == VEHICLES or (
        path.name == PEDESTRIANS and not path.with_name(VEHICLES).is_file()
    )


def sources(path: Path, roads: Path) -> list[Source]:
    """The recording of a folder."""
    folder = path.parent
    maps = next(
        (
            found
            for parent in list(path.parents)[:_LEVELS]
            if (found := sorted(parent.glob("*.osm")))
        ),
        [],
    )
    lanelets = maps[0] if len(maps) == 1 else None
    site = lanelets.parent.name if lanelets is not None else folder.parent.name
    road = made_of(lanelets, None, bool(_lights(folder)))
    return [Source(folder.name, site, FORMAT, path, partial(_read, path), lanelets, road=road)]


def _lights(folder: Path) -> list[str]:
    """Names of the files with the phases of traffic lights."""
    return sorted(file.name for file in folder.glob("*.csv") if "light" in file.name.lower())


def _read(path: Path) -> tuple[Recording, Report]:
    main = read_table(path, _COLUMNS | (_BOX if path.name == VEHICLES else {}))
    step = median_step(main, STEP)
    tracks, report = _tracks(main, step)
    beside = path.with_name(PEDESTRIANS)
    if beside != path and beside.is_file():
        taken = frozenset(track.name for track in tracks)
        more, other = _tracks(read_table(beside, _COLUMNS), step, taken)
        tracks += more
        report.add(other)
    report.remarks += (
        f"{name}: the states of traffic lights are not read, as it does not say where they stand"
        for name in _lights(path.parent)
    )
    return Recording(tracks, step, None), report


def _tracks(
    table: Table, step: float, taken: frozenset[str] = frozenset()
) -> tuple[list[Track], Report]:
    counts = np.rint(1000.0 * table["timestamp_ms"]).astype(np.int64)
    return tracks_of(table, Clock("timestamp_ms", counts, _MICROSECONDS, step), taken)
