"""Smoothing of recorded tracks: jumps and wrong ends are cut, states are estimated from positions
and headings."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from recognition.recordings.intake import (
    MOVED,
    Check,
    Cut,
    Exclusion,
    Report,
    check_ratio,
    ratio_of_speeds,
    steps_compared,
)
from recognition.recordings.motion import motion_models
from recognition.recordings.motion.observations import Bounds, Noise, Observations, deviation
from recognition.recordings.rows import Columns, Parted, Rows, parted
from recognition.recordings.source import TrackParticipant
from schemas.common.array_types import BoolArray, FloatArray, IntArray
from schemas.common.errors import InvalidFile

EDGE = 3.0
"""Time (s) from the ends of a track in which it may be at the edge of the view."""
TURN = 2.0
"""Acceleration (m/s²) with which nothing turns from forwards to backwards: twice that of usual
starting."""
_MOVING = ("vehicle", "pedestrian")
_LEAST = 0.5
"""Shortest rest (s) of a track."""


class Edge(NamedTuple):
    """Rows at one end of a track that are wrong.

    track: its index. rows: which. time: when it seems to turn back, s. acceleration: then, m/s².
    """

    track: int
    rows: slice
    time: float
    acceleration: float


def edges(
    rows: Rows, who: Sequence[TrackParticipant], speed: FloatArray, acceleration: FloatArray
) -> list[Edge]:
    """The ends of tracks of vehicles and pedestrians at which they turn back hard.

    Args:
        speed, acceleration: smoothed, of each row (n,).
    """
    turns = np.flatnonzero(speed[1:] * speed[:-1] < 0.0)
    turns = turns[~np.isin(turns + 1, rows.starts)]
    track = np.searchsorted(rows.starts, turns, side="right") - 1
    pieces: list[Edge] = []
    for index in np.unique(track).tolist():
        if who[index].kind in _MOVING:
            own = turns[track == index]
            pieces += _of(rows, index, int(own[0]), int(own[-1]), speed, acceleration)
    return pieces


def _of(
    rows: Rows, index: int, first: int, last: int, speed: FloatArray, acceleration: FloatArray
) -> Iterator[Edge]:
    """The wrong ends of one track, which turns for the first and for the last time after these
    rows."""
    start, end, time = int(rows.starts[index]), int(rows.starts[index + 1]), rows.time
    hard = [
        float(acceleration[row : row + 2][np.abs(acceleration[row : row + 2]).argmax()])
        for row in (first, last)
    ]
    begins = abs(hard[0]) >= TURN and speed[first] < 0.0 and time[first] - time[start] <= EDGE
    ends = abs(hard[1]) >= TURN and speed[last] > 0.0 and time[end - 1] - time[last] <= EDGE
    rest = time[last if ends else end - 1] - time[first + 1 if begins else start]
    # Too little would be left: the track stays as it is.
    if rest < _LEAST:
        return
    if begins:
        yield Edge(index, slice(start, first + 1), float(time[first]), hard[0])
    if ends:
        yield Edge(index, slice(last + 1, end), float(time[last]), hard[1])


def without(rows: Rows, found: Sequence[Edge]) -> BoolArray:
    """Mask of rows that are not at such an end (n,)."""
    kept = np.ones(len(rows), bool)
    for edge in found:
        kept[edge.rows] = False
    return kept


JUMP = 2.0
"""Distance (m) from where a row is expected: half a car's length."""
GAP = 1.0
"""Time without rows (s) after which a track is a new one."""
_SUSPECT = 1.0
"""Change of the way from row to row (m) from which it is looked at: 100 m/s² at 10 Hz."""
_REACH = 1.0
"""Time (s) around a jump that says how the track moves, and within which it may come back."""


class Breaks(NamedTuple):
    """Faults in tracks.

    heads: rows that begin a new track, ascending. off: how far each is from where it was expected,
    m; 0 after a gap. astray: whether a row is not trusted (n,).
    """

    heads: IntArray
    off: FloatArray
    astray: NDArray[np.bool_]


