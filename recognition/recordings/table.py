"""Tables of data sets in CSV, Parquet and JSON, and checked values of objects in
maps and scenes.
"""

from __future__ import annotations

import csv
import json
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeVar

import numpy as np

from schemas.common.array_types import FloatArray
from schemas.common.errors import InvalidFile
from schemas.common.policy import current
from schemas.common.storage import read_bytes, read_feather, read_parquet

if TYPE_CHECKING:
    import numpy as np
    import pyarrow as pa


Kind = Literal["whole", "integer", "stamp", "number", "optional", "text", "label"]
"""Of a column: whole numbers from 0, integers (both up to 2⁵³), time stamps (whole numbers up to
2⁶³), finite numbers, numbers that may be blank (NaN), text, or text that may be blank (None). Text
is printable: it becomes names in XML and on terminals."""

GREATEST = 1e9
"""Greatest magnitude of a measured value: whatever it measures in m, s or rad, more is a defect of
the file."""
WHOLE_TURN = math.tau + 0.01
"""Greatest heading of files in rad: beyond, it is in other units"""
BLANK = ("", "nan", "na", "n/a", "null")
"""Texts for a missing value, in lower case."""
_WHOLE_KINDS = {"whole": (0, 2**53), "integer": (-(2**53), 2**53), "stamp": (0, 2**63 - 1)}
"""Least and greatest value of each kind of whole numbers"""
_DIGITS = 25
_WHOLE = re.compile(r"\s*-?\d+\s*", re.ASCII)


def arrow_type(kind: Kind) -> pa.DataType:
    """Arrow's type for the values of a column."""
    import pyarrow as pa

    return (
        pa.int64()
        if kind in _WHOLE_KINDS
        else pa.string()
        if kind in ("text", "label")
        else pa.float64()
    )


def checked(table: pa.Table, kinds: Mapping[str, Kind]) -> dict[str, np.ndarray] | None:
    """The columns of a table, which have their types, as arrays that can be written to; None where
    a value is not of its kind."""
    columns = {}
    for name, kind in kinds.items():
        values = table[name].to_numpy()
        if not _good(values, table[name].null_count, kind):
            return None
        columns[name] = values if values.flags.writeable else values.copy()
    return columns


def _good(values: np.ndarray, blank: int, kind: Kind) -> bool:
    import numpy as np

    if kind == "label":
        return all(value is None or value.isprintable() for value in values)
    if kind == "text":
        return all(value and value.isprintable() for value in values)
    if kind == "optional":
        return bool(((np.abs(values) <= GREATEST) | np.isnan(values)).all())
    if kind == "number":
        # Blanks are NaN here, and fail the comparison.
        return bool((np.abs(values) <= GREATEST).all())
    least, greatest = _WHOLE_KINDS[kind]
    return not blank and bool(((values >= least) & (values <= greatest)).all())


def complaint(value: str, kind: Kind) -> str | None:
    """Return the fault of a value; None if it is valid."""
    shown = value if len(value) <= 40 else value[:40] + "…"
    if kind == "label" or (kind == "text" and value):
        return None if value.isprintable() else f"{shown!r} has characters that can't be printed"
    if value.strip().lower() in BLANK:
        return (
            None
            if kind == "optional"
            else f"{shown!r} is no value"
            if value.strip()
            else "a value is missing"
        )
    if kind in _WHOLE_KINDS:
        least, greatest = _WHOLE_KINDS[kind]
        if not _WHOLE.fullmatch(value) or (least == 0 and "-" in value):
            return f"{shown!r} is not a whole number" + (" from 0" if least == 0 else "")
        # Longer texts are not converted: the time that int() takes grows with the square of their
        # length.
        return (
            None
            if len(value) <= _DIGITS and abs(int(value)) <= greatest
            else f"{shown} is too large"
        )
    number = _number(value)
    if number is None:
        return f"{shown!r} is not a number"
    return None if abs(number) <= GREATEST else f"{shown} is no measured value"


