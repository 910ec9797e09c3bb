"""What a manoeuvre is: who takes part, the values of its parameters, its place."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from recognition.maneuvers.events.paths import RecordedPath
from recognition.maneuvers.parameters import PARAMETERS, Values
from recognition.maneuvers.scenario.terms import APART, STILL
from runner.recording import Track

LONGEST = PARAMETERS["start_time"].high
"""Time (s) from the scene's start to the manoeuvre, and from its end to the scene's, at most."""
SHORTEST = PARAMETERS["duration"].low
"""Duration (s) of a manoeuvre, at least"""
EGO_ACTS = ("lane_change", "cruise", "ramp", "passage")
"""Kinds of manoeuvres whose actor is the ego"""


class Conflict(NamedTuple):
    """Where the path of another one meets the ego's.

    Attributes:
        other: its track.
        path: its path.
        x, y: the place, m.
        reach: how far along its path the reference point of the other one is when its front is there, m.
        time: when that was, s.
    """

    other: Track
    path: RecordedPath
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
        path: the ego's.
        begin: how far along it the manoeuvre begins, m.
        conflict: with the path of another one, and `continuation` how that one goes on from there; None without another one.
    """

    path: RecordedPath
    begin: float
    conflict: Conflict | None = None
    continuation: SpeedChange | None = None

    @classmethod
    def of(cls, path: RecordedPath, time: float) -> Passage:
        """That of an ego on its way whose manoeuvre begins where it is at a time (s), without another participant."""
        return cls(path, float(path.at(time)))

    def longest(self, speed: float) -> float:
        """How long (s) the ego drives at a speed (m/s) from where its way begins to its manoeuvre, at most `LONGEST`."""
        return min(LONGEST, self.begin / speed) if speed > 0.0 else LONGEST


@dataclass(frozen=True)
class Maneuver:
    """A manoeuvre.

    Attributes:
        kind: cut_in, cut_out, lane_change, following, cruise, ramp (a lane change at one) or passage.
        ego: its track.
        other: who is ahead of the ego when it begins, in a passage whose path the ego's meets; None without another one.
        left: whether the lane change is to the left; None without a lane change.
        values: of the parameters.
        speed: of the one who is not the actor, before the manoeuvre, m/s.
        begin: when it begins, in the recording, s.
        approach: how long before that the one who is not the actor was recorded in its lane, s, at most `LONGEST`.
        passage: the place, in a passage and at ramps; None for a manoeuvre that may be anywhere on its road. In a passage those
            who take part keep to the paths that were recorded, elsewhere to lanes.
    """

    kind: str
    ego: Track
    other: Track | None
    left: bool | None
    values: Values
    speed: float
    begin: float
    approach: float = LONGEST
    passage: Passage | None = None

    @property
    def ego_acts(self) -> bool:
        """Whether the ego is the actor."""
        return self.kind in EGO_ACTS

    @property
    def in_one_lane(self) -> bool:
        """Whether the other one is ahead in the ego's own lane before the manoeuvre begins."""
        return self.other is not None and self.kind not in ("cut_in", "passage")

    @property
    def delay(self) -> float:
        """Time from the scene's start to the manoeuvre, s: the start time, as far as everyone can keep a speed until then."""
        delay = min(self.values.start_time, self.approach)
        if self.passage is not None:
            delay = min(delay, self.passage.longest(self.values.start_speed))
        if self.in_one_lane and self.values.gap is not None:
            opening = (self.speed - self.values.start_speed) * (1.0 if self.ego_acts else -1.0)
            delay = min(delay, max(self.values.gap - APART, 0.0) / max(opening, STILL))
        return delay

    @property
    def start(self) -> float:
        """When the scene starts, in the recording, s."""
        return self.begin - self.delay

    @property
    def end(self) -> float:
        """When the scene ends, in the recording, s."""
        return self.begin + self.values.duration + self.values.rest_time


class Span(NamedTuple):
    """An event's start, middle and end, s."""

    start: float
    middle: float
    end: float
