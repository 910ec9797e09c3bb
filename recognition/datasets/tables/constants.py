"""Kinds and sizes, which a table repeats in each row of a track: all rows are checked, the first one counts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from recognition.datasets.tables.rows import Rows
from recognition.datasets.tables.table import Table
from xodr.array_types import BoolArray

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
