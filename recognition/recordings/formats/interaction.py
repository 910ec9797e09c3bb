"""INTERACTION: CSV files of tracks at 10 Hz, in both layouts, and data sets with their columns
(TAF-BW, SinD).

Source: Zhan et al., "INTERACTION Dataset" (arXiv:1910.03088). In the first layout a recording is
`vehicle_tracks_NNN.csv` and perhaps `pedestrian_tracks_NNN.csv` in a folder named after the site.
In the second, `<site>_train.csv` (or `_val`, `_test`) holds many cases, numbered in `case_id`: each
is a scene of its own and becomes a source of its own. The site's Lanelet2 map is `<site>.osm`.
Positions are centres; x, y, psi are those of the map. Pedestrians may lack psi, length and width.
Time is `timestamp_ms`: frame numbers count frames of the camera, and need not be regular. Rows of a
track at the same time as another one are excluded and reported.

Velocities that contradict the positions are derived from them, and so are headings that then
contradict them too: TAF-BW has a recording with all velocities backwards and headings folded into
one half of the circle, and one at half the speed.

SinD (Xu et al., "SIND: A Drone Dataset at Signalized Intersection in China", ITSC 2022, and its
Format.md) has drone recordings of signalised intersections at 9.99 Hz. A recording is a folder with
`Veh_smoothed_tracks.csv` and perhaps `Ped_smoothed_tracks.csv`: `yaw_rad` is the direction of the
box, `heading_rad` that of the motion, and `timestamp_ms` has decimals. The map is the only `.osm`
file beside the tracks, or in the nearest folder above that has one. Beside the tracks is a file
with the phases of the traffic lights, by numbers that only a picture of the site places: it says
that the site has lights, and their states are not read.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Container
from functools import lru_cache, partial
from itertools import count
from pathlib import Path

import numpy as np

from recognition.recordings.intake import MOVED, REPAIRED, Check, Report, one_factor
from recognition.recordings.motion.smoothing import smoothed
from recognition.recordings.road_sources import converted
from recognition.recordings.rows import (
    Clock,
    Columns,
    Rows,
    believable,
    categories,
    changes,
    check_sizes,
    columns_of,
    cut,
    facing,
    heading_of_motion,
    in_order,
    rate,
)
from recognition.recordings.source import SiteRoad, Source, TrackParticipant, participant
from recognition.recordings.table import Kind, Table, column_names, read_table
from runner.recording import Recording, Track
from schemas.common.array_types import BoolArray, FloatArray

FORMAT, SIND = "INTERACTION", "SinD"
TITLE = "INTERACTION, TAF-BW, SinD"
BY_CONTENT = True
STEP = 0.1
"""Usual time between rows, s"""
_USUAL_STEP = 0.2
"""Relative difference from the usual step up to which it is that one"""
_LONGEST_STEP = 1.0
"""Step (s) above which rows are apart by gaps, not by steps"""
_MILLISECONDS = 1000.0

_FIRST_LAYOUT = re.compile(r"(vehicle|pedestrian)_tracks_(\w+)\.csv")
_SPLIT = re.compile(r"_(train|val|test)\w*$")
_COLUMNS: dict[str, Kind] = {
    "track_id": "text", "timestamp_ms": "whole", "agent_type": "text",
    "x": "number", "y": "number", "vx": "number", "vy": "number",
}  # fmt: skip
_SIZES = ("length", "width")
_HEADINGS = ("psi_rad", "yaw_rad")
"""Columns of headings, the first that is there"""
_VEHICLES, _PEDESTRIANS = "Veh_smoothed_tracks.csv", "Ped_smoothed_tracks.csv"
_SIND_STEP = 1.0 / 9.99
"""Time between frames of SinD (s): every third one of a camera with 29.97 Hz"""
_MICROSECONDS = 1e6
_BOX: dict[str, Kind] = {"psi_rad": "optional", **dict.fromkeys(_SIZES, "optional")}
_CATEGORIES = {
    "car": "car", "van": "van", "truck": "truck", "bus": "bus", "tram": "tram",
    "motorcycle": "motorbike", "motorbike": "motorbike", "tricycle": "motorbike",
    "bike": "bicycle", "bicycle": "bicycle", "cyclist": "bicycle", "pedestrian": "pedestrian",
    "pedestrian/bicycle": "pedestrian",
}  # fmt: skip
_SIND_COLUMNS: dict[str, Kind] = _COLUMNS | {"timestamp_ms": "number"}
_SIND_BOX: dict[str, Kind] = {"yaw_rad": "number", **dict.fromkeys(_SIZES, "number")}
_FULL_TURN = 7.0
"""Headings beyond this are no angles from 0 to 2π or from −π to π, rad."""
_LEVELS = 3
"""Number of parent folders of the tracks that are searched for maps."""


_SPAN = 5
"""Rows over which ways are compared with velocities"""
_STEADY = 0.1
"""Greatest change of velocities from row to row, as a share of them, of motion"""
_DOUBT = 0.05
"""Share by which velocities that contradict the positions lower the quality"""


def claims(path: Path) -> bool:
    """Whether a file is the (main) track file of recordings."""
    if path.suffix != ".csv":
        return False
    if path.name in (_VEHICLES, _PEDESTRIANS):
        return path.name == _VEHICLES or not path.with_name(_VEHICLES).is_file()
    named = _FIRST_LAYOUT.fullmatch(path.name)
    if named:
        return (
            named[1] == "vehicle" or not path.with_name(f"vehicle_tracks_{named[2]}.csv").is_file()
        )
    names = column_names(path)
    return "track_id" in names and ("timestamp_ms" in names or "agent_type" in names)


def sources(path: Path, roads: Path) -> list[Source]:
    """The recording of a track file, or its cases."""
    if path.name in (_VEHICLES, _PEDESTRIANS):
        return [_of_sind(path)]
    named = _FIRST_LAYOUT.fullmatch(path.name)
    site = path.parent.name if named else _SPLIT.sub("", path.stem)
    lanelets = _map(path, site)
    if "case_id" in column_names(path):
        cases = dict.fromkeys(read_table(path, {"case_id": "text"})["case_id"])
        # Cases may be numbered 1.0, 2.0 and so on, as tracks may.
        names = {case: f"{path.stem}/{case.removesuffix('.0')}" for case in cases}
        return [
            Source(
                name,
                site,
                FORMAT,
                path,
                partial(_read_case, path, case),
                lanelets,
                road=made_of(lanelets, None, False),
            )
            for case, name in names.items()
        ]
    number = named[2] if named else ""
    name, origin = f"{site}/{number}" if named else path.stem, _origin(path, number)
    road = made_of(lanelets, origin, bool(named) and _has_phases(path.parent))
    return [Source(name, site, FORMAT, path, partial(_read, path), lanelets, origin, road)]


def _has_phases(folder: Path) -> bool:
    """Whether phases of traffic lights were recorded at the place of a folder (k733 of
    k733_2018-05-02), on any day."""
    place = folder.name.split("_")[0]
    return any(
        file.parent.name.split("_")[0] == place
        for file in folder.parent.glob("*/signal_phases_*.csv")
    )


def made_of(
    lanelets: Path | None, origin: tuple[float, float] | None, signalised: bool
) -> Callable[[Recording, Path], SiteRoad] | None:
    """Makes the road of a Lanelet2 map, if there is one.

    Args:
        lanelets: the map.
        origin: latitude and longitude (degrees) of the origin of its coordinates, if known.
        signalised: whether phases of traffic lights were recorded: maps often lack the lights.
    """
    return (
        None
        if lanelets is None
        else lambda _, folder: converted(lanelets, origin, folder)._replace(signalised=signalised)
    )


def _map(path: Path, site: str) -> Path | None:
    folders = [
        folder for parent in list(path.parents)[:_LEVELS] for folder in (parent, parent / "maps")
    ]
    return next(
        (folder / f"{site}.osm" for folder in folders if (folder / f"{site}.osm").is_file()), None
    )


def _origin(path: Path, number: str) -> tuple[float, float] | None:
    """Latitude and longitude of the origin, from a meta_data.csv as TAF-BW has it."""
    meta = path.with_name("meta_data.csv")
    if not meta.is_file() or not {"id", "originLat", "originLon"} <= set(column_names(meta)):
        return None
    table = read_table(meta, {"id": "text", "originLat": "number", "originLon": "number"})
    places = zip(table["id"], table["originLat"].tolist(), table["originLon"].tolist(), strict=True)
    return next(((lat, lon) for name, lat, lon in places if name == number), None)


def _read(path: Path) -> tuple[Recording, Report]:
    table = _table(path)
    step = _step(table)
    tracks, report = _tracks(table, step)
    pedestrians = path.with_name(path.name.replace("vehicle_", "pedestrian_"))
    if pedestrians != path and pedestrians.is_file():
        # The two files are numbered apart, and names of a recording are unique.
        taken = frozenset(track.name for track in tracks)
        more, other = _tracks(_table(pedestrians), step, taken)
        tracks += more
        report.add(other)
    phases = path.with_name(path.name.replace("vehicle_tracks_", "signal_phases_"))
    if phases != path and phases.is_file():
        report.remarks.append(_unread(phases.name))
    return Recording(tracks, step, None), report


def _unread(name: str) -> str:
    return f"{name}: the states of traffic lights are not read, as it does not say where they stand"


def _step(table: Table) -> float:
    """Time between rows of a track, s: the usual one unless most rows are otherwise apart."""
    step = _median_step(table, STEP)
    # rows further apart than a second are gaps, in which nobody knows what moved
    usual = abs(step / STEP - 1.0) < _USUAL_STEP or step > _LONGEST_STEP
    return STEP if usual else step


def _median_step(table: Table, usual: float) -> float:
    """Median time between rows of a track, s; the usual one where no track has two rows."""
    order = np.lexsort((table["timestamp_ms"], table["track_id"]))
    same = table["track_id"][order][1:] == table["track_id"][order][:-1]
    apart = np.diff(table["timestamp_ms"][order])[same]
    return float(np.median(apart[apart > 0])) / _MILLISECONDS if (apart > 0).any() else usual


def _read_case(path: Path, case: str) -> tuple[Recording, Report]:
    table = _cases(path, path.stat().st_mtime_ns)
    table = table.where(table["case_id"] == case)
    step = _step(table)
    tracks, report = _tracks(table, step)
    return Recording(tracks, step, None), report


@lru_cache(maxsize=1)
def _cases(path: Path, _version: int) -> Table:
    """A file with cases, kept while its cases are read one after the other."""
    return _table(path, {"case_id": "text"})


def _table(path: Path, more: dict[str, Kind] | None = None) -> Table:
    boxes = any(name in column_names(path) for name in _BOX) or not path.name.startswith(
        "pedestrian"
    )
    return read_table(path, (more or {}) | _COLUMNS | (_BOX if boxes else {}))


def _tracks(
    table: Table, step: float, taken: frozenset[str] = frozenset()
) -> tuple[list[Track], Report]:
    return _tracks_of(
        table, Clock("timestamp_ms", table["timestamp_ms"], _MILLISECONDS, step), taken
    )


def _tracks_of(
    table: Table, clock: Clock, taken: frozenset[str] = frozenset()
) -> tuple[list[Track], Report]:
    """Tracks of a table, with names unlike those `taken`."""
    row_names = [name.removesuffix(".0") for name in table["track_id"]]
    number = {name: index for index, name in enumerate(dict.fromkeys(row_names))}
    track = np.fromiter((number[name] for name in row_names), np.int64, len(table))
    rows = in_order(table, track, clock, names=list(number), repeats=True)
    names = [_free(name, taken, number) for name in number]
    kinds = categories(table, "agent_type", _CATEGORIES)
    _check_sizes(table, kinds == "pedestrian")
    who = [
        _participant(table, row, name, str(kinds[row]))
        for name, row in zip(names, rows.heads, strict=True)
    ]
    report = rows.report(names)
    report.remarks += changes(
        table, rows, names, [name for name in ("agent_type", *_SIZES) if name in table.columns]
    )
    return cut(*smoothed(rows, who, _columns(table, rows, who, report), report)), report


def _check_sizes(table: Table, walks: BoolArray) -> None:
    """Refuse rows without a size; pedestrians' need none."""
    if _SIZES[0] in table.columns:
        check_sizes(table, _SIZES, walks)
    elif not walks.all():
        raise table.fault(
            int(walks.argmin()),
            "agent_type",
            "no column length, width: only pedestrians may lack a size",
        )


