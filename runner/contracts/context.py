"""Context in which the classes of the registries are built from XML."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from runner.contracts.position import Position
    from runner.contracts.run import Run, StoryboardElement
    from runner.participants.entity import Entities, Entity
    from runner.surroundings.signals import TrafficSignals
    from schemas.common.remarks import Remarks
    from xodr.network import RoadNetwork
    from xosc.node import Node
    from xosc.resolve import Resolved


class Context(Protocol):
    """A scenario being compiled: its declarations, and look-up of what attributes refer to."""

    @property
    def document(self) -> Resolved:
        """The document, every attribute a literal."""
        ...

    @property
    def version(self) -> tuple[int, int]:
        """Version of the standard that the document has."""
        ...

    @property
    def network(self) -> RoadNetwork | None:
        """The road network, if the scenario names one."""
        ...

    @property
    def declared(self) -> Entities:
        """All entities of the scenario."""
        ...

    @property
    def monitors(self) -> Mapping[str, bool]:
        """The monitors declared."""
        ...

    @property
    def parameter_types(self) -> Mapping[str, str]:
        """The global parameters declared: name → type."""
        ...

    @property
    def variable_types(self) -> Mapping[str, str]:
        """The variables declared: name → type."""
        ...

    @property
    def signals(self) -> TrafficSignals:
        """The traffic signals, for references to them."""
        ...

    @property
    def remarks(self) -> Remarks:
        """Assumptions so far."""
        ...

    def repair(self, node: Node, rule: str, text: str, cause: str = "") -> None:
        """An element breaks a rule and has one sensible meaning all the same, which its class goes on with.

        Args:
            rule: uid of the rule.
            text: what is wrong and what is assumed.
            cause: name of the cause for which the run is inconclusive by it, see `schemas.common.remarks.Remark`.

        Raises:
            InvalidFile: the same, where loading is strict.
        """
        ...

    def need_network(self, node: Node) -> RoadNetwork:
        """The road network, for elements that make no sense without one: InvalidFile at the element where there is none."""
        ...

    def entity(self, node: Node, attribute: str = "entityRef") -> Entity:
        """The single entity that an attribute names."""
        ...

    def entities(self, node: Node, attribute: str = "entityRef") -> list[Entity]:
        """The entity, or the members of the entity selection, that an attribute names."""
        ...

    def triggering_entities(self, node: Node) -> list[Entity]:
        """Members of a TriggeringEntities element, selections expanded, each once."""
        ...

    def position(self, node: Node) -> Position:
        """The position inside an element that holds exactly one (Position, TargetPosition, …)."""
        ...

    def storyboard_elements(self) -> list[StoryboardElement]:
        """All named storyboard elements in document order; complete only once the whole storyboard is read (`late`)."""
        ...

    def late(self, check: Callable[[], None]) -> None:
        """Have something done once the whole storyboard is read (references to storyboard elements)."""
        ...

    def each_step(self, observe: Callable[[Run], None]) -> None:
        """Have something called at the end of each step of every run."""
        ...
