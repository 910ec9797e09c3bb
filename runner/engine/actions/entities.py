"""Entities that come, go, are put somewhere else, and are coupled (EntityAction, TeleportAction,
TrailerAction)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from runner.engine.compile import registry
from runner.engine.compile.array_protocols import ArrayProcess
from runner.engine.compile.element import GlobalAction, PrivateAction
from runner.engine.compile.registry import action
from runner.engine.participants.entity import Entity
from runner.engine.participants.trailers import connect, disconnect, train
from xosc.document.node import Node

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from runner.engine.compile.array_protocols import ArrayRun
    from runner.engine.compile.element import Position
    from runner.engine.compile.protocols import Run
    from runner.engine.compile.registry import Context
    from runner.engine.motion.placement import Placement
    from runner.engine.participants.rows import EntityRows
    from schemas.common.array_types import BoolArray


def _entity(node: Node, context: Context) -> Entity:
    above = node.parent
    assert above is not None
    return context.entity(above)


_TILT = "xosc.toolchain:xosc:1.0.0:positioning.surface_while_driving"


def _position(node: Node, context: Context) -> Position:
    """The position of an action, with a remark on angles that it has only while
    the entity stands.
    """
    holder = node.need("Position")
    tilted = next((node for node in holder.iter() if node.has("p") or node.has("r")), None)
    if (
        context.network is not None
        and tilted is not None
        and (tilted.finite("p", 0.0) or tilted.finite("r", 0.0))
    ):
        text = (
            "pitch and roll hold while the entity stands; while it drives along a lane, "
            "they are those of the road's surface"
        )
        context.remarks.note(tilted.remark(_TILT, text))
    return context.position(holder)


@action("AddEntityAction")
@dataclass(frozen=True, slots=True)
class AddEntityAction(GlobalAction):
    """Brings a declared entity into the world at a position; nothing happens where it is there
    already.

    It drives at the speed that it was last asked for: before it was deleted, or by an initial
    SpeedAction; else it stands.
    """

    entity: Entity
    position: Position

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> AddEntityAction:
        """Build from an AddEntityAction element."""
        return cls(_entity(node, context), _position(node, context))

    def puts(self) -> Iterable[tuple[Entity, Position | None]]:
        """The position."""
        return [(self.entity, self.position)]

    def references(self) -> Iterable[Entity]:
        """Entities that the position is relative to."""
        return self.position.references()

    def start(self, run: Run) -> None:
        """Add at once."""
        if self.entity.active and self.entity.placed:
            run.note("entity", self.entity.name, "is in the scenario already")
            return
        run.activate(self.entity, self.position.resolve(run, self.entity))
        run.note("entity", self.entity.name, "added")


@action("DeleteEntityAction")
@dataclass(frozen=True, slots=True)
class DeleteEntityAction(GlobalAction):
    """Takes an entity out of the world; its actions end with it."""

    entity: Entity

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> DeleteEntityAction:
        """Build from a DeleteEntityAction element."""
        return cls(_entity(node, context))

    def start(self, run: Run) -> None:
        """Delete at once."""
        if self.entity.active:
            run.deactivate(self.entity)
            run.note("entity", self.entity.name, "deleted")


@registry.action("TeleportAction")
class TeleportAction(PrivateAction):
    """Puts the actor at a position at once; it keeps its speed."""

    def __init__(self, position: Position) -> None:
        self.position = position

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> TeleportAction:
        """Read the position."""
        return cls(_position(node, context))

    @property
    def places(self) -> bool:
        """Return true: the action places the entity."""
        return True

    def puts(self, actor: Entity) -> Iterable[tuple[Entity, Position | None]]:
        """The position."""
        return [(actor, self.position)]

    def references(self) -> Iterable[Entity]:
        """Entities that the position is relative to."""
        return self.position.references()

    def start(self, actor: Entity, run: Run) -> None:
        """Jump."""
        run.place(actor, self.position.resolve(run, actor))

    def in_arrays(self, actor: EntityRows, run: ArrayRun) -> ArrayProcess:
        """The same, in many runs."""
        return _Teleport(self.position, actor, run)


class _Teleport(ArrayProcess):
    """A teleport in many runs."""

    def __init__(self, position: Position, actor: EntityRows, run: ArrayRun) -> None:
        super().__init__(run)
        self._position, self._actor, self._run = position, actor, run

    def start(self, rows: BoolArray) -> BoolArray:
        """Jump: once where the position is the same in all runs or differs by s alone, else run by
        run."""
        run, actor, position = self._run, self._actor, self._position
        rows = rows & run.going

        def put(entity: Entity, row: int) -> None:
            there = position.at_set(int(run.sets[row]))
            run.doubtful[row] |= there.repaired
            run.single.place(entity, there.resolve(run.single, entity))

        free = rows & actor.unled
        if not free.any():
            run.one_by_one(actor, rows, position.references(), put)
            return np.zeros_like(rows)
        first = int(np.argmax(free))
        run.one_by_one(actor, np.arange(run.n) == first, position.references(), put)
        there = np.zeros_like(rows)
        if position.fixed is not None and run.going[first]:
            there = free
            actor.copy(first, there)
        elif (s := position.stations(run, first, {})) is not None and run.going[first]:
            there = actor.spread(first, free, s)
        run.doubtful |= there & run.doubtful[first]
        run.relocated(actor, there)
        there[first] = True
        run.one_by_one(actor, rows & ~there, position.references(), put)
        return np.zeros_like(rows)


@registry.action("ConnectTrailerAction")
class ConnectTrailerAction(PrivateAction):
    """Puts a trailer's coupler on the actor's hitch; the trailer is moved there where it stands
    elsewhere."""

    def __init__(self, node: Node, trailer: Entity, lasting: bool) -> None:
        self.node, self.trailer = node, trailer
        self.lasting = lasting

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> ConnectTrailerAction:
        """Read the reference."""
        trailer = context.entity(node, "trailerRef")
        if trailer.declared.coupler is None:
            raise node.invalid(f"{trailer.name!r} has no TrailerCoupler, so it can't be towed")
        return cls(
            node, trailer, next(context.document.node.iter("DisconnectTrailerAction"), None) is None
        )

    def references(self) -> Iterable[Entity]:
        """The trailer."""
        return (self.trailer,)

    def check(self, actor: Entity, starts: Sequence[Placement] | None) -> None:
        """Require a hitch, and no trailer that is connected from the start and
        never disconnected.
        """
        if actor.declared.hitch is None:
            raise self.node.invalid(f"{actor.name!r} has no TrailerHitch, so it can't tow")
        if self.lasting:
            self._check_free(actor)

    def start(self, actor: Entity, run: Run) -> None:
        """Connect."""
        self.check(actor, None)
        self._check_free(actor)
        trailer = self.trailer
        if actor.controls.trailer is trailer:
            return
        run.end_actions(trailer, f"{trailer.name} is towed by {actor.name}")
        connect(run.roads, actor, trailer)

    def _check_free(self, actor: Entity) -> None:
        """Neither the hitch nor the coupler may hold another vehicle now."""
        trailer = self.trailer
        if actor.controls.trailer is trailer:
            return
        if actor.controls.trailer is not None:
            raise self.node.invalid(f"{actor.name!r} tows {actor.controls.trailer.name!r} already")
        if trailer.controls.tractor is not None:
            raise self.node.invalid(
                f"{trailer.name!r} is towed by {trailer.controls.tractor.name!r} already"
            )
        if actor in train(trailer):
            raise self.node.invalid(
                f"{trailer.name!r} can't be towed by {actor.name!r}, which it tows itself"
            )


@registry.action("DisconnectTrailerAction")
class DisconnectTrailerAction(PrivateAction):
    """Takes the actor's trailer off its hitch; the trailer stays where it is, standing."""

    def __init__(self, node: Node) -> None:
        self.node = node

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> DisconnectTrailerAction:
        """Build the action; its element has no attributes."""
        return cls(node)

    def start(self, actor: Entity, run: Run) -> None:
        """Disconnect."""
        if actor.controls.trailer is None:
            run.note("trailer", actor.name, "has no trailer to disconnect")
            return
        disconnect(run.roads, actor)