def _free(name: str, taken: frozenset[str], others: Container[str]) -> str:
    """A name, led by P where it is taken."""
    if name not in taken:
        return name
    return next(
        free for n in count(1) if (free := "P" * n + name) not in taken and free not in others
    )


def _participant(table: Table, row: int, name: str, category: str) -> TrackParticipant:
    """Return the participant of a track from its first row."""
    if _SIZES[0] not in table.columns:
        return participant(name, category)
    length, width = (float(table[side][row]) for side in _SIZES)
    return (
        participant(name, category)
        if np.isnan(length + width)
        else participant(name, category, length, width)
    )


def _columns(table: Table, rows: Rows, who: list[TrackParticipant], report: Report) -> Columns:
    x, y, vx, vy = (table[name][rows.order] for name in ("x", "y", "vx", "vy"))
    credible = believable(x, y, vx, vy, rows) or _scaled(x, y, vx, vy, rows)
    if not credible:
        reason = "the velocities contradict the positions: speeds are derived from the positions"
        report.checks.append(Check("velocities", REPAIRED, _DOUBT, reason))
        vx, vy = rate(x, rows), rate(y, rows)
    h = _headings(table, rows, who, vx, vy)
    # Degrees only if three things agree: values no angle in rad has, and motion that fits as
    # degrees and not as they are.
    if np.abs(h).max() > _FULL_TURN and not facing(h, vx, vy) and facing(np.radians(h), vx, vy):
        h = np.radians(h)
        report.remarks.append(
            "the headings are taken as degrees: they go beyond a full turn, and agree with the "
            "motion as degrees"
        )
    if not credible and not facing(h, vx, vy):
        h = heading_of_motion(vx, vy, rows)
        report.remarks.append(
            "the headings contradict the positions too: they are taken from the motion"
        )
    speed = vx * np.cos(h) + vy * np.sin(h)
    report.remarks.append("accelerations are derived from the speeds")
    return columns_of(rows, who, x, y, h, speed, rate(speed, rows))


