"""Smooth what was read: places, headings, speeds and accelerations that belong to one possible motion."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from recognition.datasets.participants import Participant
from recognition.datasets.smoothing import pedestrians, vehicles
from recognition.datasets.smoothing.edges import Edge, edges, without
from recognition.datasets.smoothing.jumps import JUMP, Breaks, breaks
from recognition.datasets.smoothing.limits import Bounds
from recognition.datasets.smoothing.noise import deviation
from recognition.datasets.smoothing.observations import Noise, Seen
from recognition.datasets.source import Cut, Exclusion, Report
from recognition.datasets.tables.rows import Parted, Rows, parted
from recognition.datasets.tables.tracks import Columns
from schemas.errors import InvalidFile
from xodr.array_types import BoolArray, FloatArray, IntArray

RAW = ("x", "y", "h", "speed", "acceleration")
"""Columns that are smoothed; as they were recorded they stay as raw_x, raw_y and so on."""
_ROWS = 1000
"""Rows that are smoothed at a time, or one track: more are slower, as they leave the processor's cache."""
_HARD = 0.98
"""Share of the limits of acceleration and braking from which on a vehicle is named"""
_LEAST = 0.5
"""Shortest part (s) of a track that was cut that is kept."""


class Smoothed(NamedTuple):
    """Rows, participants and columns after smoothing."""

    rows: Rows
    who: list[Participant]
    columns: Columns


def smoothed(rows: Rows, who: Sequence[Participant], columns: Columns, report: Report, noise: Noise | None = None) -> Smoothed:
    """Cut tracks where they jump, and smooth them.

    Args:
        who: the participant of each track.
        columns: those of a recording; x, y of the reference points.
        report: is told what was cut.
        noise: of the recording.

    Raises:
        InvalidFile: nothing is left of any track.
    """
    broken = breaks(rows, *centres(rows, who, columns))
    rest = parted(rows, broken.heads, _LEAST)
    if not len(rest.rows):
        short = f"all parts between jumps and gaps are shorter than {_LEAST:g} s"
        raise InvalidFile(f"no track is left, {short}: times and places may be in other units")
    names = _names(who, rest.origin)
    _tell(report, rows, who, broken, rest, names)
    who = [who[index]._replace(name=name) for index, name in zip(rest.origin.tolist(), names, strict=True)]
    columns = {name: values[rest.kept] for name, values in columns.items()}
    columns |= {f"raw_{name}": columns[name] for name in RAW}
    seen = observed(rest.rows, who, columns, broken.astray[rest.kept], noise or Noise())
    columns |= states(rest.rows, who, seen, columns)
    wrong = edges(rest.rows, who, columns["speed"], columns["acceleration"])
    _tell_edges(report, who, wrong)
    kept = without(rest.rows, wrong)
    rows, columns = rest.rows.among(kept), {name: values[kept] for name, values in columns.items()}
    _tell_hard(report, rows, who, columns["acceleration"], Bounds(*(each[kept] for each in seen.bounds)))
    return Smoothed(rows, who, columns)


def centres(rows: Rows, who: Sequence[Participant], columns: Columns) -> tuple[FloatArray, FloatArray]:
    """Centres x, y (m) of the boxes of the participants of tracks, from their reference points and headings."""
    behind = rows.each([one.box.x for one in who])
    return columns["x"] + behind * np.cos(columns["h"]), columns["y"] + behind * np.sin(columns["h"])


def observed(rows: Rows, who: Sequence[Participant], columns: Columns, astray: BoolArray, noise: Noise) -> Seen:
    """What smoothers are given of tracks; places of rows that are astray are not trusted (n,)."""
    x, y = centres(rows, who, columns)
    facing, behind = np.full(len(rows), noise.heading), rows.each([one.box.x for one in who])
    trusted, bounds = np.where(astray, 0.0, 1.0), Bounds.of([one.category for one in who], rows.sizes)
    recorded = x, y, columns["h"], columns["speed"], trusted, deviation(rows, x, y), facing, behind
    return Seen(rows.starts, rows.time, *recorded, bounds, noise)


