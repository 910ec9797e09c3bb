"""Parameters of manoeuvres with their ranges, and units of manoeuvres."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

ABSENT = -1
"""Index of an absent track or row; `recognition.labels.scene`, which has it too, needs numpy, and
commands start without"""


@dataclass(frozen=True)
class Parameter:
    """A parameter with its range.

    Attributes:
        name: of its ParameterDeclaration; in `PARAMETERS` without the participant's name in front.
        low, high: least and greatest value, both allowed.
        unit: m, mps, s, ...; empty where the name does not say.
        meaning: one line for people; empty where it is not one of `PARAMETERS`.
    """

    name: str
    low: float
    high: float
    unit: str = ""
    meaning: str = ""


PARAMETERS: Mapping[str, Parameter] = {
    "gap": Parameter("Gap_m", 5.0, 80.0, "m", "gap to the lead when the manoeuvre begins"),
    "start_speed": Parameter(
        "StartSpeed_mps", 10.0, 40.0, "mps", "speed when the manoeuvre begins"
    ),
    "start_time": Parameter(
        "StartTime_s", 0.0, 10.0, "s", "from the scene's start to the manoeuvre's"
    ),
    "end_speed": Parameter("EndSpeed_mps", 10.0, 40.0, "mps", "speed when the manoeuvre ends"),
    "duration": Parameter("Duration_s", 1.0, 8.0, "s", "of the manoeuvre"),
    "final_speed": Parameter("FinalSpeed_mps", 10.0, 40.0, "mps", "speed when the scene ends"),
    "rest_time": Parameter("RestTime_s", 0.0, 10.0, "s", "from the manoeuvre's end to the scene's"),
}
"""The parameters by role, in the order of every array of them."""
JERK = "jerk"
"""Role of an eighth one, which few scenarios declare."""
DECLARED: Mapping[str, Parameter] = {
    **PARAMETERS,
    JERK: Parameter(
        "Jerk_mps3", 0.1, 15.0, "mps3", "rate at which the acceleration of the manoeuvre builds up"
    ),
}
"""All that scenarios may declare, by role; jerk up to what vehicles can do
(`recognition.recordings.motion.observations`)."""
EGO_SPEED, OTHER_SPEED = "EgoSpeed_mps", "OtherSpeed_mps"
"""Parameter names, in scenarios of catalogues, of the other vehicle's speed, by that vehicle's
role."""


class Values(NamedTuple):
    """Values of the parameters, by role.

    Attributes:
        gap: of the boxes to the leader, m; in a passage, from the other one's front to the conflict
            point; None without another.
        start_speed, end_speed, final_speed: m/s.
        start_time, duration, rest_time: s.
    """

    gap: float | None
    start_speed: float
    start_time: float
    end_speed: float
    duration: float
    final_speed: float
    rest_time: float

    @property
    def named(self) -> dict[str, float]:
        """Return the known values by the names of their declarations."""
        return {
            PARAMETERS[role].name: value
            for role, value in self._asdict().items()
            if value is not None
        }


def declared_name(participant: str, role: str) -> str:
    """Name of the declaration of a participant's parameter, `CutIn_Gap_m` for example."""
    return f"{participant}_{DECLARED[role].name}"


BRAKING, ACCELERATION, LANE_CHANGE, CUT_IN, CUT_OUT = KINDS = (
    "braking",
    "acceleration",
    "lane_change",
    "cut_in",
    "cut_out",
)
"""Kinds of units."""


@dataclass(frozen=True)
class Unit:
    """A manoeuvre. Rows are those of the actor.

    Attributes:
        kind: one of `KINDS`.
        actor: index of the track that the parameters describe.
        other: of the track behind it that is the scenario's ego; in a lane change, where the actor
            is the ego, of the leader; `ABSENT` without another.
        start, end: rows of the manoeuvre's first and last instant.
        first, last: rows where the unit's scene begins and ends.
        shift: lateral distance of the lane change, m, to the left; 0 for none.
    """

    kind: str
    actor: int
    other: int
    start: int
    end: int
    first: int
    last: int
    shift: float = 0.0

    @property
    def alone(self) -> bool:
        """Whether there is no other."""
        return self.other == ABSENT


APART = 2.0
"""Gap (m) at the scene's start between two in one lane, at least"""
STILL = 0.001
"""Least speed (m/s) to divide by"""
