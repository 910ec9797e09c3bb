"""What a value of a table may be, checked for whole columns at once, and a message for the one that is wrong."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    import numpy as np
    import pyarrow as pa

Kind = Literal["whole", "integer", "number", "optional", "text", "label"]
"""Of a column: whole numbers from 0, integers (both up to 2⁵³), finite numbers, numbers that may be blank (NaN), text, or text
that may be blank (None). Text is printable: it becomes names in XML and on terminals."""

GREATEST = 1e9
"""Greatest magnitude of a measured value: whatever it measures in m, s or rad, more is a defect of the file."""
BLANK = ("", "nan", "na", "n/a", "null")
"""What stands for no value, in lower case."""
_GREATEST_WHOLE, _DIGITS = 2**53, 25
_WHOLE = re.compile(r"\s*-?\d+\s*", re.ASCII)


def arrow_type(kind: Kind) -> pa.DataType:
    """Arrow's type for the values of a column."""
    import pyarrow as pa

    types = {"whole": pa.int64(), "integer": pa.int64(), "text": pa.string(), "label": pa.string()}
    return types.get(kind, pa.float64())


def checked(table: pa.Table, kinds: Mapping[str, Kind]) -> dict[str, np.ndarray] | None:
    """The columns of a table, which have their types, as arrays that can be written to; None where a value is not of its kind."""
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
        return bool((np.abs(values) <= GREATEST).all())
    least = 0 if kind == "whole" else -_GREATEST_WHOLE
    return not blank and bool(((values >= least) & (values <= _GREATEST_WHOLE)).all())


def complaint(value: str, kind: Kind) -> str | None:
    """What is wrong with a value; None where nothing is."""
    shown = value if len(value) <= 40 else value[:40] + "…"
    if kind == "label" or (kind == "text" and value):
        return None if value.isprintable() else f"{shown!r} has characters that can't be printed"
    if value.strip().lower() in BLANK:
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
