"""AcmeCoastAction: an entity rolls out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from runner.engine.compile.element import LONGITUDINAL, PrivateAction
from runner.engine.compile.protocols import Running
from runner.engine.compile.registry import action

if TYPE_CHECKING:
    from runner.engine.compile.protocols import Run
    from runner.engine.compile.registry import Context
    from runner.engine.participants.entity import Entity
    from xosc.document.node import Node


@action("AcmeCoastAction")
@dataclass(frozen=True, slots=True)
class AcmeCoastAction(PrivateAction):
    """Lets an entity roll out to a standstill at a constant deceleration (m/s²)."""

    domains: ClassVar[tuple[str, ...]] = (LONGITUDINAL,)  # taken over from other actions

    deceleration: float

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> AcmeCoastAction:
        """Build from the element; `node.invalid` and `node.unsupported` name its file and line."""
        deceleration = node.finite("deceleration")
        if deceleration <= 0.0:
            raise node.invalid(f"deceleration={deceleration:g} must be positive")
        return cls(deceleration)

    def start(self, actor: Entity, run: Run) -> Running | None:
        """Begin one execution; None where it is complete at once."""
        return _Coasting(actor, self.deceleration)


class _Coasting(Running):
    """State of one execution: an action itself holds none, since a scenario runs many times."""

    def __init__(self, actor: Entity, deceleration: float) -> None:
        self._actor = actor
        self._deceleration = deceleration

    def step(self, dt: float) -> bool:
        """Set the speed for the end of the step; whether the action is complete."""
        speed = max(self._actor.speed - self._deceleration * dt, 0.0)
        self._actor.controls.target_speed = speed
        return speed == 0.0
