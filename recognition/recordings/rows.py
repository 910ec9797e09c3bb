"""Rows of recorded tracks: order, gaps, rates of change, and the tracks made of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from recognition.recordings.intake import Exclusion, Gap, Report
from recognition.recordings.source import TrackParticipant
from recognition.recordings.table import Kind, Table, column_names, read_table
from runner.recording import Track
from schemas.common.array_types import BoolArray, FloatArray, IntArray
from schemas.common.errors import InvalidFile

_LEAST_STEP = 1e-4
"""Times (s) from frame to frame below this are no recording's"""
_LATE = 1.5
"""Steps after which a row comes late: frames are missing before it."""


class Clock(NamedTuple):
    """Times at which the rows of a table were recorded.

    column: what the file calls it. counts: its value in each row. per_second: how much it counts in
    a second. step: time from frame to frame, s. zero: its count at time 0.
    """

    column: str
    counts: IntArray
    per_second: float
    step: float
    zero: int = 0


@dataclass(frozen=True)
class Rows:
    """Rows sorted by track, then time.

    Attributes:
        order: index of each row in the file.
        keys: key of each track, ascending.
        starts: first row of each track, and the number of rows.
        time: s.
        step: time from frame to frame, s.
        first, last: the first and last row of the piece without missing frames that each row is in.
        repeated: how many rows of each track were left out, because there is one of that time
            already.
    """

    order: IntArray
    keys: NDArray[Any]
    starts: IntArray
    time: FloatArray
    step: float
    first: IntArray
    last: IntArray
    repeated: IntArray

    def __len__(self) -> int:
        return len(self.order)

    @property
    def sizes(self) -> IntArray:
        """Number of rows of each track."""
        return np.diff(self.starts)

    @property
    def heads(self) -> list[int]:
        """Index in the file of the first row of each track."""
        return self.order[self.starts[:-1]].tolist()

    def part(self, first: int, last: int) -> Rows:
        """Subset of the tracks, from `first` to before `last`."""
        a, b = int(self.starts[first]), int(self.starts[last])
        own, tracks = slice(a, b), slice(first, last)
        starts, keys, repeated = (
            self.starts[first : last + 1] - a,
            self.keys[tracks],
            self.repeated[tracks],
        )
        return Rows(
            self.order[own],
            keys,
            starts,
            self.time[own],
            self.step,
            self.first[own] - a,
            self.last[own] - a,
            repeated,
        )

    def among(self, kept: NDArray[np.bool_]) -> Rows:
        """Subset of the rows, at least one of each track."""
        starts, time = (
            np.append(0, np.cumsum(np.add.reduceat(kept, self.starts[:-1], dtype=np.int64))),
            self.time[kept],
        )
        # Rows that were taken out leave gaps, so pieces are found anew.
        limits = pieces(time, starts, self.step)
        return Rows(self.order[kept], self.keys, starts, time, self.step, *limits, self.repeated)

    def each(self, values: Any) -> NDArray[Any]:
        """A value for each track, repeated for its rows."""
        return np.repeat(values, self.sizes)

    def totals(self, values: FloatArray) -> FloatArray:
        """Sum over the rows of each track."""
        return np.add.reduceat(values, self.starts[:-1])

    def report(self, names: list[str]) -> Report:
        """Counts, a gap for each stretch of missing frames, an exclusion for each track with
        repeated rows."""
        late = np.flatnonzero(self.first[1:] > self.first[:-1]) + 1
        # The beginning of a track is no gap.
        late = late[~np.isin(late, self.starts)]
        track = np.searchsorted(self.starts, late, side="right") - 1
        before, after = self.time[late - 1], self.time[late]
        missing = np.round((after - before) / self.step).astype(int) - 1
        found = zip(track.tolist(), before.tolist(), after.tolist(), missing.tolist(), strict=True)
        gaps = [Gap(names[index], *rest) for index, *rest in found]
        reason = "several rows of the same time, of which the first counts"
        exclusions = [
            Exclusion(names[i], int(self.repeated[i]), reason)
            for i in np.flatnonzero(self.repeated)
        ]
        return Report(len(self), len(self.keys), gaps, exclusions=exclusions)


