"""What exports know of a scenario only with its roads: where everybody starts, where positions are, which way routes lead."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple, Protocol

from xosc.exports.on_roads.starts import Start
from xosc.node import Node


class Place(NamedTuple):
    """A pose in the world (m, rad), and the time (s) of a vertex that has one. h: None where it is that of the way."""

    x: float
    y: float
    z: float
    h: float | None = None
    time: float | None = None


Pose = tuple[float, float, float, float]
"""x, y, z (m) and heading (rad)."""


class Geometry(Protocol):
    """A scenario on its roads."""

    def starts(self) -> Mapping[str, Start]:
        """How everybody starts who is there at the beginning, by name."""
        ...

    def begins(self, element: Node) -> float | None:
        """When (s) an element of the storyboard first begins, in a run without a system under test; None where it doesn't."""
        ...

    def ends(self, element: Node) -> float | None:
        """When (s) the step is over in which an element first ends in that run; None where it doesn't, or others end it."""
        ...

    def driven(self, entity: str, begin: float, end: float) -> Sequence[Place]:
        """Where an entity is at each step of that run from a time (s) until another; times count from the first."""
        ...

    def during(self, action: Node, entity: str) -> Start | None:
        """How an entity is when an action of a story begins; None where it doesn't begin, or the entity is not there.

        It is so in a run without a system under test.
        """
        ...

    def put(self, action: Node, entity: str) -> Place | None:
        """Where an action puts an entity at once in that run; None where it doesn't begin."""
        ...

    def direction(self, road: str, lane: int) -> int:
        """1 where the traffic of a lane drives towards greater s, else −1.

        Raises:
            InvalidFile: there is no such road.
        """
        ...

    def place(self, position: Node) -> Place | None:
        """Where an element Position is; None where that depends on what happens."""
        ...

    def track(
        self, trajectory: Node, skip: float = 0.0, actor: str | None = None, pose: Pose = (0.0, 0.0, 0.0, 0.0)
    ) -> Sequence[Place] | None:
        """Vertices that stand for a Trajectory from a distance (m) on; None where it depends on what happens.

        Args:
            actor: who follows it; None leaves out trajectories that begin where their actor is.
            pose: where the actor is then; the default gives places in the actor's frame.
        """
        ...

    def way(self, action: Node, entity: str) -> Sequence[Place]:
        """The way along lanes that a routing action leads an entity from its start; empty where it takes that way anyway.

        Raises:
            Unsupported: it does not start on a lane, or the way depends on what happens.
        """
        ...
