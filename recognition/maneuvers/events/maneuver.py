"""What a manoeuvre is: who takes part, and seven numbers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from recognition.maneuvers.events.paths import RecordedPath
from recognition.maneuvers.parameters import Values
from runner.recording import Track

LONGEST = 10.0
"""Time (s) from the scene's start to the manoeuvre, and from its end to the scene's, at most."""
SHORTEST = 1.0
"""Duration (s) of a manoeuvre, at least"""
EGO_ACTS = ("lane_change", "cruise", "ramp", "passage")
"""Kinds of manoeuvres whose actor is the ego"""


class Conflict(NamedTuple):
    """Where the way of another one meets the ego's.

    Attributes:
        other: its track.
        course: its way.
        x, y: the place, m.
        reach: how far along its course the reference point of the other one is when its front is there, m.
        time: when that was, s.
    """

    other: Track
    course: RecordedPath
    x: float
    y: float
    reach: float
    time: float


class SpeedChange(NamedTuple):
    """How one goes on: to which speed (m/s), reached evenly within which time (s)."""

    speed: float
    duration: float


class Passage(NamedTuple):
    """A manoeuvre that has its place.

    Attributes:
        course: the ego's way.
        begins: how far along it the manoeuvre begins, m.
        meeting: with the way of another one, and `onwards` how that one goes on from there; None where there is nobody.
    """

    course: RecordedPath
    begins: float
    meeting: Conflict | None = None
    onwards: SpeedChange | None = None

    @classmethod
    def of(cls, course: RecordedPath, time: float) -> Passage:
        """That of an ego on its way whose manoeuvre begins where it is at a time (s), without anybody else."""
        return cls(course, float(course.at(time)))

    def longest(self, speed: float) -> float:
        """How long (s) the ego drives at a speed (m/s) from where its way begins to its manoeuvre, at most `LONGEST`."""
        return min(LONGEST, self.begins / speed) if speed > 0.0 else LONGEST


@dataclass(frozen=True)
class Maneuver:
    """A manoeuvre.

    Attributes:
        kind: cut_in, cut_out, lane_change, following, cruise, ramp (a lane change at one) or passage.
        ego: its track.
        other: who is ahead of the ego when it begins, in a passage whose way the ego's meets; None for nobody.
        left: whether the lane change is to the left; None where there is none.
        values: the parameters.
        speed: of the one who is not the actor, before the manoeuvre, m/s.
        start, end: of the scene, in the recording, s.
        passage: the place, in a passage and at ramps; None for a manoeuvre that may be anywhere on its road. In a passage those
            who take part keep to the ways that were recorded, elsewhere to lanes.
    """

    kind: str
    ego: Track
    other: Track | None
    left: bool | None
    values: Values
    speed: float
    start: float
    end: float
    passage: Passage | None = None

    @property
    def ego_acts(self) -> bool:
        """Whether the ego is the actor."""
        return self.kind in EGO_ACTS


class Span(NamedTuple):
    """An event's start, middle and end, s."""

    start: float
    middle: float
    end: float
