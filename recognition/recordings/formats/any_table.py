"""Tables (CSV, Parquet, Feather) with columns that a TOML file declares: `columns.toml` or
`NAME.columns.toml` beside `NAME.csv`.

Tables of the file: `columns` (names of columns; `track`, `time`, `x` and `y` are needed), `units`,
`frame`, `categories`; `step` is the time from frame to frame, s. Nothing is guessed but the step:
what is wrong shows in the intake, which compares places, speeds, headings and the step.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from recognition.recordings.intake import Report
from recognition.recordings.motion.smoothing import smoothed
from recognition.recordings.rows import (
    Clock,
    Rows,
    check_sizes,
    columns_of,
    cut,
    heading_of_motion,
    in_order,
    rate,
)
from recognition.recordings.source import REAR_AXLE, Source, participant
from recognition.recordings.table import Kind, Table, read_table
from runner.recording import Recording
from schemas.common.array_types import FloatArray, IntArray
from schemas.common.errors import InvalidFile
from schemas.common.storage import read_bytes

FORMAT = "table"
TITLE = "tables with a columns.toml"
BY_CONTENT = False
_FILE = "columns.toml"
_SUFFIXES = (".csv", ".parquet", ".feather")
_COLUMNS: dict[str, Kind] = {
    "track": "text", "time": "number", "x": "number", "y": "number", "heading": "number",
    "speed": "number",
    "length": "number", "width": "number", "category": "text",
}  # fmt: skip
_NEEDED = ("track", "time", "x", "y")
_CATEGORIES = (
    "car", "van", "truck", "bus", "trailer", "tram", "motorbike", "bicycle", "pedestrian",
    "obstacle",
)  # fmt: skip
_UNITS: dict[str, dict[str, float]] = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "frames": math.nan},
    "position": {"m": 1.0, "cm": 0.01, "ft": 0.3048},
    "size": {"m": 1.0, "cm": 0.01, "ft": 0.3048},
    "speed": {"m/s": 1.0, "km/h": 1.0 / 3.6, "mph": 0.44704, "ft/s": 0.3048},
    "heading": {"rad": 1.0, "deg": math.pi / 180.0},
}
"""Units of each quantity in SI units; the first is the default. Time in frames needs a step"""
_FRAME = {
    "y": ("left", "right"),
    "heading_from": ("x", "y"),
    "heading_turns": ("left", "right"),
    "reference": ("centre", "rear axle", "front", "rear"),
}
"""Choices of the frame, the default first: the side of x on which y lies, the axis from which
headings are counted and the way they turn as the axes lie, and the point of the vehicle whose place
is recorded"""
_MICRO = 1_000_000
_OTHER_STEP = 0.1
"""Relative difference from which a declared step is another one than the table's"""


class ColumnsDeclaration(NamedTuple):
    """Declaration of a table's columns.

    Attributes:
        path: the TOML file. columns: names in the table, by their meaning. units: factors to SI
            units by quantity. frame: choices of `_FRAME`. categories: by the table's words.
        step: time from frame to frame, s; None for that of the table.
    """

    path: Path
    columns: dict[str, str]
    units: dict[str, float]
    frame: dict[str, str]
    categories: dict[str, str]
    step: float | None

    @classmethod
    def read(cls, path: Path) -> ColumnsDeclaration:
        """Read a TOML file.

        Raises:
            InvalidFile: it is malformed, or declares what is not known; names key and choices.
        """
        try:
            found: dict[str, Any] = tomllib.loads(read_bytes(path).decode("utf-8-sig"))
        except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
            raise InvalidFile(f"no TOML: {error}", path=path) from error
        tables = ("columns", "units", "frame", "categories")
        _among(path, "key", found, (*tables, "step"))
        parts = [_strings(path, name, found.get(name, {})) for name in tables]
        columns, units, frame, categories = parts
        _among(path, "column", columns, tuple(_COLUMNS))
        missing = [name for name in _NEEDED if name not in columns]
        if missing:
            raise InvalidFile(f"[columns] lacks {', '.join(missing)}", path=path)
        _among(path, "unit", units, tuple(_UNITS))
        _among(path, "choice of the frame", frame, tuple(_FRAME))
        for name, value in units.items():
            _among(path, f"unit of {name}", [value], tuple(_UNITS[name]))
        for name, value in frame.items():
            _among(path, f"value of {name}", [value], _FRAME[name])
        _among(path, "category", categories.values(), _CATEGORIES)
        step = found.get("step")
        if step is not None and (isinstance(step, bool) or not isinstance(step, int | float)):
            raise InvalidFile(f"step = {step!r} is no number of seconds", path=path)
        if step is None and units.get("time") == "frames":
            raise InvalidFile("time in frames needs a step, s", path=path)
        factors = {
            name: choices[units.get(name, next(iter(choices)))] for name, choices in _UNITS.items()
        }
        chosen = {name: frame.get(name, choices[0]) for name, choices in _FRAME.items()}
        return cls(path, columns, factors, chosen, categories, step)


def _strings(path: Path, name: str, found: object) -> dict[str, str]:
    if not isinstance(found, dict) or not all(isinstance(text, str) for text in found.values()):
        raise InvalidFile(f"[{name}] is a table of texts", path=path)
    return found


def _among(path: Path, what: str, found: Any, known: tuple[str, ...]) -> None:
    for name in found:
        if name not in known:
            raise InvalidFile(f"{name!r} is no {what}; known are {', '.join(known)}", path=path)