def _number(text: str) -> float | None:
    try:
        number = float(text)
    except ValueError:
        return None
    # float() takes 1_000 for a number.
    return None if math.isnan(number) or "_" in text else number


PARQUET, FEATHER, HEADLESS = ".parquet", ".feather", ".txt"
"""Endings of files that are no CSV; text without a header has its values between blanks"""
_ARROW = (PARQUET, FEATHER)
_SEPARATORS = {";": "semicolons", "\t": "tabs", "|": "bars"}
_LONGEST_HEADER = 1 << 16


@dataclass(frozen=True)
class Table:
    """Columns of one file by name, equally long.

    Attributes:
        lines: whether its rows are lines of text.
        index: number of each row in the file, from 0; None where all rows are here.
    """

    path: Path
    columns: dict[str, np.ndarray]
    lines: bool = True
    index: np.ndarray | None = None

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))

    def __getitem__(self, name: str) -> np.ndarray:
        return self.columns[name]

    def where(self, chosen: np.ndarray) -> Table:
        """The rows for which `chosen` is true, of a table with all rows."""
        return Table(
            self.path,
            {name: values[chosen] for name, values in self.columns.items()},
            self.lines,
            chosen.nonzero()[0],
        )

    def fault(self, row: int, column: str, message: str) -> InvalidFile:
        """The error for a value in a row counted from 0."""
        row = row if self.index is None else int(self.index[row])
        if not self.lines:
            return _fault_of_row(self.path, row, column, message)
        line = next(
            (line for index, (line, _) in enumerate(_rows(self.path)) if index == row), None
        )
        return InvalidFile(message, path=self.path, line=line, element=f"column {column}")


def column_names(path: Path) -> list[str]:
    """Names of the columns of a Parquet or Feather file, or in the first line of a CSV file (""
    where one has none).

    Raises:
        InvalidFile: the file can't be read, is empty, or is not UTF-8 text.
    """
    current().admit(path)
    return _arrow_names(path) if path.suffix in _ARROW else _csv_names(path)


def first_numbers(path: Path) -> list[float]:
    """The numbers in the first line of text without a header; none where it has anything else, or
    can't be read."""
    try:
        with path.open("rb") as file:
            return [float(word) for word in file.readline(_LONGEST_HEADER).split()]
    except (OSError, ValueError):
        return []


def read_table(path: Path, kinds: Mapping[str, Kind], headless: Sequence[str] = ()) -> Table:
    """Read the columns named in `kinds` from a file; others are ignored.

    Whole columns come as int64, numbers as float64, text as arrays of str objects.

    Args:
        headless: names of all columns of text without a header, where the file is that; all of them
            hold numbers.

    Raises:
        InvalidFile: a column is missing or there twice, a line has too few or too many values, a
            value is not of its kind or blank, or there are no rows; names line (or row) and column.
    """
    current().admit(path)
    if path.suffix == HEADLESS:
        return _read_headless(path, headless, kinds)
    names = column_names(path)
    _require(path, names, kinds)
    return _read_arrow(path, kinds) if path.suffix in _ARROW else _read_csv(path, names, kinds)


def _require(path: Path, names: list[str], kinds: Mapping[str, Kind]) -> None:
    line = None if path.suffix in _ARROW else 1
    for name in kinds:
        if names.count(name) > 1:
            raise InvalidFile(
                "this column is there twice", path=path, line=line, element=f"column {name}"
            )
    missing = [name for name in kinds if name not in names]
    if not missing:
        return
    wrong = next(
        (word for mark, word in _SEPARATORS.items() if len(names) == 1 and mark in names[0]), None
    )
    if wrong:
        raise InvalidFile(
            f"columns are separated by {wrong}, commas are expected", path=path, line=line
        )
    shown = ", ".join(name or "''" for name in names[:20])
    raise InvalidFile(f"no column {', '.join(missing)}; columns: {shown}", path=path, line=line)


