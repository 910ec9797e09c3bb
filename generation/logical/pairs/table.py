"""The logical scenarios of two adversaries at once: who they are, and what recorded units they are."""

from __future__ import annotations

from dataclasses import dataclass

from recognition.maneuvers.unit import BRAKING, CUT_IN


@dataclass(frozen=True)
class Part:
    """What one of two adversaries does.

    Attributes:
        actor: its name. lane: of the geometry's road, where it begins. change: lanes to the left that it changes.
        kind: of recorded units that are such manoeuvres.
    """

    actor: str
    lane: int
    change: int
    kind: str


@dataclass(frozen=True)
class Follower:
    """An adversary who drives behind the ego and keeps its distance, as fast as its reaction and its brakes let it.

    Attributes:
        actor: its name.
    """

    actor: str


@dataclass(frozen=True)
class Pair:
    """Two adversaries around the ego.

    Attributes:
        description: what happens.
        ego_lane: where the ego drives.
        first: the one who acts ahead of the ego, the nearer one of two. second: the one ahead of that, or behind the ego.
    """

    description: str
    ego_lane: int
    first: Part
    second: Part | Follower

    @property
    def parts(self) -> tuple[Part, ...]:
        """What is done ahead of the ego."""
        return (self.first,) if isinstance(self.second, Follower) else (self.first, self.second)

    @property
    def actors(self) -> tuple[str, str]:
        """Names of the two."""
        return self.first.actor, self.second.actor


PAIRS = {
    "cut_in_before_braking_leader": Pair(
        "A vehicle cuts in from the left in front of the ego, behind a leader that brakes",
        -2, Part("CutIn", -1, -1, CUT_IN), Part("Lead", -2, 0, BRAKING),
    ),
    "squeezed": Pair(
        "Two vehicles cut in in front of the ego, from the left and from the right",
        -2, Part("Left", -1, -1, CUT_IN), Part("Right", -3, 1, CUT_IN),
    ),
    "merge_beside_tail_gater": Pair(
        "A vehicle merges from the right in front of the ego, behind which a tail-gater drives",
        -2, Part("Merging", -3, 1, CUT_IN), Follower("TailGater"),
    ),
}  # fmt: skip
"""By name."""
