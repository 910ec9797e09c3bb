"""SUMO as the world, begun when there is somebody whom it drives.

Participants that the scenario moves are mirrored into SUMO for its drivers to see them; nothing comes back to them. While SUMO
drives no one, it would be stepped for nobody, so what is shown to it is kept, and SUMO begins with the first participant that
it is to drive: it goes through all that was kept, in the same order, and is then in the state in which it would have been. A long
run, of which too much would have to be kept, begins SUMO as well.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from operator import methodcaller
from typing import TYPE_CHECKING, Any, ClassVar

from runner.worlds.sumo_lights import link_state
from schemas.errors import Unsupported, UsageError
from xodr import sumo_net

if TYPE_CHECKING:
    from runner.participants.entity import Entity
    from runner.worlds.base import DriverRequest, Reading
    from runner.worlds.sumo_simulation import SumoSimulation
    from xodr.network import RoadNetwork

_STEP = methodcaller("step")
_MOST = 300_000
"""Places that are kept at most, about 60 MB; then SUMO begins"""


class SumoWorld:
    """A SUMO simulation on the network derived from the scenario's road file.

    Attributes:
        simulation: SUMO, once it drives or has driven somebody.
    """

    name = "sumo"
    _present: ClassVar[SumoWorld | None] = None
    """the one that is open in this process"""

    def __init__(self) -> None:
        self.simulation: SumoSimulation | None = None
        self._kept: list[Callable[[Any], object]] = []
        """what SUMO has been shown so far, in order"""
        self._places = 0
        """places of participants among it"""

    def open(self, network: RoadNetwork | None, timestep: float, seed: int) -> str:
        """Have SUMO's network ready (nothing but the dock where there is no road).

        Raises:
            UsageError: a run on SUMO is open in this process.
        """
        if SumoWorld._present is not None:
            raise UsageError("a run on SUMO is open in this process, which can hold one: close it, or use world=kinematic")
        self._net = sumo_net.build(network.path if network is not None else None)
        self._network, self._timestep, self._seed = network, timestep, seed
        SumoWorld._present = self
        return f"SUMO's drivers have no roads: {self._net.fallback}" if self._net.fallback else ""

    def begin(self) -> SumoSimulation:
        """SUMO in the state of now.

        Raises:
            UsageError: another simulation is open in this process.
            ToolchainError: SUMO does not start, or can't go on.
        """
        if self.simulation is None:
            from runner.worlds.sumo_simulation import SumoSimulation

            self.simulation = SumoSimulation(self._network, self._net, self._timestep, self._seed)
            for show in self._kept:
                show(self.simulation)
            self._kept.clear()
        return self.simulation

    def close(self) -> None:
        """End SUMO."""
        if SumoWorld._present is self:
            SumoWorld._present = None
        self._kept.clear()
        if self.simulation is not None:
            self.simulation.close()
            self.simulation = None

    # what SUMO's drivers see ----------------------------------------------------------------

    def _show(self, method: str, *arguments: object) -> None:
        """Call a method of the simulation, now or when it begins."""
        call = methodcaller(method, *arguments)
        if self.simulation is None:
            self._kept.append(call)
        else:
            call(self.simulation)

    def add(self, entity: Entity) -> None:
        """Bring a participant to the dock; the coming step moves it to its place."""
        if entity.visible["traffic"]:
            self._show("add", entity)

    def remove(self, entity: Entity) -> None:
        """Take a participant out of SUMO, if it is still there."""
        self._show("remove", entity)

    def show(self, entity: Entity, visible: bool) -> None:
        """Add a scripted participant, or remove it."""
        if self.simulation is not None and self.simulation.drives(entity):
            if not visible:
                raise Unsupported(f"{entity.name!r} is driven by SUMO and can't be hidden from SUMO's traffic")
        elif not visible:
            self.remove(entity)
        elif entity.active and entity.placed:
            self.add(entity)

    def signal(self, signal_id: str, state: str) -> bool:
        """Show SUMO's traffic a signal's state."""
        self._show("signal", signal_id, state)
        return link_state(state) is not None or not self._net.signals.get(signal_id)

    def mirror(self, entities: Iterable[Entity]) -> None:
        """Move scripted participants to where they are at the end of the coming step."""
        places = [(entity, entity.x, entity.y, entity.h) for entity in entities]
        if self.simulation is None:
            self._kept.append(methodcaller("move", places))
            self._places += len(places)
            if self._places > _MOST:
                self.begin()
        else:
            self.simulation.move(places)

    def step(self) -> None:
        """Advance SUMO."""
        if self.simulation is None:
            self._kept.append(_STEP)
        else:
            self.simulation.step()

    # SUMO's drivers -------------------------------------------------------------------------

    def drive(self, entity: Entity) -> bool:
        """Hand a participant to SUMO's driver where SUMO has a lane for it."""
        return self.begin().drive(entity)

    def release(self, entity: Entity) -> None:
        """Take a participant back; it is mirrored again."""
        if self.simulation is not None:
            self.simulation.release(entity)

    def ask(self, entity: Entity, request: DriverRequest) -> None:
        """Set desired speed and permission to change lanes; speed limits hold only where no speed is asked for."""
        self.begin().ask(entity, request)

    def read(self, entity: Entity) -> Reading | None:
        """State of a participant that SUMO drives; None once it has left at the end of its route."""
        return self.simulation.read(entity) if self.simulation is not None else None
