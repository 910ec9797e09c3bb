"""SUMO as the world, started with the first entity that it drives.

Entities that the scenario moves are mirrored into SUMO, where its drivers see them; SUMO does not
move them. As long as SUMO drives no entity, its commands are stored instead of executed. SUMO
starts with the first entity that it drives: it executes the stored commands in order and reaches
the same state. Of a long run only the latest positions are stored; SUMO steps without entities up
to these.
"""

from __future__ import annotations

from array import array
from collections.abc import Iterable
from typing import TYPE_CHECKING, ClassVar, NamedTuple

from runner.engine.worlds.sumo_translation import link_state
from schemas.common.errors import Unsupported, UsageError
from xodr.formats import sumo_net

if TYPE_CHECKING:
    from runner.engine.participants.entity import Entity
    from runner.engine.worlds.base import DriverRequest, WorldState
    from runner.engine.worlds.sumo_simulation import SumoSimulation
    from xodr.graph.network import RoadNetwork

_MOST = 300_000
"""Places that are kept at most, 24 bytes each; the older half of the calls is forgotten above that
"""


class _Call(NamedTuple):
    """A call of a method of the simulation that was kept."""

    method: str
    arguments: tuple[object, ...] = ()


_STEP = _Call("step")


class _StepPoses(NamedTuple):
    """Participants at the end of a step, with a flat list of x, y (m) and heading (rad) of each."""

    entities: tuple[Entity, ...]
    numbers: array[float]


class _PendingCommands:
    """Commands for SUMO before it starts, in order."""

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        """Forget all."""
        self._calls: list[_Call | _StepPoses] = []
        self._size = 0
        """places of participants among these"""
        self._steps = 0
        """steps before these"""
        self._signals: dict[object, _Call] = {}
        self._present: dict[object, _Call] = {}
        """signals and participants as they were before these"""

    def add(self, call: _Call) -> None:
        """Keep a call."""
        self._calls.append(call)

    def mirror(self, entities: tuple[Entity, ...]) -> None:
        """Keep the places of participants at the end of the coming step."""
        self._calls.append(
            _StepPoses(
                entities,
                array(
                    "d", [value for entity in entities for value in (entity.x, entity.y, entity.h)]
                ),
            )
        )
        self._size += len(entities)
        if self._size > _MOST:
            self._forget()

    def _forget(self) -> None:
        half = len(self._calls) // 2
        for call in self._calls[:half]:
            if isinstance(call, _StepPoses):
                self._size -= len(call.entities)
            elif call.method == "step":
                self._steps += 1
            elif call.method == "remove":
                self._present.pop(call.arguments[0], None)
            else:
                (self._present if call.method == "add" else self._signals)[call.arguments[0]] = call
        del self._calls[:half]

    def show(self, simulation: SumoSimulation) -> None:
        """Show it all to SUMO."""
        before = [*[_STEP] * self._steps, *self._signals.values(), *self._present.values()]
        for call in (*before, *self._calls):
            if isinstance(call, _StepPoses):
                x, y, h = (call.numbers[start::3] for start in range(3))
                simulation.move(zip(call.entities, x, y, h, strict=True))
            else:
                getattr(simulation, call.method)(*call.arguments)
        self.clear()


class SumoWorld:
    """A SUMO simulation on the network derived from the scenario's road file.

    Attributes:
        simulation: SUMO, once it drives or has driven an entity.
    """

    name = "sumo"
    _present: ClassVar[SumoWorld | None] = None
    """the one that is open in this process"""

    def __init__(self) -> None:
        self.simulation: SumoSimulation | None = None
        self._kept = _PendingCommands()

    def open(self, network: RoadNetwork | None, timestep: float, seed: int) -> str:
        """Have SUMO's network ready (nothing but the dock where there is no road).

        Raises:
            UsageError: a run on SUMO is open in this process.
        """
        if SumoWorld._present is not None:
            raise UsageError(
                "a run on SUMO is open in this process, which can hold one: close it, or use "
                "world=kinematic"
            )
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
            from runner.engine.worlds.sumo_simulation import SumoSimulation

            self.simulation = SumoSimulation(self._network, self._net, self._timestep, self._seed)
            self._kept.show(self.simulation)
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
        if self.simulation is None:
            self._kept.add(_Call(method, arguments))
        else:
            getattr(self.simulation, method)(*arguments)

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
                raise Unsupported(
                    f"{entity.name!r} is driven by SUMO and can't be hidden from SUMO's traffic"
                )
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
        if self.simulation is None:
            self._kept.mirror(tuple(entities))
        else:
            self.simulation.move((entity, entity.x, entity.y, entity.h) for entity in entities)

    def step(self) -> None:
        """Advance SUMO."""
        if self.simulation is None:
            self._kept.add(_STEP)
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
        """Set desired speed and permission to change lanes; speed limits hold only where no speed
        is asked for."""
        self.begin().ask(entity, request)

    def read(self, entity: Entity) -> WorldState | None:
        """State of a participant that SUMO drives; None once it has left at the
        end of its route.
        """
        return self.simulation.read(entity) if self.simulation is not None else None
