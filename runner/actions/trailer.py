"""Connecting and disconnecting trailers (OpenSCENARIO XML 1.3, class TrailerAction)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from runner.contracts import registry
from runner.contracts.action import PrivateAction
from runner.participants.trailers import connect, disconnect, train

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from runner.contracts.context import Context
    from runner.contracts.run import Run
    from runner.motion.placement import Placement
    from runner.participants.entity import Entity
    from xosc.node import Node


@registry.action("ConnectTrailerAction")
class ConnectTrailerAction(PrivateAction):
    """Puts a trailer's coupler on the actor's hitch; the trailer is moved there where it stands elsewhere."""

    def __init__(self, node: Node, trailer: Entity, lasting: bool) -> None:
        self.node, self.trailer = node, trailer
        self.lasting = lasting

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> ConnectTrailerAction:
        """Read the reference."""
        trailer = context.entity(node, "trailerRef")
        if trailer.declared.coupler is None:
            raise node.invalid(f"{trailer.name!r} has no TrailerCoupler, so it can't be towed")
        return cls(node, trailer, next(context.document.node.iter("DisconnectTrailerAction"), None) is None)

    def references(self) -> Iterable[Entity]:
        """The trailer."""
        return (self.trailer,)

    def check(self, actor: Entity, starts: Sequence[Placement] | None) -> None:
        """It has to have a hitch, and what is connected from the beginning and never disconnected must not be in the way."""
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
            raise self.node.invalid(f"{trailer.name!r} is towed by {trailer.controls.tractor.name!r} already")
        if actor in train(trailer):
            raise self.node.invalid(f"{trailer.name!r} can't be towed by {actor.name!r}, which it tows itself")


@registry.action("DisconnectTrailerAction")
class DisconnectTrailerAction(PrivateAction):
    """Takes the actor's trailer off its hitch; the trailer stays where it is, standing."""

    def __init__(self, node: Node) -> None:
        self.node = node

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> DisconnectTrailerAction:
        """Nothing to read."""
        return cls(node)

    def start(self, actor: Entity, run: Run) -> None:
        """Disconnect."""
        if actor.controls.trailer is None:
            run.note("trailer", actor.name, "has no trailer to disconnect")
            return
        disconnect(run.roads, actor)
