"""Labels all recordings of a data set and keeps, of each vehicle, what can be held against its
labels."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np

from recognition.labels import RULES, Label, LabelledEvent, Rules
from recognition.labels.scene import Scene, events, prepare
from recognition.recordings import Source
from recognition.recordings import open as open_data
from recognition.recordings.formats import commonroad, highd
from recognition.scenes import LaneRole, Site, site_of
from schemas.common.array_types import BoolArray, FloatArray
from schemas.common.errors import ToolchainError
from studies.recognition.agreement.geometry import net_turn, own_lane_changes
from studies.recognition.agreement.reasons import reasons

_PIECE = 10
"""Rows of one speed sequence by which a vehicle is recognised in another recording."""


@dataclass(frozen=True, eq=False)
class Vehicle:
    """One track that events may be about, and its labels.

    Attributes:
        steps: lanes crossed to the left and to the right, however short the stay. changes: left and
            right changes that are held.
        ramps: whether it comes from a ramp onto a main lane, and from one onto a ramp, however
            short its way there.
        turn: change of direction between the ends of its way, rad; None for who hardly moves.
        unlabelled: what keeps it from a label at a junction.
        own_changes: changes of the lane that the data set itself names, None where it names none.
    """

    recording: str
    name: str
    size: tuple[float, float]
    speed: FloatArray
    steps: tuple[int, int]
    changes: tuple[int, int]
    ramps: tuple[bool, bool]
    turn: float | None
    unlabelled: str
    own_changes: int | None
    labels: tuple[Label, ...]


@dataclass(eq=False)
class Place:
    """All recordings of one place.

    Attributes:
        name: of the place: sites of one CommonRoad map count as one.
        failures: recordings that can't be labelled, and why.
        lines: by label, x and y of the ways during the windows of its events, of the first
            recording of each map.
        ways: x and y of all vehicles in that recording.
        sides: by label, for changes of lane and ramps, time from t* and lateral position.
        gaps: for cuts, label, time from t* and gap to the lead, NaN without one.
    """

    name: str
    recordings: int = 0
    rows: int = 0
    vehicles: list[Vehicle] = field(default_factory=list)
    events: list[LabelledEvent] = field(default_factory=list)
    failures: dict[str, str] = field(default_factory=dict)
    site: Site | None = None
    ways: list[tuple[FloatArray, FloatArray]] = field(default_factory=list)
    lines: dict[Label, list[tuple[FloatArray, FloatArray]]] = field(default_factory=dict)
    sides: dict[Label, list[tuple[FloatArray, FloatArray]]] = field(default_factory=dict)
    gaps: list[tuple[Label, FloatArray, FloatArray]] = field(default_factory=list)


def survey(data: Path, roads: Path, rules: Rules) -> list[Place]:
    """All places of a data set, in the order of their first recordings."""
    places: dict[str, Place] = {}
    for source in open_data(data, roads).sources:
        place = places.setdefault(_place(source), Place(_place(source)))
        try:
            _add(place, source, roads, rules)
        except ToolchainError as error:
            place.failures[source.name] = str(error)
    return list(places.values())


def _place(source: Source) -> str:
    """Return the report's name of a place; CommonRoad's scenarios of one city and highD's
    recordings of one folder are one place."""
    if source.format == commonroad.FORMAT:
        return source.site.split("-")[0]
    return source.path.parent.name if source.format == highd.FORMAT else source.site


def _add(place: Place, source: Source, roads: Path, rules: Rules) -> None:
    recording = source.load()
    site = site_of(source, recording, roads)
    scene = prepare(recording, site, rules)
    found = events(scene, source.name, [rule(scene) for rule in RULES]) if scene.names else []
    place.recordings += 1
    place.rows += len(scene.track)
    place.events += found
    place.vehicles += _vehicles(scene, source.name, found)
    place.site = place.site or site
    for event in found:
        _draw(place, scene, event, place.site is site)
    if place.site is site:
        place.ways += [(scene.x[rows], scene.y[rows]) for rows in _rows_of_tracks(scene)]


def _rows_of_tracks(scene: Scene) -> Iterator[slice]:
    ends = np.searchsorted(scene.track, np.arange(len(scene.names) + 1)).tolist()
    for start, end in pairwise(ends):
        yield slice(start, end)


def _vehicles(scene: Scene, name: str, found: list[LabelledEvent]) -> Iterator[Vehicle]:
    labels: dict[str, list[Label]] = {}
    for event in found:
        labels.setdefault(event.ego, []).append(event.label)
    why, changes, main = reasons(scene), scene.changes, scene.has_role(LaneRole.MAIN)
    onto = _passes(scene, scene.has_role(LaneRole.ON_RAMP, LaneRole.WEAVING), main)
    off = _passes(scene, main, scene.has_role(LaneRole.OFF_RAMP, LaneRole.WEAVING))
    for track, rows in enumerate(_rows_of_tracks(scene)):
        if not scene.egos[track]:
            continue
        ego, step = scene.names[track], changes.step[rows]
        box, own = (
            scene.recording.tracks[ego].box,
            scene.recording.tracks[ego].columns.get("source_lane"),
        )
        mine = changes.left[(changes.row >= rows.start) & (changes.row < rows.stop)]
        yield Vehicle(
            recording=name,
            name=ego,
            size=(round(box.length, 2), round(box.width, 2)),
            speed=scene.speed[rows],
            steps=(int(step[step > 0].sum()), int(-step[step < 0].sum())),
            changes=(int(mine.sum()), int((~mine).sum())),
            ramps=(bool(onto[rows].any()), bool(off[rows].any())),
            turn=net_turn(scene.x[rows], scene.y[rows]),
            unlabelled=why[track],
            own_changes=own_lane_changes(own) if own is not None else None,
            labels=tuple(labels.get(ego, ())),
        )


def _passes(scene: Scene, before: BoolArray, after: BoolArray) -> BoolArray:
    """Rows with which a way goes from one kind of lane to another."""
    course = scene.changes.course
    found = np.zeros(len(course), bool)
    found[1:] = before[:-1] & after[1:] & (course[1:] == course[:-1])
    return found


def _draw(place: Place, scene: Scene, event: LabelledEvent, here: bool) -> None:
    """Keep what the plots show of an event."""
    start, end = np.searchsorted(scene.track, scene.names.index(event.ego) + np.arange(2)).tolist()
    row = start + int(np.abs(scene.time[start:end] - event.time).argmin())
    half = scene.rows(0.5 * scene.rules.window)
    window = slice(max(row - half, scene.first[row]), min(row + half, scene.last[row]) + 1)
    if here:
        place.lines.setdefault(event.label, []).append((scene.x[window], scene.y[window]))
    about = slice(max(row - 4 * half, scene.first[row]), min(row + 4 * half, scene.last[row]) + 1)
    time = scene.time[about] - scene.time[row]
    if event.label in (
        Label.LANE_CHANGE_LEFT,
        Label.LANE_CHANGE_RIGHT,
        Label.RAMP_ENTERING,
        Label.RAMP_EXITING,
    ):
        side = scene.changes.side[about] - scene.changes.side[row]
        place.sides.setdefault(event.label, []).append((time, side))
    if event.label in (Label.CUT_IN, Label.URBAN_CUT_IN, Label.CUT_OUT, Label.URBAN_CUT_OUT):
        place.gaps.append(
            (
                event.label,
                time,
                np.where(scene.leads.row[about] >= 0, scene.leads.gap[about], np.nan),
            )
        )


def unique(vehicles: list[Vehicle]) -> list[list[Vehicle]]:
    """Vehicles of overlapping recordings: tracks with the same name, size, and a second of the same
    changing speeds are one."""
    named: dict[tuple[str, tuple[float, float]], list[tuple[set[object], list[Vehicle]]]] = {}
    for vehicle in vehicles:
        groups = named.setdefault((vehicle.name, vehicle.size), [])
        pieces = _pieces(vehicle)
        same = [group for group in groups if group[0] & pieces]
        merged = (
            pieces.union(*(group[0] for group in same)),
            [one for group in same for one in group[1]] + [vehicle],
        )
        groups[:] = [group for group in groups if group not in same] + [merged]
    return [group[1] for groups in named.values() for group in groups]


def _pieces(vehicle: Vehicle) -> set[object]:
    speed = np.round(vehicle.speed, 2)
    pieces = [speed[start : start + _PIECE] for start in range(len(speed) - _PIECE + 1)]
    return {piece.tobytes() for piece in pieces if np.ptp(piece) > 0.05} or {
        (vehicle.recording, vehicle.name)
    }
