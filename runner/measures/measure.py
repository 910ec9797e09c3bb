"""Criticality measures of a run: what each one means, and their registry.

A measure is one class in a family file of `runner.measures.kinds`. Everything else that names measures (`result.json`, tables of
runs, `--fail-if`, reports, tags, docs/measures.md) takes them from `measures()`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from functools import cache
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, TypeVar

from schemas.common.discovery import load

if TYPE_CHECKING:  # commands list measures before numpy is needed
    import numpy as np
    from numpy.typing import NDArray

    from schemas.common.array_types import BoolArray, FloatArray

GREATEST_DECELERATION = 9.81
"""Deceleration (m/s²) beyond which tyres on a dry road do not brake: a coefficient of friction of 1"""
LONGEST_PET = 10.0
"""Post-encroachment times above this (s) are no encounter"""


class Series(NamedTuple):
    """Values of a quantity over time, and where it is defined; values elsewhere are 0, never NaN."""

    value: FloatArray
    valid: BoolArray


class Extreme(NamedTuple):
    """The extreme of a quantity over a run: its value, the instant (s) and the other participant."""

    value: float
    time: float
    other: str


def least(series: Series, other: NDArray[np.object_], time: FloatArray) -> Extreme | None:
    """The least value of a series where it is defined, the first of equal ones; None where it is never defined."""
    return _pick(series, other, time, int(series.value[series.valid].argmin())) if series.valid.any() else None


def greatest(series: Series, other: NDArray[np.object_], time: FloatArray) -> Extreme | None:
    """The greatest value of a series where it is defined, the first of equal ones; None where it is never defined."""
    return _pick(series, other, time, int(series.value[series.valid].argmax())) if series.valid.any() else None


def _pick(series: Series, other: NDArray[np.object_], time: FloatArray, index: int) -> Extreme:
    row = series.valid.nonzero()[0][index]
    return Extreme(float(series.value[row]), float(time[row]), str(other[row]))


class RunMeasure(ABC):
    """A criticality measure of a run: one number about the ego.

    Attributes:
        name: in results, tables, `--fail-if` and the index of a catalogue.
        label: in reports.
        unit: empty for a number without one.
        formula: in words and symbols.
        critical: whether `low` or `high` values are critical.
        validity: where it is defined.
        source: publication.
        most: value beyond which the amount no longer matters, the end of its axis in reports; None leaves it out of reports.
        beyond: word for values beyond `most` in reports; empty for the number.
        tag: name of the tag in catalogues; empty for none.
        is_extreme: whether it has an instant and another participant (`Extreme`), or is a number over the whole run.
    """

    name: str
    label: str
    unit: ClassVar[str] = ""
    formula: str
    critical: ClassVar[str]
    validity: ClassVar[str]
    source: ClassVar[str]
    most: float | None = None
    beyond: ClassVar[str] = ""
    tag: ClassVar[str] = ""
    is_extreme: ClassVar[bool] = True

    @abstractmethod
    def of(self, run: Any) -> Extreme | float | None:
        """The measure of a run, given as its `runner.measures.criticality.Criticality`; None where it is not defined."""

    def sentence(self, found: Mapping[str, Any] | float) -> str:
        """A value of `Criticality.summary` in words, for the reasons of verdicts."""
        if isinstance(found, Mapping):
            return f"{self.name} is {found['value']:.2f} {self.unit} with {found['other']} at {found['time']:.2f} s"
        return f"{self.name} is {found:.2f} {self.unit}"


_registered: dict[str, RunMeasure] = {}
_Class = TypeVar("_Class", bound=type[RunMeasure])


def measure(kind: _Class) -> _Class:
    """Register a class of measures, whose constructor takes no argument."""
    register(kind())
    return kind


def register(each: RunMeasure) -> None:
    """Register a measure."""
    _registered[each.name] = each


@cache
def measures() -> dict[str, RunMeasure]:
    """All measures by name, in the order of their families and of their places in these."""
    load("runner.measures.kinds")
    return dict(sorted(_registered.items(), key=lambda each: type(each[1]).__module__))  # whichever was imported first


def units() -> dict[str, str]:
    """Units of all measures by name."""
    return {name: each.unit for name, each in measures().items()}