def breaks(rows: Rows, x: FloatArray, y: FloatArray) -> Breaks:
    """Jumps and long gaps in tracks.

    Args:
        x, y: centres of the boxes, m.
    """
    place = np.stack([x, y], axis=1)
    astray = np.zeros(len(rows), bool)
    heads: dict[int, float] = {}
    pending: tuple[int, FloatArray] | None = None
    for row, off in _jumps(rows, place):
        # Two jumps that undo each other are rows astray between them, not two cuts.
        if pending is not None and _comes_back(rows, pending, row, off):
            astray[pending[0] : row] = True
            del heads[pending[0]]
            pending = None
            continue
        heads[row] = float(np.hypot(*off))
        pending = row, off
    late = np.flatnonzero(np.diff(rows.time) > GAP) + 1
    for row in late[~np.isin(late, rows.starts)].tolist():
        heads.setdefault(row, 0.0)
    ordered = sorted(heads)
    return Breaks(np.array(ordered, np.int64), np.array([heads[row] for row in ordered]), astray)


def _comes_back(rows: Rows, before: tuple[int, FloatArray], row: int, off: FloatArray) -> bool:
    """Whether a jump undoes the one before it."""
    there, away = before
    near = rows.time[row] - rows.time[there] <= _REACH and rows.first[row] == rows.first[there]
    return bool(near and np.hypot(*(off + away)) < JUMP)


def _jumps(rows: Rows, place: FloatArray) -> Iterator[tuple[int, FloatArray]]:
    """Rows that are too far from where they were expected, and by which vector (m)."""
    # A cheap test of all rows first, as the loop over suspects is in Python.
    way = np.diff(place, axis=0)
    bend = np.hypot(*np.diff(way, axis=0).T)
    sharp = np.zeros(len(way), bool)
    sharp[1:] = bend > _SUSPECT
    sharp[:-1] |= bend > _SUSPECT
    apart = rows.first[1:] != rows.first[:-1]  # another piece, or another track
    velocity = way / np.maximum(np.diff(rows.time), 1e-9)[:, None]
    reach = max(1, round(_REACH / rows.step))
    for step in np.flatnonzero(sharp & ~apart).tolist():
        first, last = int(rows.first[step]), int(rows.last[step])
        around = np.arange(max(first, step - reach), min(last, step + reach + 1))
        # The step in question must not judge itself.
        usual = (
            np.median(velocity[around[around != step]], axis=0)
            if len(around) > 2
            else velocity[step]
        )
        off = way[step] - usual * (rows.time[step + 1] - rows.time[step])
        if np.hypot(*off) > JUMP:
            yield step + 1, off


RAW = ("x", "y", "h", "speed", "acceleration")
"""Columns that are smoothed; as they were recorded they stay as raw_x, raw_y and so on."""
_ROWS = 1000
"""Rows that are smoothed at a time, or one track: more are slower, as they leave the processor's
cache."""
_HARD = 0.98
"""Share of the limits of acceleration and braking from which on a vehicle is named"""
_LEAST = 0.5
"""Shortest part (s) of a track that was cut that is kept."""


_MODELS = {"vehicle": motion_models.smooth_vehicles, "pedestrian": motion_models.smooth_pedestrians}


class Smoothed(NamedTuple):
    """Rows, participants and columns after smoothing."""

    rows: Rows
    who: list[TrackParticipant]
    columns: Columns


