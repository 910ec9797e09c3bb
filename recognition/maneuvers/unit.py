"""What a recording is cut into."""

from __future__ import annotations

from dataclasses import dataclass

from recognition.labels.scene.leads import ABSENT

BRAKING, ACCELERATION, LANE_CHANGE, CUT_IN, CUT_OUT = KINDS = ("braking", "acceleration", "lane_change", "cut_in", "cut_out")
"""Kinds of units."""


@dataclass(frozen=True)
class Unit:
    """A manoeuvre. Rows are those of the actor.

    Attributes:
        kind: one of `KINDS`.
        actor: index of the track that the parameters describe.
        other: of the track behind it that is the scenario's ego; in a lane change, where the actor is the ego, of the leader;
            `ABSENT` without another.
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