def _names(who: Sequence[Participant], origin: IntArray) -> list[str]:
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


def _tell(report: Report, rows: Rows, who: Sequence[Participant], broken: Breaks, rest: Parted, names: list[str]) -> None:
    """Enter cuts and rows that were left out or not trusted."""
    place = np.cumsum(rest.kept) - 1
    for head, off in zip(broken.heads.tolist(), broken.off.tolist(), strict=True):
        track = who[int(np.searchsorted(rows.starts, head, side="right")) - 1].name
        after = names[int(np.searchsorted(rest.rows.starts, place[head], side="right")) - 1] if rest.kept[head] else None
        report.cuts.append(Cut(track, float(rows.time[head - 1]), float(rows.time[head]), off, after))
    report.rows, report.tracks = len(rest.rows), len(names)
    lost = np.add.reduceat(~rest.kept, rows.starts[:-1], dtype=np.int64)
    astray = np.add.reduceat(broken.astray & rest.kept, rows.starts[:-1], dtype=np.int64)
    for index in np.flatnonzero(lost).tolist():
        report.exclusions.append(Exclusion(who[index].name, int(lost[index]), f"shorter than {_LEAST} s after a cut"))
    for index in np.flatnonzero(astray).tolist():
        report.remarks.append(
            f"{who[index].name}: {astray[index]} rows are away by more than {JUMP} m and come back: interpolated"
        )


def _tell_edges(report: Report, who: Sequence[Participant], wrong: Sequence[Edge]) -> None:
    """Enter rows at the ends of tracks that were left out."""
    for edge in wrong:
        count = edge.rows.stop - edge.rows.start
        turn = f"turns back at {edge.time:.2f} s with {edge.acceleration:.1f} m/s², which nothing does"
        report.exclusions.append(Exclusion(who[edge.track].name, count, f"at the edge of the view it {turn}"))
        report.rows -= count


def _tell_hard(report: Report, rows: Rows, who: Sequence[Participant], acceleration: FloatArray, bounds: Bounds) -> None:
    """Say which vehicles accelerate or brake at the limit, and when first: their tracks may be wrong there."""
    hard = (acceleration > _HARD * bounds.acceleration) | (acceleration < -_HARD * bounds.braking)
    counts = np.add.reduceat(hard, rows.starts[:-1], dtype=np.int64) if len(hard) else np.zeros(0, np.int64)
    for index in np.flatnonzero(counts).tolist():
        if who[index].kind == "vehicle":
            first = rows.starts[index] + int(hard[rows.starts[index] :].argmax())
            moment = f"{acceleration[first]:.1f} m/s² at {rows.time[first]:.2f} s"
            report.remarks.append(
                f"{who[index].name}: {moment}, in {counts[index]} rows at the limit of its kind: its track may be wrong there"
            )


def states(rows: Rows, who: Sequence[Participant], seen: Seen, columns: Columns) -> Columns:
    """The smoothed columns; what is neither vehicle nor pedestrian stays as it is."""
    found = np.stack([columns[name] for name in RAW], axis=1)
    for kind, first, last in _batches(who, rows.sizes):
        part, among = seen.part(first, last), rows.part(first, last)
        own = slice(int(rows.starts[first]), int(rows.starts[last]))
        if kind == "vehicle":
            found[own] = vehicles.smooth(among, part)
        elif kind == "pedestrian":
            found[own] = pedestrians.smooth(among, part)
    x, y, h, speed, acceleration = found.T
    return {"x": x, "y": y, "h": np.arctan2(np.sin(h), np.cos(h)), "speed": speed, "acceleration": acceleration}


def _batches(who: Sequence[Participant], sizes: IntArray) -> Iterator[tuple[str, int, int]]:
    """Tracks of one kind that follow each other, from first to before last, with about `_ROWS` rows together."""
    first, count = 0, 0
    for index, (one, size) in enumerate(zip(who, sizes.tolist(), strict=True)):
        if index > first and (one.kind != who[first].kind or count + size > _ROWS):
            yield who[first].kind, first, index
            first, count = index, 0
        count += size
    if who:
        yield who[first].kind, first, len(who)