def in_order(
    table: Table,
    track: NDArray[Any],
    clock: Clock,
    *,
    names: Sequence[str] | None = None,
    sort: bool = False,
    repeats: bool = False,
) -> Rows:
    """Put the rows of a table in the order of tracks and time.

    Args:
        track: key of the track of each row.
        names: of the tracks, by their keys, where these are numbers from 0.
        sort: take rows in any order. Without it, a clock that goes back within a track is a defect.
        repeats: of rows of a track at the same time take the first. Without it they are a defect.

    Raises:
        InvalidFile: there is such a defect, or frames follow each other as they do in no recording.
    """
    if not clock.step >= _LEAST_STEP:
        raise InvalidFile(
            f"{clock.column}: frames are {clock.step:g} s apart, at least "
            f"{_LEAST_STEP:g} s is expected"
        )
    # Stable: without `sort` the file's own order within a track has to be that of time.
    order = np.lexsort((clock.counts, track)) if sort else np.argsort(track, kind="stable")
    keys, starts = np.unique(track[order], return_index=True)
    starts = np.append(starts, len(order))
    passed = np.ones(len(order), np.int64)
    passed[1:] = np.diff(clock.counts[order])
    # The step from one track to the next is none.
    passed[starts[:-1]] = 1
    wrong = np.flatnonzero(passed < 0 if repeats else passed <= 0)
    if len(wrong):
        # The first in the file, so that the message names the line that a reader meets first.
        place = wrong[np.argmin(order[wrong])]
        row = int(order[place])
        name = track[row] if names is None else names[track[row]]
        raise _disordered(table, name, clock, row, int(order[place - 1]))
    repeated = np.add.reduceat(passed == 0, starts[:-1], dtype=np.int64)
    # Rows left out in the tracks before move each start forwards.
    starts = starts - np.concatenate([[0], np.cumsum(repeated)])
    order = order[passed > 0]
    time = (clock.counts[order] - clock.zero) / clock.per_second
    return Rows(order, keys, starts, time, clock.step, *pieces(time, starts, clock.step), repeated)


class Parted(NamedTuple):
    """Rows of tracks that were cut. kept: which of the rows before are among them. origin: the
    track before of each track."""

    rows: Rows
    kept: NDArray[np.bool_]
    origin: IntArray


def parted(rows: Rows, heads: IntArray, least: float) -> Parted:
    """Rows with more tracks: at each of `heads` a new one begins.

    Parts of tracks that were cut are left out where they are shorter than `least` (s).
    """
    begins = np.union1d(rows.starts[:-1], heads)
    ends = np.append(begins[1:], len(rows))
    origin = np.searchsorted(rows.starts, begins, side="right") - 1
    # A short track that was recorded so is data; a short part of a cut one is a leftover.
    whole = np.bincount(origin, minlength=len(rows.keys))[origin] == 1
    keep = whole | (rows.time[ends - 1] - rows.time[begins] >= least)
    sizes, origin = (ends - begins)[keep], origin[keep]
    kept = np.repeat(keep, ends - begins)
    starts, time = np.append(0, np.cumsum(sizes)), rows.time[kept]
    limits = pieces(time, starts, rows.step)
    return Parted(
        Rows(
            rows.order[kept],
            rows.keys[origin],
            starts,
            time,
            rows.step,
            *limits,
            rows.repeated[origin],
        ),
        kept,
        origin,
    )


def _disordered(table: Table, name: Any, clock: Clock, row: int, before: int) -> Exception:
    now, then = clock.counts[row], clock.counts[before]
    fault = "is there twice" if now == then else f"comes after {then}"
    return table.fault(row, clock.column, f"{now} of track {name} {fault}")


