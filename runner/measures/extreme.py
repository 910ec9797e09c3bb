"""The extreme of a measure over a run."""

from __future__ import annotations

from typing import NamedTuple


class Extreme(NamedTuple):
    """The extreme of a measure over a run: its value, when (s) and with whom."""

    value: float
    time: float
    other: str
