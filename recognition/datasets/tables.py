"""Strict reading of CSV and Parquet tables: the columns asked for, as numpy arrays, or an error that says where.

The fast reader (Arrow) only decides whether a file is good; what is wrong with a bad one is found by a second, slow pass.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from schemas.errors import InvalidFile

if TYPE_CHECKING:
    import numpy as np
    import pyarrow as pa

Kind = Literal["whole", "integer", "number", "optional", "text", "label"]
"""Of a column: whole numbers from 0, integers (both up to 2⁵³), finite numbers, numbers that may be blank (NaN), text, or text
that may be blank (None)."""

GREATEST = 1e9
"""Greatest magnitude of a measured value: whatever it measures in m, s or rad, more is a defect of the file."""
_GREATEST_WHOLE, _DIGITS = 2**53, 25
_WHOLE = re.compile(r"\s*-?\d+\s*")
_BLANK = ("", "nan", "na", "n/a", "null")
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
        return Table(self.path, {name: values[chosen] for name, values in self.columns.items()}, self.lines, chosen.nonzero()[0])

    def fault(self, row: int, column: str, message: str) -> InvalidFile:
        """The error for a value in a row counted from 0."""
        row = row if self.index is None else int(self.index[row])
        if not self.lines:
            return InvalidFile(f"row {row + 1}: {message}", path=self.path, element=f"column {column}")
        line = next((line for index, (line, _) in enumerate(_rows(self.path)) if index == row), None)
        return InvalidFile(message, path=self.path, line=line, element=f"column {column}")


def header(path: Path) -> list[str]:
    """Column names in the first line of a CSV file.

    Raises:
        InvalidFile: the file can't be read, is empty, is not UTF-8 text, or names a column twice.
    """
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            first = file.readline(_LONGEST_HEADER)
            names = [name.strip() for name in next(csv.reader([first]), [])]
    except UnicodeDecodeError:
        raise InvalidFile("this is not UTF-8 text", path=path, line=1) from None
    except csv.Error as error:
        raise InvalidFile(f"this is no CSV: {error}", path=path, line=1) from None
    except (OSError, ValueError) as error:
        raise _unreadable(path, error) from None
    if not any(names):
        raise InvalidFile("the file is empty" if not first else "the first line names no columns", path=path, line=1)
    for name in names:
        if name and names.count(name) > 1:
            raise InvalidFile("this column is there twice", path=path, line=1, element=f"column {name}")
    return names


def sniffed(path: Path) -> set[str]:
    """Column names of a CSV or Parquet file, none where it is neither."""
    try:
        return set(parquet_header(path) if path.suffix == ".parquet" else header(path))
    except InvalidFile:
        return set()


def read_csv(path: Path, kinds: Mapping[str, Kind]) -> Table:
    """Read the columns named in `kinds`; others are ignored.

    Whole columns come as int64, numbers as float64, text as arrays of str objects.

    Raises:
        InvalidFile: a column is missing, a line has too few or too many values, a value is not of its kind or blank, or
            there are no rows; names line and column.
    """
    import pyarrow as pa
    import pyarrow.csv as pacsv

    names = header(path)
    _require(path, names, kinds)
    convert = pacsv.ConvertOptions(
        column_types={name: _arrow_type(kind) for name, kind in kinds.items()},
        include_columns=list(kinds),
        null_values=sorted({*_BLANK, *map(str.upper, _BLANK), "NaN", "Nan"}),
    )
    try:
        found = pacsv.read_csv(path, pacsv.ReadOptions(skip_rows=1, column_names=_filled(names)), convert_options=convert)
    except pa.ArrowInvalid as error:
        _find_fault(path, names, kinds)
        raise InvalidFile(f"this is no CSV table: {error}", path=path) from None
    except (OSError, ValueError) as error:
        raise _unreadable(path, error) from None
    columns = _columns(found, kinds)
    if columns is None:
        _find_fault(path, names, kinds)
        raise InvalidFile("values are missing or out of range", path=path)
    if not found.num_rows:
        raise InvalidFile("there are no rows below the header", path=path, line=1)
    return Table(path, columns)


def read_parquet(path: Path, kinds: Mapping[str, Kind]) -> Table:
    """Read the columns named in `kinds` from a Parquet file, with the same checks."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    _require(path, parquet_header(path), kinds, line=None)
    try:
        found = pq.read_table(path, columns=list(kinds))
        for index, name in enumerate(found.column_names):
            found = found.set_column(index, name, found[name].cast(_arrow_type(kinds[name]), safe=True))
    except (pa.ArrowException, OSError, ValueError) as error:
        raise _unreadable(path, error) from None
    if not found.num_rows:
        raise InvalidFile("the table has no rows", path=path)
    columns = _columns(found, kinds)
    if columns is None:
        raise _parquet_fault(path, found, kinds)
    return Table(path, columns, lines=False)