# CSV ----------------------------------------------------------------------------------------


def _csv_names(path: Path) -> list[str]:
    try:
        # A byte order mark is no part of the first name. The line is bounded: binary files may not
        # end any.
        with path.open(encoding="utf-8-sig", newline="") as file:
            first = file.readline(_LONGEST_HEADER)
            names = [name.strip() for name in next(csv.reader([first], strict=True), [])]
    except UnicodeDecodeError:
        raise InvalidFile("this is not UTF-8 text", path=path, line=1) from None
    except csv.Error as error:
        raise InvalidFile(f"this is no CSV: {error}", path=path, line=1) from None
    except (OSError, ValueError) as error:
        raise _unreadable(path, error) from None
    if not any(names):
        raise InvalidFile(
            "the file is empty" if not first else "the first line names no columns",
            path=path,
            line=1,
        )
    return names


def _read_csv(path: Path, names: list[str], kinds: Mapping[str, Kind]) -> Table:
    import pyarrow as pa
    import pyarrow.csv as pacsv

    # Columns that are not read may be blank or repeat each other: numbers stand for their names.
    differing = [name if name in kinds else f"\0{index}" for index, name in enumerate(names)]
    convert = pacsv.ConvertOptions(
        column_types={name: arrow_type(kind) for name, kind in kinds.items()},
        include_columns=list(kinds),
        null_values=sorted({*BLANK, *map(str.upper, BLANK), "NaN", "Nan"}),
    )
    try:
        found = pacsv.read_csv(
            path, pacsv.ReadOptions(skip_rows=1, column_names=differing), convert_options=convert
        )
    except pa.ArrowInvalid as error:
        # Arrow names no column: a slow second pass finds line and column.
        _find_fault(path, names, kinds)
        raise InvalidFile(f"this is no CSV table: {error}", path=path) from None
    except (OSError, ValueError) as error:
        raise _unreadable(path, error) from None
    columns = checked(found, kinds)
    if columns is None:
        _find_fault(path, names, kinds)
        raise InvalidFile("values are missing or out of range", path=path)
    if not found.num_rows:
        raise InvalidFile("there are no rows below the header", path=path, line=1)
    return Table(path, columns)


def _find_fault(path: Path, names: Sequence[str], kinds: Mapping[str, Kind]) -> None:
    """Raise the error for the first line that is not as it should be."""
    places = [(name, names.index(name), kind) for name, kind in kinds.items()]
    for line, values in _rows(path):
        if len(values) != len(names):
            raise InvalidFile(
                f"{len(values)} values in a table of {len(names)} columns", path=path, line=line
            )
        for name, place, kind in places:
            wrong = complaint(values[place], kind)
            if wrong:
                raise InvalidFile(wrong, path=path, line=line, element=f"column {name}")


