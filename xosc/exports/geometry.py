"""What exports know of a scenario only with its roads: where everybody starts, where positions are, which way routes lead."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple, Protocol

from xosc.exports.starts import Start
from xosc.node import Node


class Place(NamedTuple):
    """A pose in the world (m, rad), and the time (s) of a vertex that has one. h: None where it is that of the way."""

    x: float
    y: float
    z: float
    h: float | None = None
    time: float | None = None


class Geometry(Protocol):
    """A scenario on its roads."""

    def starts(self) -> Mapping[str, Start]:
        """How everybody starts who is there at the beginning, by name."""
        ...

    def place(self, position: Node) -> Place | None:
        """Where an element Position is; None where that depends on what happens."""
        ...

    def track(self, trajectory: Node, skip: float = 0.0, actor: str | None = None) -> Sequence[Place] | None:
        """Vertices that stand for a Trajectory from a distance (m) on; None where it depends on what happens.

        Args:
            actor: whose frame, when it starts, the places are in; None for the world.
        """
        ...

    def way(self, action: Node, entity: str) -> Sequence[Place]:
        """The way along lanes that a routing action leads an entity from its start; empty where it takes that way anyway.

        Raises:
            Unsupported: it does not start on a lane, or the way depends on what happens.
        """
        ...
