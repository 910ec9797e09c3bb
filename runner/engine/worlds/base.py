"""Contract of a world (a simulator), and the worlds without one: `KinematicWorld`,
`RehearsalWorld`.

The interpreter owns every scripted participant and shows the world where it is (`mirror`);
participants that the world's own driver moves (`Controls.world_driven`) are read back (`read`). A
world knows nothing of storyboards.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple, Protocol

from runner.engine.participants.entity import Entity
from xodr.graph.network import RoadNetwork


class WorldState(NamedTuple):
    """State of a participant that the world moves: reference point (m), heading (rad), speed (m/s),
    in the plane."""

    x: float
    y: float
    h: float
    speed: float


class DriverRequest(NamedTuple):
    """Request to the world's own driver of an entity.

    Args:
        speed: its desired speed (m/s) where nothing is in its way; None for what the world thinks
            usual there.
        exact: it has that speed whatever is in its way.
        lane_changes: the driver may change lanes.
    """

    speed: float | None = None
    exact: bool = False
    lane_changes: bool = True


class World(Protocol):
    """A simulator that participants live in."""

    name: str

    def open(self, network: RoadNetwork | None, timestep: float, seed: int) -> str:
        """Load the road network and stand at time 0; says what the user should know of it, if
        anything."""
        ...

    def add(self, entity: Entity) -> None:
        """Bring a participant into the world at its present pose."""
        ...

    def remove(self, entity: Entity) -> None:
        """Take a participant out of the world; nothing happens where it has left already."""
        ...

    def drive(self, entity: Entity) -> bool:
        """Hand a participant to the world's own driver for the coming step, at its present pose and
        speed.

        False where the driver can't drive there (no lane of its kind, or it faces against the
        traffic). A participant that is driven already is put to its present pose.
        """
        ...

    def release(self, entity: Entity) -> None:
        """Take a participant back from the world's own driver."""
        ...

    def ask(self, entity: Entity, request: DriverRequest) -> None:
        """Ask something of the world's own driver of a participant; holds until asked anew."""
        ...

    def show(self, entity: Entity, visible: bool) -> None:
        """Let the world's own drivers see a scripted participant, or not (VisibilityAction,
        traffic)."""
        ...

    def signal(self, signal_id: str, state: str) -> bool:
        """Show the world's own drivers a traffic signal's state, as the scenario writes it; false
        if not understood."""
        ...

    def mirror(self, entities: Iterable[Entity]) -> None:
        """Show the world where scripted participants are at the end of the coming step."""
        ...

    def step(self) -> None:
        """Advance by one time step."""
        ...

    def read(self, entity: Entity) -> WorldState | None:
        """State of a driven participant; None once it has left the world."""
        ...

    def close(self) -> None:
        """Free the simulator."""
        ...


class KinematicWorld:
    """World without participants of its own: the interpreter's motion is all there is."""

    name = "kinematic"

    def open(self, network: RoadNetwork | None, timestep: float, seed: int) -> str:
        """Do nothing: there is no simulator to load."""
        return ""

    def add(self, entity: Entity) -> None:
        """Do nothing: entities have no copy."""

    def remove(self, entity: Entity) -> None:
        """Do nothing: entities have no copy."""

    def drive(self, entity: Entity) -> bool:
        """Refused: there is no driver here."""
        raise entity.declared.unsupported(
            f"the kinematic world has no driver of its own for {entity.name!r}; run on SUMO"
        )

    def release(self, entity: Entity) -> None:
        """Do nothing: entities have no copy."""

    def ask(self, entity: Entity, request: DriverRequest) -> None:
        """Do nothing: no driver could act on the request."""

    def show(self, entity: Entity, visible: bool) -> None:
        """Do nothing: no traffic of this world sees entities."""

    def signal(self, signal_id: str, state: str) -> bool:
        """Return True: no traffic of this world obeys signals."""
        return True

    def mirror(self, entities: Iterable[Entity]) -> None:
        """Do nothing: no traffic of this world sees entities."""

    def step(self) -> None:
        """Do nothing: the interpreter keeps the time."""

    def read(self, entity: Entity) -> WorldState | None:
        """Return None: this world drives no entity."""
        return None

    def close(self) -> None:
        """Do nothing: there is nothing to free."""


class RehearsalWorld(KinematicWorld):
    """World for the start of a run: it makes no step, so entities may wait for their drivers."""

    def drive(self, entity: Entity) -> bool:
        """No one is driven yet."""
        return True
