"""The index of a catalogue: one row a scenario, as JSON, CSV and Parquet, for people and other programs."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from schemas.errors import InvalidFile
from schemas.storage import read_object

FILE = "index.json"
"""Its place in the folder of a catalogue."""
COLUMNS: dict[str, type] = {
    "file": str,
    "maneuver": str,
    "no_maneuver": str,
    "openlabel": str,
    "road": str,
    "class": str,
    "state": str,
    "sorted_by": str,
    "confidence": float,
    "rule_class": str,
    "model_class": str,
    "nearest_class": str,
    "labels_agree": bool,
    "passage": str,
    "data_set": str,
    "site": str,
    "recording": str,
    "vehicle": str,
    "partner": str,
    "time": float,
    "start": float,
    "end": float,
    "participants": int,
    "min_ttc": float,
    "min_thw": float,
    "max_drac": float,
    "min_distance": float,
    "pet": float,
    "max_collision_probability": float,
    "max_risk_field": float,
    "rss_risk_ad_rss": float,
    "rss_risk_r157": float,
    "collision_time": float,
}
"""Columns of a row; absent values are None. Files relative to the index: the scenario that replays the recording, that with the
manoeuvre (or why it has none), tags, road. The class, and whose labels sort; the model's confidence in the known class nearest to
what it saw; both labels, and whether they agree. Where from, with times in s. Measures."""

Row = Mapping[str, Any]


def rows_of(root: Path) -> list[dict[str, Any]]:
    """The rows of the index of a catalogue.

    Raises:
        InvalidFile: it is missing, or not readable.
    """
    return _listed(root / FILE, "scenarios")


def recordings_of(root: Path) -> list[str]:
    """Names of the recordings in the index of a catalogue; none where there is no index.

    Raises:
        InvalidFile: it is not readable.
    """
    path = root / FILE
    return [str(each.get("name")) for each in _listed(path, "recordings")] if path.is_file() else []


def _listed(path: Path, name: str) -> list[dict[str, Any]]:
    found = read_object(path).get(name)
    if not isinstance(found, list) or not all(isinstance(each, dict) for each in found):
        raise InvalidFile(f"the index of a catalogue has a list of objects {name!r}", path=path)
    return found


def as_json(rows: Sequence[Row], more: Mapping[str, Any]) -> bytes:
    """The rows under "scenarios", after other facts."""
    listed = [{name: row.get(name) for name in COLUMNS} | {"tags": row.get("tags", {})} for row in rows]
    return (json.dumps({**more, "scenarios": listed}, indent=1, ensure_ascii=False, allow_nan=False) + "\n").encode()


def as_csv(rows: Sequence[Row]) -> bytes:
    """A header and a line a row; absent values are blank."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(COLUMNS)
    table.writerows([row.get(name) for name in COLUMNS] for row in rows)
    return text.getvalue().encode()


def as_parquet(rows: Sequence[Row]) -> bytes:
    """The same as a Parquet table."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    types = {str: pa.string(), float: pa.float64(), int: pa.int64(), bool: pa.bool_()}
    table = pa.table({name: pa.array([row.get(name) for row in rows], types[kind]) for name, kind in COLUMNS.items()})
    target = pa.BufferOutputStream()
    pq.write_table(table, target, compression="zstd")
    return target.getvalue().to_pybytes()