def _scaled(x: FloatArray, y: FloatArray, vx: FloatArray, vy: FloatArray, rows: Rows) -> bool:
    """Whether velocities are those of the positions but for one factor, as with a wrong step: the
    intake names it."""
    # Over half a second of rows: from row to row, noise of places is as large as the way.
    span = min(_SPAN, int((rows.last - np.arange(len(x))).max(initial=0)))
    if not span:
        return False
    here = np.arange(len(x) - span)
    here = here[rows.last[here] >= here + span]
    dx, dy = x[here + span] - x[here], y[here + span] - y[here]
    way, time = np.hypot(dx, dy), rows.time[here + span] - rows.time[here]
    sums = [np.concatenate([[0.0], np.cumsum(v)]) for v in (vx, vy)]
    stated_x, stated_y = ((total[here + span] - total[here]) / span for total in sums)
    moving = way >= MOVED
    ahead = moving & (dx * stated_x + dy * stated_y > 0.0)
    if 2 * ahead.sum() <= moving.sum():
        return False
    stated = np.hypot(stated_x, stated_y)[ahead]
    # Velocities that change at random have one factor in the mean, and are of no use.
    change = np.hypot(np.diff(vx), np.diff(vy))[here[ahead]]
    steady = np.median(change) <= _STEADY * np.median(stated)
    return bool(steady and one_factor((way / time)[ahead] / stated) is not None)


