"""JSON of data sets: lists of records as tables, and checked values of objects in maps and scenes."""

from __future__ import annotations

import json
from collections.abc import Mapping
from itertools import chain
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from recognition.datasets.table import GREATEST, Kind, Table, from_arrow
from schemas.common.array_types import FloatArray
from schemas.common.errors import InvalidFile
from schemas.common.storage import read_bytes

T = TypeVar("T")
_NAMES: dict[type, str] = {list: "a list", dict: "an object", str: "text", bool: "true or false", int: "a whole number"}


def read_records(path: Path, kinds: Mapping[str, Kind]) -> Table:
    """Read a JSON list of objects as a table; values that `kinds` doesn't name are ignored.

    Args:
        kinds: kind of each value by its key; `key.0` is the first number of a list.

    Raises:
        InvalidFile: the file is no such list, or a value is absent or not of its kind; names row and key.
    """
    import pyarrow as pa

    try:
        found = json.loads(read_bytes(path))
    except json.JSONDecodeError as error:
        raise InvalidFile(f"not readable as JSON: {error.msg}", path=path, line=error.lineno) from None
    except (ValueError, RecursionError) as error:
        raise InvalidFile(f"not readable as JSON: {error}", path=path) from None
    if not isinstance(found, list) or not all(isinstance(one, dict) for one in found):
        raise InvalidFile("a list of JSON objects is expected", path=path)
    columns = {}
    for name, kind in kinds.items():
        key, _, index = name.partition(".")
        values = [one.get(key) for one in found]
        if index:
            values = [one[int(index)] if isinstance(one, list) and int(index) < len(one) else None for one in values]
        whole = kind in ("whole", "integer", "stamp")
        types = (str,) if kind in ("text", "label") else (int,) if whole else (int, float)
        wrong = next((row for row, one in enumerate(values) if type(one) not in types or not _fits(one)), None)
        if wrong is not None:
            said = "a value is missing" if values[wrong] is None else f"{str(values[wrong])[:40]!r} is no {kind} value"
            raise InvalidFile(f"row {wrong + 1}: {said}", path=path, element=f"column {name}")
        columns[name] = pa.array(values if whole or types == (str,) else map(float, values))
    return from_arrow(path, pa.table(columns), kinds)


def _fits(found: object) -> bool:
    """Whether a value is no whole number beyond 64 bits, which no column holds."""
    return not isinstance(found, int) or -(2**63) <= found < 2**63


def value(record: Mapping[str, Any], key: str, kind: type[T], path: Path, element: str) -> T:
    """Return a value of an object.

    Args:
        path, element: file and object, for messages.

    Raises:
        InvalidFile: the value is absent, or has another type.
    """
    found = record.get(key)
    if not isinstance(found, kind):
        said = f"there is no {key}" if found is None else f"{key} is {str(found)[:40]!r}, {_NAMES[kind]} is expected"
        raise InvalidFile(said, path=path, element=element)
    return found


def records(record: Mapping[str, Any], key: str, path: Path, element: str, optional: bool = False) -> list[dict[str, Any]]:
    """Return a list of objects; empty where it is optional and absent.

    Raises:
        InvalidFile: it is absent, or has something else.
    """
    found = [] if optional and key not in record else value(record, key, list, path, element)
    wrong = next((number for number, one in enumerate(found, 1) if not isinstance(one, dict)), None)
    if wrong is not None:
        raise InvalidFile(f"{key} {wrong} is {str(found[wrong - 1])[:40]!r}, an object is expected", path=path, element=element)
    return found


def named(record: Mapping[str, Any], key: str, path: Path, element: str, optional: bool = False) -> dict[str, dict[str, Any]]:
    """Return objects by their names; none where they are optional and absent.

    Raises:
        InvalidFile: they are absent, or a value is something else.
    """
    found = {} if optional and key not in record else value(record, key, dict, path, element)
    wrong = next((name for name, one in found.items() if not isinstance(one, dict)), None)
    if wrong is not None:
        raise InvalidFile(f"{key} {wrong} is {str(found[wrong])[:40]!r}, an object is expected", path=path, element=element)
    return found


def points(record: Mapping[str, Any], key: str, path: Path, element: str) -> FloatArray:
    """Return a line of an object, (n, 2), m; points that repeat the one before are left out.

    Raises:
        InvalidFile: it is no list of points with finite x and y.
    """
    found = value(record, key, list, path, element)
    try:
        flat = list(chain.from_iterable((point["x"], point["y"]) for point in found))
        line = np.array([float(one) for one in flat if not isinstance(one, str)]).reshape(-1, 2)
    except (TypeError, KeyError, ValueError, OverflowError):
        raise InvalidFile(f"{key} is no list of points with numbers x and y", path=path, element=element) from None
    if len(line) < len(found) or not (np.abs(line) <= GREATEST).all():
        raise InvalidFile(f"{key} has a point that is no place in m", path=path, element=element)
    apart = np.hypot(*np.diff(line, axis=0).T) > 0.0
    return line[np.append(True, apart)] if len(line) else line