def pieces(time: FloatArray, starts: IntArray, step: float) -> tuple[IntArray, IntArray]:
    """First and last row of the piece without missing frames that each row is in."""
    begins = np.zeros(len(time), bool)
    begins[1:] = np.diff(time) > _LATE * step
    begins[starts[:-1]] = True
    ends = np.append(np.flatnonzero(begins), len(time))
    first, last = (np.repeat(limits, np.diff(ends)) for limits in (ends[:-1], ends[1:] - 1))
    return first, last


Columns = dict[str, NDArray[Any]]


def columns_of(
    rows: Rows,
    who: Sequence[TrackParticipant],
    x: FloatArray,
    y: FloatArray,
    h: FloatArray,
    speed: FloatArray,
    acceleration: FloatArray,
) -> Columns:
    """Columns of a `Recording` from those of box centres; the places on the road are left open.

    Args:
        who: participant of each track.
        x, y: centres of the boxes, m. h: headings, rad, of any turn.
        speed, acceleration: along the heading, m/s and m/s².
    """
    # From the centre of the box to the reference point, which lies `box.x` behind it.
    behind = rows.each([one.box.x for one in who])
    zero, count = np.zeros(len(rows)), len(rows)
    return {
        "time": rows.time,
        "x": x - behind * np.cos(h),
        "y": y - behind * np.sin(h),
        "z": zero,
        # Between -π and π, whatever turns the file counts.
        "h": np.arctan2(np.sin(h), np.cos(h)),
        "pitch": zero,
        "roll": zero,
        "speed": speed,
        "acceleration": acceleration,
        "road_id": np.full(count, None, dtype=object),
        "lane_id": np.zeros(count, dtype=np.int64),
        "s": zero,
        "t": zero,
        "lane_offset": zero,
    }


def cut(rows: Rows, who: Sequence[TrackParticipant], columns: Columns) -> list[Track]:
    """The tracks of a recording, each with its part of the columns."""
    ends = rows.starts.tolist()
    return [
        Track(one.name, one.kind, one.category, one.box, partial(_part, columns, start, end))
        for one, (start, end) in zip(who, pairwise(ends), strict=True)
    ]


def _part(columns: Columns, start: int, end: int) -> Columns:
    """A track's own part; copied, because looking up places writes into it."""
    return {name: values[start:end].copy() for name, values in columns.items()}


REACH = 0.5
"""Rates are differences over this time to either side, s: positions that are 0.1 m off then spoil a
speed by 0.1 m/s."""
STANDING = 0.5
"""Below this speed (m/s) the direction of motion is noise: the heading stays."""
_CREDIBLE = (0.8, 1.25)
"""Given velocities over those of the positions, as a whole: outside of this the given ones have
another unit or sign."""
_FACING = 0.9
"""Share of the way that vehicles go forwards at least: none goes backwards for long, and none
sidewards."""


def rate(values: FloatArray, rows: Rows) -> FloatArray:
    """Rate of change, per s: a central difference, shorter at the ends of a piece; 0 where there is
    nothing to compare."""
    # Not across a piece's ends: a difference over missing frames is a mean, not a rate.
    reach = max(1, round(REACH / rows.step))
    here = np.arange(len(rows))
    before, after = np.maximum(here - reach, rows.first), np.minimum(here + reach, rows.last)
    apart = rows.time[after] - rows.time[before]
    return np.divide(
        values[after] - values[before], apart, out=np.zeros(len(rows)), where=apart > 0.0
    )


def heading_of_motion(vx: FloatArray, vy: FloatArray, rows: Rows) -> FloatArray:
    """Direction of the velocity, rad. While standing that of the last motion, before the first
    motion that of the first.

    Tracks that never move have the heading 0.
    """
    moving = np.hypot(vx, vy) >= STANDING
    here = np.arange(len(rows))
    # The last moving row at or before each row, and the next one after it, by running extremes.
    latest = np.maximum.accumulate(np.where(moving, here, -1))
    following = np.minimum.accumulate(np.where(moving, here, len(rows))[::-1])[::-1]
    start, end = rows.each(rows.starts[:-1]), rows.each(rows.starts[1:])
    known = np.where(latest >= start, latest, np.where(following < end, following, -1))
    return np.where(known >= 0, np.arctan2(vy, vx)[known], 0.0)