def parquet_header(path: Path) -> list[str]:
    """Column names of a Parquet file."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        return list(pq.read_schema(path).names)
    except (pa.ArrowException, OSError, ValueError) as error:
        raise _unreadable(path, error) from None


def _require(path: Path, names: list[str], kinds: Mapping[str, Kind], line: int | None = 1) -> None:
    missing = [name for name in kinds if name not in names]
    if not missing:
        return
    wrong = next((word for mark, word in _SEPARATORS.items() if len(names) == 1 and mark in names[0]), None)
    if wrong:
        raise InvalidFile(f"columns are separated by {wrong}, commas are expected", path=path, line=line)
    shown = ", ".join(name or "''" for name in names[:20])
    raise InvalidFile(f"no column {', '.join(missing)}; columns: {shown}", path=path, line=line)


def _filled(names: list[str]) -> list[str]:
    """Nameless columns, which nobody asks for, need names that differ."""
    return [name or f"\0{index}" for index, name in enumerate(names)]


def _arrow_type(kind: Kind) -> pa.DataType:
    import pyarrow as pa

    types = {"whole": pa.int64(), "integer": pa.int64(), "text": pa.string(), "label": pa.string()}
    return types.get(kind, pa.float64())


def _columns(table: pa.Table, kinds: Mapping[str, Kind]) -> dict[str, np.ndarray] | None:
    """The columns as arrays; None where a value is blank or out of its range."""
    import numpy as np

    columns = {}
    for name, kind in kinds.items():
        values = table[name].to_numpy()
        if kind in ("whole", "integer"):
            good = not table[name].null_count and bool((np.abs(values) <= _GREATEST_WHOLE).all())
            good = good and (kind == "integer" or not len(values) or values.min() >= 0)
        elif kind == "text":
            good = all(values)
        else:
            good = kind == "label" or bool(((np.abs(values) <= GREATEST) | ((kind == "optional") & np.isnan(values))).all())
        if not good:
            return None
        columns[name] = values if values.flags.writeable else values.copy()
    return columns


def _parquet_fault(path: Path, table: pa.Table, kinds: Mapping[str, Kind]) -> InvalidFile:
    for name, kind in kinds.items():
        for row, value in enumerate(table[name].to_pylist()):
            wrong = _complaint("" if value is None else str(value), kind)
            if wrong:
                return InvalidFile(f"row {row + 1}: {wrong}", path=path, element=f"column {name}")
    return InvalidFile("values are missing or out of range", path=path)


def _find_fault(path: Path, names: list[str], kinds: Mapping[str, Kind]) -> None:
    """Raise the error for the first line that is not as it should be."""
    places = [(name, names.index(name), kind) for name, kind in kinds.items()]
    for line, values in _rows(path):
        if len(values) != len(names):
            raise InvalidFile(f"{len(values)} values in a table of {len(names)} columns", path=path, line=line)
        for name, place, kind in places:
            wrong = _complaint(values[place], kind)
            if wrong:
                raise InvalidFile(wrong, path=path, line=line, element=f"column {name}")


def _rows(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Line number and values of each row below the header; blank lines are no rows."""
    line = 1
    try:
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


def _complaint(value: str, kind: Kind) -> str | None:
    """What is wrong with a value; None where nothing is."""
    shown = value if len(value) <= 40 else value[:40] + "…"
    if kind == "label" or (kind == "text" and value):
        return None
    if value.strip().lower() in _BLANK:
        return None if kind == "optional" else f"{shown!r} is no value" if value.strip() else "a value is missing"
    if kind in ("whole", "integer"):
        if not _WHOLE.fullmatch(value) or (kind == "whole" and "-" in value):
            return f"{shown!r} is not a whole number" + (" from 0" if kind == "whole" else "")
        return None if len(value) <= _DIGITS and abs(int(value)) <= _GREATEST_WHOLE else f"{shown} is too large"
    number = _number(value)
    if number is None:
        return f"{shown!r} is not a number"
    return None if abs(number) <= GREATEST else f"{shown} is no measured value"


def _number(text: str) -> float | None:
    try:
        number = float(text)
    except ValueError:
        return None
    return None if math.isnan(number) or "_" in text else number


def _unreadable(path: Path, error: Any) -> InvalidFile:
    if isinstance(error, FileNotFoundError):
        return InvalidFile("no such file", path=path)
    if path.is_dir():
        return InvalidFile("this is a folder, a file is expected", path=path)
    reason = getattr(error, "strerror", None) or str(error)
    return InvalidFile(f"the file cannot be read: {reason}", path=path)
