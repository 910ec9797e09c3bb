"""One number of a document in many parameter sets at once.

While a document is read for n sets, an attribute that varies between them reads as a `NumberColumn`
of n numbers. What is decided by a number is decided as for the first set; the sets for which it
would be decided otherwise are another structure, to be read again (`Columns.alike`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

import numpy as np

from schemas.common.array_types import BoolArray, FloatArray
from schemas.common.errors import ToolchainError
from schemas.expressions.values import MARK


class NotInArrays(ToolchainError):
    """Error: an element can't be played for many parameter sets at once; one by one it may."""


class NumberColumn(np.ndarray[Any, np.dtype[np.float64]]):
    """A number in n parameter sets (n,).

    As a truth value or an integer it is that of the first set, and sets that differ are no longer
    `Columns.alike`. It is no float: functions of `math` refuse it.
    """

    @property
    def values(self) -> FloatArray:
        """The numbers (n,)."""
        return self.view(np.ndarray)

    def __bool__(self) -> bool:
        return bool(_agreed(self.view(np.ndarray) != 0))

    def __int__(self) -> int:
        return int(_agreed(self.view(np.ndarray)))

    __index__ = __int__

    def __float__(self) -> float:
        raise NotInArrays("it needs a number that varies as a single one")

    def __format__(self, spec: str) -> str:
        return format(float(self.view(np.ndarray)[0]), spec)


class Columns:
    """The columns of one reading of a document.

    Args:
        n: number of parameter sets.

    Attributes:
        alike: sets for which everything was decided as for the first one (n,).
    """

    def __init__(self, n: int) -> None:
        self.n = n
        self.alike: BoolArray = np.ones(n, bool)
        self._columns: list[NumberColumn] = []

    def mark(self, values: Any) -> str:
        """Text that stands for n numbers in an attribute."""
        self._columns.append(np.asarray(values, np.float64).view(NumberColumn))
        return f"{MARK}{len(self._columns) - 1}"

    def of(self, text: str) -> NumberColumn:
        """The column that a text stands for."""
        return self._columns[int(text[len(MARK) :])]

    def agree(self, values: Any) -> None:
        """Keep the sets that have the value of the first one."""
        self.alike &= np.asarray(values) == values[0]

    def each(self, evaluate: Callable[[int], Any]) -> Any:
        """Evaluate something for each set: a mark where it gives numbers that vary, else the value
        of the first set.

        Values that are no numbers have to be the same; sets where they are not are not alike.
        """
        values = [evaluate(number) for number in range(self.n)]
        first = values[0]
        # bool is a subclass of int, but a truth value decides structure and can't vary.
        if isinstance(first, bool | str) or not all(
            isinstance(value, int | float) for value in values
        ):
            self.alike &= np.fromiter((value == first for value in values), bool, self.n)
            return first
        return self.mark(values) if any(value != first for value in values) else first


_reading: ContextVar[Columns | None] = ContextVar("columns", default=None)


@contextmanager
def reading(columns: Columns) -> Iterator[Columns]:
    """Context manager around the reading of a document for many sets."""
    token = _reading.set(columns)
    try:
        yield columns
    finally:
        _reading.reset(token)


def is_reading() -> bool:
    """Whether a document is read for many sets."""
    return _reading.get() is not None


def current() -> Columns:
    """The columns of the document that is read now for many sets."""
    columns = _reading.get()
    assert columns is not None, "a document is read for many sets"
    return columns


def _agreed(values: Any) -> Any:
    """The value of the first set, for those that have the same."""
    columns = _reading.get()
    if columns is None or len(values) != columns.n:
        raise ValueError("a column has one truth value only while a document is read")
    columns.alike &= values == values[0]
    return values[0]