def _headings(
    table: Table, rows: Rows, who: list[TrackParticipant], vx: FloatArray, vy: FloatArray
) -> FloatArray:
    """The given headings; for pedestrians without, the direction of motion."""
    column = next((name for name in _HEADINGS if name in table.columns), None)
    given = table[column][rows.order] if column is not None else np.full(len(rows), np.nan)
    absent = np.isnan(given)
    wrong = np.flatnonzero(absent & rows.each([one.kind != "pedestrian" for one in who]))
    if len(wrong):
        raise table.fault(int(rows.order[wrong[0]]), column or "psi_rad", "a value is missing")
    return np.where(absent, heading_of_motion(vx, vy, rows), given)


# SinD -------------------------------------------------------------------------------------------


def _of_sind(path: Path) -> Source:
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
    return Source(folder.name, site, SIND, path, partial(_read_sind, path), lanelets, road=road)


def _lights(folder: Path) -> list[str]:
    """Names of the files with the phases of traffic lights."""
    return sorted(file.name for file in folder.glob("*.csv") if "light" in file.name.lower())


def _read_sind(path: Path) -> tuple[Recording, Report]:
    boxes = _SIND_BOX if path.name == _VEHICLES else {}
    main = read_table(path, _SIND_COLUMNS | boxes)
    step = _median_step(main, _SIND_STEP)
    tracks, report = _sind_tracks(main, step)
    beside = path.with_name(_PEDESTRIANS)
    if beside != path and beside.is_file():
        taken = frozenset(track.name for track in tracks)
        more, other = _sind_tracks(read_table(beside, _SIND_COLUMNS), step, taken)
        tracks += more
        report.add(other)
    report.remarks += map(_unread, _lights(path.parent))
    return Recording(tracks, step, None), report


def _sind_tracks(
    table: Table, step: float, taken: frozenset[str] = frozenset()
) -> tuple[list[Track], Report]:
    counts = np.rint(1000.0 * table["timestamp_ms"]).astype(np.int64)
    return _tracks_of(table, Clock("timestamp_ms", counts, _MICROSECONDS, step), taken)
