"""`acme_SITE.csv`: t (s), name, x, y (middle of the box, m), yaw (degrees, mathematical), 10 Hz."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np

from recognition.recordings.intake import Report
from recognition.recordings.motion.smoothing import smoothed
from recognition.recordings.rows import Clock, columns_of, cut, in_order, rate
from recognition.recordings.source import Source, participant
from recognition.recordings.table import Kind, read_table
from runner.recording import Recording

FORMAT = "acme log"
TITLE = "logs of acme"
BY_CONTENT = False  # True where `claims` reads files that are not named in a way of their own
_STEP = 0.1
_PREFIX = "acme_"
_COLUMNS: dict[str, Kind] = {
    "t": "number",
    "name": "text",
    "x": "number",
    "y": "number",
    "yaw": "number",
}


def claims(path: Path) -> bool:
    """Whether a file is one of the logger's."""
    return path.name.startswith(_PREFIX) and path.suffix == ".csv"


def sources(path: Path, roads: Path) -> list[Source]:
    """Recordings of a file, of which no more than its head is read."""
    return [Source(path.stem, path.stem.removeprefix(_PREFIX), FORMAT, path, partial(_read, path))]


def _read(path: Path) -> tuple[Recording, Report]:
    """Recording in SI units, of reference points; the report says what was repaired or left out."""
    table = read_table(path, _COLUMNS)  # refuses a bad value with line and column
    names = sorted(set(table["name"]))
    track = np.searchsorted(names, table["name"].astype(str))
    clock = Clock("t", np.round(table["t"] * 1000).astype(np.int64), 1000.0, _STEP)
    rows = in_order(table, track, clock)
    x, y, h = table["x"][rows.order], table["y"][rows.order], np.radians(table["yaw"][rows.order])
    speed = rate(x, rows) * np.cos(h) + rate(y, rows) * np.sin(h)
    participants = [participant(name, "car") for name in names]
    columns = columns_of(rows, participants, x, y, h, speed, rate(speed, rows))
    report = rows.report(names)
    return Recording(cut(*smoothed(rows, participants, columns, report)), _STEP, None), report