def _rows(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Line number and values of each row below the header, if any; blank lines are no rows."""
    line = 1
    try:
        if path.suffix == HEADLESS:
            with path.open(encoding="utf-8") as file:
                yield from (
                    (line, words) for line, text in enumerate(file, 1) if (words := text.split())
                )
            return
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.reader(file)
            next(reader, None)
            for values in reader:
                line = reader.line_num
                if values:
                    yield line, values
    except csv.Error as error:
        raise InvalidFile(f"this is no CSV: {error}", path=path, line=line + 1) from None
    except UnicodeDecodeError:
        raise InvalidFile("this is not UTF-8 text", path=path) from None


def _read_headless(path: Path, names: Sequence[str], kinds: Mapping[str, Kind]) -> Table:
    import numpy as np
    import pyarrow as pa

    columns, why = None, "values are missing or out of range"
    try:
        values = np.loadtxt(path, comments=None, ndmin=2, encoding="utf-8")
        if values.shape[1] == len(names):
            arrays = {
                name: pa.array(values[:, names.index(name)]).cast(arrow_type(kind))
                for name, kind in kinds.items()
            }
            columns = checked(pa.table(arrays), kinds)
    except ValueError as error:  # of Arrow and of text that is not UTF-8, too
        why = f"this is no table of numbers: {error}"
    except OSError as error:
        raise _unreadable(path, error) from None
    if columns is None:
        _find_fault(path, names, kinds)
        raise InvalidFile(why, path=path)
    return Table(path, columns)


# Parquet and Feather ------------------------------------------------------------------------


def _arrow_names(path: Path) -> list[str]:
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        if path.suffix == PARQUET:
            return list(pq.read_schema(path).names)
        with pa.OSFile(str(path)) as file:
            return list(pa.ipc.open_file(file).schema.names)
    except (pa.ArrowException, OSError, ValueError) as error:
        raise _unreadable(path, error) from None


def _read_arrow(path: Path, kinds: Mapping[str, Kind]) -> Table:
    import pyarrow as pa

    try:
        read = read_parquet if path.suffix == PARQUET else read_feather
        stored = read(path, list(kinds))
    except (pa.ArrowException, OSError, ValueError) as error:
        raise _unreadable(path, error) from None
    if not stored.num_rows:
        raise InvalidFile("the table has no rows", path=path)
    return from_arrow(path, stored, kinds)


def from_arrow(path: Path, stored: pa.Table, kinds: Mapping[str, Kind]) -> Table:
    """Return columns of an Arrow table, checked.

    Args:
        path: the file, for messages.

    Raises:
        InvalidFile: a value is not of its kind; names row and column.
    """
    import pyarrow as pa

    try:
        columns = checked(
            pa.table({name: stored[name].cast(arrow_type(kind)) for name, kind in kinds.items()}),
            kinds,
        )
    except pa.ArrowException:
        columns = None
    if columns is None:
        raise _fault_of_column(path, stored, kinds)
    return Table(path, columns, lines=False)


def _fault_of_column(path: Path, stored: pa.Table, kinds: Mapping[str, Kind]) -> InvalidFile:
    for name, kind in kinds.items():
        for row, value in enumerate(stored[name].to_pylist()):
            wrong = complaint(_as_text(value), kind)
            if wrong:
                return _fault_of_row(path, row, name, wrong)
    return InvalidFile("values are missing or out of range", path=path)


def _as_text(value: Any) -> str:
    """A value as it would be written in a CSV file."""
    if value is None:
        return ""
    return f"{value:.0f}" if isinstance(value, float) and value.is_integer() else str(value)


def _fault_of_row(path: Path, row: int, column: str, message: str) -> InvalidFile:
    return InvalidFile(f"row {row + 1}: {message}", path=path, element=f"column {column}")


def _unreadable(path: Path, error: Any) -> InvalidFile:
    if isinstance(error, FileNotFoundError):
        return InvalidFile("no such file", path=path)
    if path.is_dir():
        return InvalidFile("this is a folder, a file is expected", path=path)
    reason = getattr(error, "strerror", None) or str(error)
    return InvalidFile(f"the file can't be read: {reason}", path=path)


# JSON -------------------------------------------------------------------------------------------


T = TypeVar("T")
_NAMES: dict[type, str] = {
    list: "a list",
    dict: "an object",
    str: "text",
    bool: "true or false",
    int: "a whole number",
}


def read_records(path: Path, kinds: Mapping[str, Kind]) -> Table:
    """Read a JSON list of objects as a table; values that `kinds` doesn't name are ignored.

    Args:
        kinds: kind of each value by its key; `key.0` is the first number of a list.

    Raises:
        InvalidFile: the file is not such a list, or a value is absent or not of its kind; names row
            and key.
    """
    import pyarrow as pa

    try:
        found = json.loads(read_bytes(path))
    except json.JSONDecodeError as error:
        raise InvalidFile(
            f"not readable as JSON: {error.msg}", path=path, line=error.lineno
        ) from None
    except (ValueError, RecursionError) as error:
        raise InvalidFile(f"not readable as JSON: {error}", path=path) from None
    if not isinstance(found, list) or not all(isinstance(one, dict) for one in found):
        raise InvalidFile("a list of JSON objects is expected", path=path)
    columns = {}
    for name, kind in kinds.items():
        key, _, index = name.partition(".")
        values = [one.get(key) for one in found]
        if index:
            values = [
                one[int(index)] if isinstance(one, list) and int(index) < len(one) else None
                for one in values
            ]
        whole = kind in ("whole", "integer", "stamp")
        types = (str,) if kind in ("text", "label") else (int,) if whole else (int, float)
        # The exact type: to isinstance, JSON's true is a whole number.
        wrong = next(
            (row for row, one in enumerate(values) if type(one) not in types or not _fits(one)),
            None,
        )
        if wrong is not None:
            said = (
                "a value is missing"
                if values[wrong] is None
                else f"{str(values[wrong])[:40]!r} is no {kind} value"
            )
            raise InvalidFile(f"row {wrong + 1}: {said}", path=path, element=f"column {name}")
        columns[name] = pa.array(values if whole or types == (str,) else map(float, values))
    return from_arrow(path, pa.table(columns), kinds)


def _fits(found: object) -> bool:
    """Whether a column can hold a value: whole numbers beyond 64 bits fit in none."""
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
        said = (
            f"there is no {key}"
            if found is None
            else f"{key} is {str(found)[:40]!r}, {_NAMES[kind]} is expected"
        )
        raise InvalidFile(said, path=path, element=element)
    return found


def records(
    record: Mapping[str, Any], key: str, path: Path, element: str, optional: bool = False
) -> list[dict[str, Any]]:
    """Return a list of objects; empty where it is optional and absent.

    Raises:
        InvalidFile: it is absent, or has something else.
    """
    found = [] if optional and key not in record else value(record, key, list, path, element)
    wrong = next((number for number, one in enumerate(found, 1) if not isinstance(one, dict)), None)
    if wrong is not None:
        raise InvalidFile(
            f"{key} {wrong} is {str(found[wrong - 1])[:40]!r}, an object is expected",
            path=path,
            element=element,
        )
    return found


def named(
    record: Mapping[str, Any], key: str, path: Path, element: str, optional: bool = False
) -> dict[str, dict[str, Any]]:
    """Return objects by their names; none where they are optional and absent.

    Raises:
        InvalidFile: they are absent, or a value is something else.
    """
    found = {} if optional and key not in record else value(record, key, dict, path, element)
    wrong = next((name for name, one in found.items() if not isinstance(one, dict)), None)
    if wrong is not None:
        raise InvalidFile(
            f"{key} {wrong} is {str(found[wrong])[:40]!r}, an object is expected",
            path=path,
            element=element,
        )
    return found


def points(record: Mapping[str, Any], key: str, path: Path, element: str) -> FloatArray:
    """Return a line of an object, (n, 2), m; points that repeat the one before are left out.

    Raises:
        InvalidFile: it is not a list of points with finite x and y.
    """
    found = value(record, key, list, path, element)
    try:
        flat = list(chain.from_iterable((point["x"], point["y"]) for point in found))
        # float() would take texts for numbers; without them the count below does not fit.
        line = np.array([float(one) for one in flat if not isinstance(one, str)]).reshape(-1, 2)
    except (TypeError, KeyError, ValueError, OverflowError):
        raise InvalidFile(
            f"{key} is no list of points with numbers x and y", path=path, element=element
        ) from None
    if len(line) < len(found) or not (np.abs(line) <= GREATEST).all():
        raise InvalidFile(f"{key} has a point that is no place in m", path=path, element=element)
    apart = np.hypot(*np.diff(line, axis=0).T) > 0.0
    return line[np.append(True, apart)] if len(line) else line