class DeclaredTables(NamedTuple):
    """Format of all tables that one declaration is for."""

    path: Path
    TITLE: str = TITLE
    BY_CONTENT: bool = False

    def claims(self, path: Path) -> bool:
        """Whether a file is a table."""
        return path.suffix.lower() in _SUFFIXES

    def sources(self, path: Path, _roads: Path) -> list[Source]:
        """The recording of a table."""
        read = partial(_read, path, self.path)
        return [Source(path.stem, path.stem, FORMAT, path, read, columns=self.path)]


def _beside(path: Path) -> Path | None:
    own = path.with_suffix(f".{_FILE}"), path.parent / _FILE
    return next((file for file in own if file.is_file()), None)


def claims(path: Path) -> bool:
    """Whether a file is a table with a declaration beside it."""
    return path.suffix.lower() in _SUFFIXES and _beside(path) is not None


def sources(path: Path, roads: Path) -> list[Source]:
    """The recording of a table, which is a site of its own."""
    declaration = _beside(path)
    assert declaration is not None, "the file has been claimed"
    return DeclaredTables(declaration).sources(path, roads)


def _read(path: Path, declaration: Path) -> tuple[Recording, Report]:
    form = ColumnsDeclaration.read(declaration)
    kinds: dict[str, Kind] = {column: _COLUMNS[name] for name, column in form.columns.items()}
    if form.units["time"] != 1.0:
        kinds[form.columns["time"]] = "whole"  # nanoseconds are too large for measured values
    table = read_table(path, kinds)
    values = {name: table[column] for name, column in form.columns.items()}
    sizes = [form.columns[name] for name in ("length", "width") if name in values]
    check_sizes(table, sizes)
    names = np.unique(values["track"].astype(str)).tolist()
    track = np.searchsorted(names, values["track"].astype(str))
    counts, step = _clock(form, values["time"], track)
    clock = Clock(form.columns["time"], counts, _MICRO, step)
    rows = in_order(table, track, clock, names=names, sort=True)
    x, y, h = _places(form, values, rows)
    size = form.units["size"]
    who = []
    for name, row in zip(names, rows.order[rows.starts[:-1]].tolist(), strict=True):
        box = (size * float(values[n][row]) if n in values else None for n in ("length", "width"))
        who.append(participant(name, _category(form, table, values, row), *box))
    # Way from the recorded point to the centre, in lengths of the vehicle.
    ahead = {"centre": 0.0, "front": -0.5, "rear": 0.5, "rear axle": REAR_AXLE}
    off = ahead[form.frame["reference"]] * rows.each([one.box.length for one in who])
    x, y = x + off * np.cos(h), y + off * np.sin(h)
    if "speed" in values:
        speed = form.units["speed"] * values["speed"][rows.order]
    else:
        speed = rate(x, rows) * np.cos(h) + rate(y, rows) * np.sin(h)
    columns = columns_of(rows, who, x, y, h, speed, rate(speed, rows))
    report = rows.report(names)
    return Recording(cut(*smoothed(rows, who, columns, report)), step, None), report


def _clock(form: ColumnsDeclaration, time: FloatArray, track: IntArray) -> tuple[IntArray, float]:
    """Times in µs, and the step: the one declared, else the most frequent one within tracks, s.

    Raises:
        InvalidFile: the declared step is not that of the table's times.
    """
    factor = form.units["time"]
    seconds = time * (form.step if math.isnan(factor) and form.step else factor)
    # Whole microseconds: equal times of different tracks compare equal.
    counts = np.round((seconds - seconds.min()) * _MICRO).astype(np.int64)
    if form.step is not None and math.isnan(factor):
        return counts, form.step
    order = np.lexsort((counts, track))
    steps = np.diff(counts[order])[np.diff(track[order]) == 0]
    steps = steps[steps > 0]
    if not len(steps) and form.step is not None:
        return counts, form.step
    if not len(steps):
        raise InvalidFile(f"{form.columns['time']}: no track has two times", path=form.path)
    # To milliseconds, since clocks jitter: the most frequent step is that of the sensor.
    found, often = np.unique(np.round(steps, -3), return_counts=True)
    step = float(found[often.argmax()]) / _MICRO
    if form.step is not None and abs(step / form.step - 1.0) > _OTHER_STEP:
        told = (
            f"step = {form.step:g} s, but {form.columns['time']} of the table is {step:g} s apart"
        )
        raise InvalidFile(told, path=form.path)
    return counts, form.step or step


def _places(
    form: ColumnsDeclaration, values: Mapping[str, Any], rows: Rows
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Places (m) and headings (rad) in a right-handed frame; headings of motion where none are
    recorded."""
    side = 1.0 if form.frame["y"] == "left" else -1.0
    x, y = (form.units["position"] * values[name][rows.order] for name in ("x", "y"))
    y = side * y
    if "heading" not in values:
        return x, y, heading_of_motion(rate(x, rows), rate(y, rows), rows)
    turn = form.units["heading"] * values["heading"][rows.order]
    turn = turn if form.frame["heading_turns"] == "left" else -turn
    # The table's y axis is at +90° or -90° of x, by the side on which it lies.
    zero = 0.0 if form.frame["heading_from"] == "x" else side * 0.5 * np.pi
    return x, y, zero + turn


def _category(form: ColumnsDeclaration, table: Table, values: Mapping[str, Any], row: int) -> str:
    if "category" not in values:
        return "car"
    word = str(values["category"][row])
    known = form.categories.get(word, word.lower())
    if known not in _CATEGORIES:
        column = form.columns["category"]
        raise table.fault(row, column, f"[categories] of {form.path.name} does not have {word!r}")
    return known
