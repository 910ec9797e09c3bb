"""What a manoeuvre is: who takes part, and seven numbers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from recognition.catalogue.maneuvers.courses import Course
from runner.recording import Track

LONGEST = 10.0
"""Time (s) from the scene's start to the manoeuvre, and from its end to the scene's, at most."""
SHORTEST = 1.0
"""Duration (s) of a manoeuvre, at least"""
SMOOTHING = 0.5
"""Window (s) over which speeds are averaged"""


class Seven(NamedTuple):
    """The parameters: gap at the trigger (m; None for a manoeuvre without another one), speeds (m/s), times (s).

    The gap is that of the boxes to the lead; in a passage, that from the other one's front to where the ways meet.
    """

    gap: float | None
    start_speed: float
    start_delay: float
    end_speed: float
    duration: float
    final_speed: float
    end_delay: float


class Meeting(NamedTuple):
    """Where the way of another one meets the ego's.

    Attributes:
        other: its track.
        course: its way.
        x, y: the place, m.
        reach: how far along its course the reference point of the other one is when its front is there, m.
        time: when that was, s.
    """

    other: Track
    course: Course
    x: float
    y: float
    reach: float
    time: float


class Onwards(NamedTuple):
    """How one goes on: to which speed (m/s), reached evenly within which time (s)."""

    speed: float
    duration: float


class Passage(NamedTuple):
    """Ways that are not told by lanes alone.

    Attributes:
        course: the ego's.
        begins: how far along it the manoeuvre begins, m.
        meeting: with the way of another one, and `onwards` how that one goes on from there; None where there is nobody.
    """

    course: Course
    begins: float
    meeting: Meeting | None = None
    onwards: Onwards | None = None


@dataclass(frozen=True)
class Maneuver:
    """A manoeuvre.

    Attributes:
        kind: cut_in, cut_out, lane_change, following, cruise or passage.
        ego: its track.
        other: who is ahead of the ego when it begins, in a passage whose way the ego's meets; None for nobody.
        left: whether the lane change is to the left; None where there is none.
        values: the parameters.
        speed: of the one who is not the actor, before the manoeuvre, m/s.
        start, end: of the scene, in the recording, s.
        passage: the ways, where both keep to those that were recorded; None where they keep to lanes.
    """

    kind: str
    ego: Track
    other: Track | None
    left: bool | None
    values: Seven
    speed: float
    start: float
    end: float
    passage: Passage | None = None

    @property
    def ego_acts(self) -> bool:
        """Whether the ego is the actor."""
        return self.kind in ("lane_change", "cruise", "passage")


class Span(NamedTuple):
    """An event's start, middle and end, s."""

    start: float
    middle: float
    end: float


def speed_at(track: Track, time: float) -> float:
    """Speed (m/s) about a time (s)."""
    columns = track.columns
    near = np.abs(columns["time"] - time) <= 0.5 * SMOOTHING
    return float(columns["speed"][near].mean()) if near.any() else float(np.interp(time, columns["time"], columns["speed"]))
