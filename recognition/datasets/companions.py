"""Companion tables of highD and inD, and values that are constant along a track."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from recognition.datasets.rows import Rows
from recognition.datasets.table import Kind, Table, column_names, read_table
from schemas.common.array_types import BoolArray, IntArray
from schemas.common.errors import InvalidFile

CENTRE = "xCenter"
"""Column of the tracks of later data sets, which highD's do not have"""
_ENDING = "_tracks.csv"
_SLOWEST = 1.0
"""Least frames a second"""
_ROUNDED = 0.011
"""Sizes of one participant in two files differ by no more, m, where both are rounded to centimetres."""


def number(path: Path) -> str:
    """Return the common start of the names of a recording's files."""
    return path.name.removesuffix(_ENDING)


def beside(path: Path, kind: str) -> Path:
    """The file of a kind (tracksMeta, recordingMeta) beside a file of tracks."""
    return path.with_name(f"{number(path)}_{kind}.csv")


def is_tracks(path: Path, *, centred: bool) -> bool:
    """Whether a file has tracks by their centres, or else by corners; without its recordingMeta it is one if it is numbered."""
    named = path.name.endswith(_ENDING) and (number(path).isdecimal() or beside(path, "recordingMeta").is_file())
    return named and (CENTRE in column_names(path)) == centred


def recording_of(path: Path, kinds: Mapping[str, Kind]) -> Table:
    """The only row of the recordingMeta beside a file of tracks, with a `frameRate` (Hz).

    Raises:
        InvalidFile: a file is not there, another recording is described too, or the frame rate is none.
    """
    for kind in ("recordingMeta", "tracksMeta"):
        if not (meta := beside(path, kind)).is_file():
            raise InvalidFile(f"there is no {meta.name} beside it: a recording has three files", path=path)
    recording = read_table(beside(path, "recordingMeta"), {"frameRate": "number", **kinds})
    if len(recording) > 1:
        raise recording.fault(1, "frameRate", "a second recording is described here, one is expected")
    rate = float(recording["frameRate"][0])
    if rate < _SLOWEST:
        raise recording.fault(0, "frameRate", f"{rate:g} frames a second are too few")
    return recording


def matched(table: Table, rows: Rows, meta: Table, key: str) -> IntArray:
    """Row of tracksMeta for each track; `key` is the column with the tracks' ids in both.

    Raises:
        InvalidFile: the two files do not tell of the same tracks, first and last frames, so one of them is incomplete.
    """
    order = np.argsort(meta[key], kind="stable")
    ids = meta[key][order]
    twice = np.flatnonzero(np.diff(ids) == 0)
    if len(twice):
        raise meta.fault(int(order[twice[0] + 1]), key, f"track {ids[twice[0]]} is there twice")
    unknown = np.flatnonzero(~np.isin(rows.keys, ids))
    if len(unknown):
        row = int(rows.order[rows.starts[unknown[0]]])
        raise table.fault(row, key, f"track {rows.keys[unknown[0]]} is not in {meta.path.name}")
    absent = np.flatnonzero(~np.isin(ids, rows.keys))
    if len(absent):
        raise meta.fault(int(order[absent[0]]), key, f"track {ids[absent[0]]} is not in {table.path.name}")
    frames = table["frame"][rows.order]
    for name, ends in (("initialFrame", rows.starts[:-1]), ("finalFrame", rows.starts[1:] - 1)):
        other = np.flatnonzero(frames[ends] != meta[name][order])
        if len(other):
            there = f"{table.path.name} has {frames[ends[other[0]]]}"
            row = int(order[other[0]])
            raise meta.fault(row, name, f"{meta[name][row]} of track {ids[other[0]]}, but {there}")
    return order


def other_sizes(table: Table, rows: Rows, meta: Table, index: IntArray, sides: Sequence[str]) -> list[str]:
    """A remark where first rows of tracks have other sizes than tracksMeta, which count; `index` is its row of each track."""
    differ = np.any([np.abs(table[side][rows.heads] - meta[side][index]) > _ROUNDED for side in sides], axis=0)
    if not differ.any():
        return []
    first = rows.keys[int(differ.argmax())]
    return [f"{differ.sum()} tracks ({first} first) have another size in {meta.path.name}: that one counts"]


_SHOWN = 5


def categories(table: Table, column: str, known: Mapping[str, str]) -> NDArray[np.str_]:
    """The category of each row (n,), by a column with kinds in any case.

    Raises:
        InvalidFile: a kind is not known; names line and column.
    """
    kinds = table[column].tolist()
    found = {kind: known.get(str(kind).strip().lower(), "") for kind in dict.fromkeys(kinds)}
    unknown = next((kind for kind, category in found.items() if not category), None)
    if unknown is not None:
        raise table.fault(kinds.index(unknown), column, f"{unknown!r} is none of {', '.join(known)}")
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
            raise table.fault(row, name, "a value is missing" if np.isnan(values[row]) else f"{values[row]:g} is no size")


def changes(table: Table, rows: Rows, names: Sequence[str], columns: Sequence[str]) -> list[str]:
    """Remarks on tracks, by their names, with rows that contradict the first one."""
    remarks = []
    for column in columns:
        values = table[column][rows.order]
        first = rows.each(values[rows.starts[:-1]])
        differs = values != first
        if values.dtype.kind == "f":
            differs &= ~(np.isnan(values) & np.isnan(first))
        changing = [names[track] for track in np.flatnonzero(rows.totals(differs)).tolist()]
        if changing:
            more = f" and {len(changing) - _SHOWN} more" if len(changing) > _SHOWN else ""
            remarks.append(f"{column} changes within tracks ({', '.join(changing[:_SHOWN])}{more}): that of the first row counts")
    return remarks