def smoothed(
    rows: Rows,
    who: Sequence[TrackParticipant],
    columns: Columns,
    report: Report,
    noise: Noise | None = None,
) -> Smoothed:
    """Cut tracks where they jump, and smooth them; those whose places move at other speeds than
    stated stay as they are.

    Args:
        who: participant of each track.
        columns: those of a recording; x, y of the reference points.
        report: called with the removed rows.
        noise: of the recording.

    Raises:
        InvalidFile: nothing is left of any track, or their motion can't be computed.
    """
    wrong_step = _check_step(rows, who, columns)
    if wrong_step is not None:  # what moves at two speeds has no smooth motion
        report.checks.append(wrong_step)
        return Smoothed(rows, list(who), columns | {f"raw_{name}": columns[name] for name in RAW})
    broken = breaks(rows, *centres(rows, who, columns))
    rest = parted(rows, broken.heads, _LEAST)
    if not len(rest.rows):
        short = f"all parts between jumps and gaps are shorter than {_LEAST:g} s"
        raise InvalidFile(f"no track is left, {short}: times and places may be in other units")
    names = _names(who, rest.origin)
    _tell(report, rows, who, broken, rest, names)
    who = [
        who[index]._replace(name=name)
        for index, name in zip(rest.origin.tolist(), names, strict=True)
    ]
    columns = {name: values[rest.kept] for name, values in columns.items()}
    columns |= {f"raw_{name}": columns[name] for name in RAW}
    seen = observed(rest.rows, who, columns, broken.astray[rest.kept], noise or Noise())
    columns |= states(rest.rows, who, seen, columns)
    wrong = edges(rest.rows, who, columns["speed"], columns["acceleration"])
    _tell_edges(report, who, wrong)
    kept = without(rest.rows, wrong)
    rows, columns = rest.rows.among(kept), {name: values[kept] for name, values in columns.items()}
    _tell_hard(
        report, rows, who, columns["acceleration"], Bounds(*(bound[kept] for bound in seen.bounds))
    )
    return Smoothed(rows, who, columns)


def _check_step(rows: Rows, who: Sequence[TrackParticipant], columns: Columns) -> Check | None:
    """Compare the stated speeds with those of the centres, independent of headings."""
    x, y = centres(rows, who, columns)
    here = np.arange(len(rows))
    ahead = steps_compared(rows.step, int((rows.last - here).max(initial=0)))
    there = np.minimum(here + ahead, rows.last)
    way = np.hypot(x[there] - x, y[there] - y)
    here = np.flatnonzero((there - here == ahead) & (way >= MOVED))
    there = there[here]
    ratio = ratio_of_speeds(
        np.abs(columns["speed"]), here, there, rows.time[there] - rows.time[here], way[here]
    )
    return check_ratio(ratio, rows.step)


def centres(
    rows: Rows, who: Sequence[TrackParticipant], columns: Columns
) -> tuple[FloatArray, FloatArray]:
    """Centres x, y (m) of the boxes of the participants of tracks, from their reference points and
    headings."""
    behind = rows.each([one.box.x for one in who])
    return columns["x"] + behind * np.cos(columns["h"]), columns["y"] + behind * np.sin(
        columns["h"]
    )


def observed(
    rows: Rows, who: Sequence[TrackParticipant], columns: Columns, astray: BoolArray, noise: Noise
) -> Observations:
    """Return the observations of tracks for the smoother; outlying positions (n,) get no weight."""
    x, y = centres(rows, who, columns)
    facing, behind = np.full(len(rows), noise.heading), rows.each([one.box.x for one in who])
    trusted, bounds = (
        np.where(astray, 0.0, 1.0),
        Bounds.of([one.category for one in who], rows.sizes),
    )
    recorded = x, y, columns["h"], columns["speed"], trusted, deviation(rows, x, y), facing, behind
    return Observations(rows.starts, rows.time, *recorded, bounds, noise)


def _names(who: Sequence[TrackParticipant], origin: IntArray) -> list[str]:
    """Names of tracks: those of the tracks that they come from, the second part of 7 being 7.2."""
    taken = {one.name for one in who}
    names: list[str] = []
    part = 1
    for index, before in zip(origin.tolist(), [-1, *origin.tolist()], strict=False):
        part = part + 1 if index == before else 1
        name = who[index].name if part == 1 else f"{who[index].name}.{part}"
        while part > 1 and name in taken:
            name += "_"
        taken.add(name)
        names.append(name)
    return names


