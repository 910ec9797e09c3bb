"""The 17 classes of scenarios, and events of them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum


class Label(IntEnum):
    """Class of a scenario."""

    UNKNOWN = 0
    FREE_CRUISE = 1
    CAR_FOLLOWING = 2
    CUT_IN = 3
    CUT_OUT = 4
    LANE_CHANGE_LEFT = 5
    LANE_CHANGE_RIGHT = 6
    RAMP_ENTERING = 7
    RAMP_EXITING = 8
    URBAN_CUT_IN = 9
    URBAN_CUT_OUT = 10
    ROUNDABOUT_ENTERING = 11
    ROUNDABOUT_EXITING = 12
    ROUNDABOUT_CIRCULATING = 13
    LEFT_TURN = 14
    RIGHT_TURN = 15
    STRAIGHT_CROSS = 16
    MERGING = 17

    @property
    def title(self) -> str:
        """Name as text."""
        return _TITLES[self]


_TITLES = {
    Label.UNKNOWN: "unknown",
    Label.FREE_CRUISE: "highway free cruise",
    Label.CAR_FOLLOWING: "highway car following",
    Label.CUT_IN: "highway cut in",
    Label.CUT_OUT: "highway cut out",
    Label.LANE_CHANGE_LEFT: "left lane change",
    Label.LANE_CHANGE_RIGHT: "right lane change",
    Label.RAMP_ENTERING: "ramp entering",
    Label.RAMP_EXITING: "ramp exiting",
    Label.URBAN_CUT_IN: "urban cut in",
    Label.URBAN_CUT_OUT: "urban cut out",
    Label.ROUNDABOUT_ENTERING: "roundabout entering",
    Label.ROUNDABOUT_EXITING: "roundabout exiting",
    Label.ROUNDABOUT_CIRCULATING: "roundabout circulating",
    Label.LEFT_TURN: "unsignalised left turn",
    Label.RIGHT_TURN: "unsignalised right turn",
    Label.STRAIGHT_CROSS: "unsignalised straight cross",
    Label.MERGING: "unsignalised merging",
}


@dataclass(frozen=True)
class Event:
    """A scenario of a class.

    Attributes:
        recording: name of the recording.
        ego: name of the track that it is about.
        time: t*, the middle of its window, s.
        label: its class.
        partner: name of the other track that makes it one of its class, or None.
        tags: further criteria that hold or not, and measures at t* (m, s, m/s).
    """

    recording: str
    ego: str
    time: float
    label: Label
    partner: str | None
    tags: dict[str, bool | float]


def counts(events: Iterable[Event]) -> dict[Label, int]:
    """Number of events of each of the 17 classes, also of those without."""
    found = Counter(event.label for event in events)
    return {label: found[label] for label in Label if label is not Label.UNKNOWN}