def believable(x: FloatArray, y: FloatArray, vx: FloatArray, vy: FloatArray, rows: Rows) -> bool:
    """Whether given velocities agree with how the positions change, in sum over all rows that move.

    Real recordings have failed here: with all velocities backwards, or at half the speed of the
    positions.
    """
    dx, dy = rate(x, rows), rate(y, rows)
    travelled = float((dx * dx + dy * dy).sum())
    least, greatest = _CREDIBLE
    if travelled < STANDING**2 * len(rows) / 10:
        return True  # too little motion to compare
    # Projection of given on derived velocities, weighted by way: near 1 if unit and sign are right.
    return least <= float((vx * dx + vy * dy).sum()) / travelled <= greatest


def facing(heading: FloatArray, vx: FloatArray, vy: FloatArray) -> bool:
    """Whether nearly all of the way is gone in the direction of the headings.

    A real recording has failed here: its headings are arctan(vy/vx), so that all lie in one half of
    the circle.
    """
    speed = np.hypot(vx, vy)
    return bool((np.cos(heading) * vx + np.sin(heading) * vy).sum() >= _FACING * speed.sum())


# values of a whole track, and companion tables of highD and inD ---------------------------------


CENTRE = "xCenter"
"""Column of the tracks of later data sets, which highD's do not have"""
_ENDING = "_tracks.csv"
_SLOWEST = 1.0
"""Least frames a second"""
_ROUNDED = 0.011
"""Sizes of one participant in two files differ by no more, m, where both are rounded to
centimetres."""


def number(path: Path) -> str:
    """Return the common start of the names of a recording's files."""
    return path.name.removesuffix(_ENDING)


def beside(path: Path, kind: str) -> Path:
    """The file of a kind (tracksMeta, recordingMeta) beside a file of tracks."""
    return path.with_name(f"{number(path)}_{kind}.csv")


def is_tracks(path: Path, *, centred: bool) -> bool:
    """Whether a file has tracks by their centres, or else by corners; without its recordingMeta it
    is one if it is numbered."""
    named = path.name.endswith(_ENDING) and (
        number(path).isdecimal() or beside(path, "recordingMeta").is_file()
    )
    return named and (CENTRE in column_names(path)) == centred


def recording_of(path: Path, kinds: Mapping[str, Kind]) -> Table:
    """The only row of the recordingMeta beside a file of tracks, with a `frameRate` (Hz).

    Raises:
        InvalidFile: a file is not there, another recording is described too, or the frame rate is
            none.
    """
    for kind in ("recordingMeta", "tracksMeta"):
        if not (meta := beside(path, kind)).is_file():
            raise InvalidFile(
                f"there is no {meta.name} beside it: a recording has three files", path=path
            )
    recording = read_table(beside(path, "recordingMeta"), {"frameRate": "number", **kinds})
    if len(recording) > 1:
        raise recording.fault(
            1, "frameRate", "a second recording is described here, one is expected"
        )
    rate = float(recording["frameRate"][0])
    if rate < _SLOWEST:
        raise recording.fault(0, "frameRate", f"{rate:g} frames a second are too few")
    return recording