def _tell(
    report: Report,
    rows: Rows,
    who: Sequence[TrackParticipant],
    broken: Breaks,
    rest: Parted,
    names: list[str],
) -> None:
    """Enter cuts and rows that were left out or not trusted."""
    place = np.cumsum(rest.kept) - 1
    for head, off in zip(broken.heads.tolist(), broken.off.tolist(), strict=True):
        track = who[int(np.searchsorted(rows.starts, head, side="right")) - 1].name
        after = (
            names[int(np.searchsorted(rest.rows.starts, place[head], side="right")) - 1]
            if rest.kept[head]
            else None
        )
        report.cuts.append(
            Cut(track, float(rows.time[head - 1]), float(rows.time[head]), off, after)
        )
    report.rows, report.tracks = len(rest.rows), len(names)
    lost = np.add.reduceat(~rest.kept, rows.starts[:-1], dtype=np.int64)
    astray = np.add.reduceat(broken.astray & rest.kept, rows.starts[:-1], dtype=np.int64)
    for index in np.flatnonzero(lost).tolist():
        report.exclusions.append(
            Exclusion(who[index].name, int(lost[index]), f"shorter than {_LEAST} s after a cut")
        )
    for index in np.flatnonzero(astray).tolist():
        report.remarks.append(
            f"{who[index].name}: {astray[index]} rows are away by more than {JUMP} m and come "
            "back: interpolated"
        )


def _tell_edges(report: Report, who: Sequence[TrackParticipant], wrong: Sequence[Edge]) -> None:
    """Enter rows at the ends of tracks that were left out."""
    for edge in wrong:
        count = edge.rows.stop - edge.rows.start
        turn = (
            f"turns back at {edge.time:.2f} s with {edge.acceleration:.1f} m/s², which nothing does"
        )
        report.exclusions.append(
            Exclusion(who[edge.track].name, count, f"at the edge of the view it {turn}")
        )
        report.rows -= count


def _tell_hard(
    report: Report,
    rows: Rows,
    who: Sequence[TrackParticipant],
    acceleration: FloatArray,
    bounds: Bounds,
) -> None:
    """Report vehicles that accelerate or brake at the limit, with the first time: their tracks may
    be wrong there."""
    hard = (acceleration > _HARD * bounds.acceleration) | (acceleration < -_HARD * bounds.braking)
    # `reduceat` fails on no rows.
    counts = (
        np.add.reduceat(hard, rows.starts[:-1], dtype=np.int64)
        if len(hard)
        else np.zeros(0, np.int64)
    )
    for index in np.flatnonzero(counts).tolist():
        if who[index].kind == "vehicle":
            first = rows.starts[index] + int(hard[rows.starts[index] :].argmax())
            moment = f"{acceleration[first]:.1f} m/s² at {rows.time[first]:.2f} s"
            report.remarks.append(
                f"{who[index].name}: {moment}, in {counts[index]} rows at the limit of its kind: "
                "its track may be wrong there"
            )


def states(
    rows: Rows, who: Sequence[TrackParticipant], seen: Observations, columns: Columns
) -> Columns:
    """Smoothed columns; those of objects that are neither vehicle nor pedestrian are not changed.

    Raises:
        InvalidFile: the motion can't be computed.
    """
    found = np.stack([columns[name] for name in RAW], axis=1)
    for kind, first, last in _batches(who, rows.sizes):
        part, among = seen.part(first, last), rows.part(first, last)
        own = slice(int(rows.starts[first]), int(rows.starts[last]))
        if kind in _MODELS:
            try:
                found[own] = _MODELS[kind](among, part)
            except np.linalg.LinAlgError:
                some = f"{who[first].name} to {who[last - 1].name}"
                told = f"a step is {rows.step:g} s, times, places or sizes may be in other units"
                raise InvalidFile(f"the tracks {some} have no smooth motion: {told}") from None
    x, y, h, speed, acceleration = found.T
    return {
        "x": x,
        "y": y,
        "h": np.arctan2(np.sin(h), np.cos(h)),
        "speed": speed,
        "acceleration": acceleration,
    }


def _batches(who: Sequence[TrackParticipant], sizes: IntArray) -> Iterator[tuple[str, int, int]]:
    """Tracks of one kind that follow each other, from first to before last, with about `_ROWS` rows
    together."""
    first, count = 0, 0
    for index, (one, size) in enumerate(zip(who, sizes.tolist(), strict=True)):
        if index > first and (one.kind != who[first].kind or count + size > _ROWS):
            yield who[first].kind, first, index
            first, count = index, 0
        count += size
    if who:
        yield who[first].kind, first, len(who)