def matched(table: Table, rows: Rows, meta: Table, key: str) -> IntArray:
    """Row of tracksMeta for each track; `key` is the column with the tracks' ids in both.

    Raises:
        InvalidFile: the tracks, or their first and last frames, differ between the two files: one
            of them is incomplete.
    """
    order = np.argsort(meta[key], kind="stable")
    ids = meta[key][order]
    twice = np.flatnonzero(np.diff(ids) == 0)
    if len(twice):
        raise meta.fault(int(order[twice[0] + 1]), key, f"track {ids[twice[0]]} is there twice")
    # Either file may be cut short: both directions are compared.
    unknown = np.flatnonzero(~np.isin(rows.keys, ids))
    if len(unknown):
        row = int(rows.order[rows.starts[unknown[0]]])
        raise table.fault(row, key, f"track {rows.keys[unknown[0]]} is not in {meta.path.name}")
    absent = np.flatnonzero(~np.isin(ids, rows.keys))
    if len(absent):
        raise meta.fault(
            int(order[absent[0]]), key, f"track {ids[absent[0]]} is not in {table.path.name}"
        )
    frames = table["frame"][rows.order]
    for name, ends in (("initialFrame", rows.starts[:-1]), ("finalFrame", rows.starts[1:] - 1)):
        other = np.flatnonzero(frames[ends] != meta[name][order])
        if len(other):
            there = f"{table.path.name} has {frames[ends[other[0]]]}"
            row = int(order[other[0]])
            raise meta.fault(row, name, f"{meta[name][row]} of track {ids[other[0]]}, but {there}")
    return order


def other_sizes(
    table: Table,
    rows: Rows,
    meta: Table,
    index: IntArray,
    sides: Sequence[str],
    *,
    first_counts: bool = False,
) -> list[str]:
    """A remark where first rows of tracks have other sizes than tracksMeta; `index` is its row of
    each track.

    Args:
        first_counts: whether those of the first rows count, not those of tracksMeta.
    """
    differ = np.any(
        [np.abs(table[side][rows.heads] - meta[side][index]) > _ROUNDED for side in sides], axis=0
    )
    if not differ.any():
        return []
    first = rows.keys[int(differ.argmax())]
    counts = "that of the tracks counts" if first_counts else "that one counts"
    return [
        f"{differ.sum()} tracks ({first} first) have another size in {meta.path.name}: {counts}"
    ]


_SHOWN = 5


def categories(table: Table, column: str, known: Mapping[str, str]) -> NDArray[np.str_]:
    """The category of each row (n,), by a column with kinds in any case.

    Raises:
        InvalidFile: a kind is not known; names line and column.
    """
    kinds = table[column].tolist()
    # Each kind once, in the order of the file: tables have millions of rows and a few kinds.
    found = {kind: known.get(str(kind).strip().lower(), "") for kind in dict.fromkeys(kinds)}
    unknown = next((kind for kind, category in found.items() if not category), None)
    if unknown is not None:
        raise table.fault(
            kinds.index(unknown), column, f"{unknown!r} is none of {', '.join(known)}"
        )
    return np.array([found[kind] for kind in kinds])


def check_sizes(table: Table, columns: Sequence[str], blank: BoolArray | None = None) -> None:
    """Refuse rows with a size that is not positive.

    Args:
        blank: rows (n,) that may lack sizes; none by default.

    Raises:
        InvalidFile: there is one; names line and column.
    """
    for name in columns:
        values = table[name]
        wrong = ~(values > 0.0)
        if blank is not None:
            wrong &= ~(blank & np.isnan(values))
        if wrong.any():
            row = int(wrong.argmax())
            raise table.fault(
                row,
                name,
                "a value is missing" if np.isnan(values[row]) else f"{values[row]:g} is no size",
            )


def changes(table: Table, rows: Rows, names: Sequence[str], columns: Sequence[str]) -> list[str]:
    """Remarks on tracks, by their names, with rows that contradict the first one."""
    remarks = []
    for column in columns:
        values = table[column][rows.order]
        first = rows.each(values[rows.starts[:-1]])
        differs = values != first
        if values.dtype.kind == "f":
            # NaN is not equal to itself: missing in both rows is no contradiction.
            differs &= ~(np.isnan(values) & np.isnan(first))
        changing = [names[track] for track in np.flatnonzero(rows.totals(differs)).tolist()]
        if changing:
            more = f" and {len(changing) - _SHOWN} more" if len(changing) > _SHOWN else ""
            remarks.append(
                f"{column} changes within tracks ({', '.join(changing[:_SHOWN])}{more}): that of "
                "the first row counts"
            )
    return remarks
