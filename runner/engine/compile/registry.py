"""Classes that execute OpenSCENARIO elements, one table per family, nothing skipped in silence; and
the context of building.

A family's classes announce themselves with `@action("SpeedAction")`, `@condition("SpeedCondition")`
or `@position("LanePosition")`, each in a module of the family's folder. Where the standard uses one
element name for two things, the key is `Parent/Name` (`VariableAction/SetAction`). What is
deliberately not executed is entered by `refuse` with the reason that the user reads. Installed
packages add modules of classes by the entry-point groups `xosc.action`, `xosc.condition` and
`xosc.position`; they replace no class that is there.
`docs/coverage.md` is generated from these tables.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, MutableMapping
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from schemas.common import packages, plugins
from schemas.common.plugins import NameTaken
from schemas.common.policy import current
from xosc.document.node import Node
from xosc.document.repairs.attributes import is_standard, suggested

if TYPE_CHECKING:
    from runner.engine.compile.element import Position
    from runner.engine.compile.protocols import Run, StoryboardElement
    from runner.engine.participants.entity import Entities, Entity
    from runner.engine.worlds.surroundings import TrafficSignals
    from schemas.common.remarks import Remarks
    from xodr.graph.network import RoadNetwork
    from xosc.resolve import Resolved


class FromXml(Protocol):
    """Contract of registered classes: built from their element."""

    @classmethod
    def from_xml(cls, node: Node, context: Any) -> Any:
        """Build the runtime object; InvalidFile or Unsupported where that can't be done."""
        ...


C = TypeVar("C", bound=type)


class Registry:
    """Element name → class that executes it, for one family of elements.

    Args:
        family: the family's name, for messages.
        package: whose modules hold the classes; they are imported on first use.
    """

    def __init__(self, family: str, package: str) -> None:
        self.family = family
        self.classes: dict[str, type[FromXml]] = {}
        self.refused: dict[str, str] = {}
        self._package = package
        self._loaded = False
        self._extended = False

    def __call__(self, *names: str) -> Callable[[C], C]:
        """Class decorator that enters a class under one or more element names."""

        def enter(cls: C) -> C:
            for name in names:
                if name in self.classes:
                    home = self.classes[name].__module__
                    raise NameTaken(f"the {self.family} {name} is registered by {home}")
                self.classes[name] = cls
                plugins.note_element(name.rpartition("/")[2], cls.__module__)
            return cls

        return enter

    def refuse(self, name: str, reason: str) -> None:
        """Enter an element that is refused by name, with the reason."""
        self.refused[name] = reason

    def load(self) -> None:
        """Import the family's modules, and those of installed packages, so that
        the tables are complete.

        Raises:
            UsageError: a plug-in can't be imported, takes a name in use or registers nothing.
        """
        if not self._loaded:
            packages.load(self._package)
            self._loaded = True
        if not self._extended and not current().untrusted:
            plugins.register(
                f"xosc.{self.family}", lambda: [each.__module__ for each in self.classes.values()]
            )
            self._extended = True

    def find(self, node: Node, parent: str | None = None) -> type[FromXml]:
        """The class for an element.

        Args:
            node: the element.
            parent: name of the enclosing element, for names that mean different things in different
                places.

        Raises:
            Unsupported: the element is refused, with the reason, or unknown to the runner.
            InvalidFile: no version of the standard has it.
        """
        self.load()
        names = ([f"{parent}/{node.tag}"] if parent else []) + [node.tag]
        for name in names:
            if name in self.classes:
                return self.classes[name]
            if name in self.refused:
                raise node.unsupported(self.refused[name])
        if not is_standard(node.tag):
            known = [name.rpartition("/")[2] for name in (*self.classes, *self.refused)]
            told = f"the element {node.tag} is in no version of the standard"
            raise node.invalid(told + suggested(node.tag, known))
        raise node.unsupported(f"this {self.family} is not known to the runner")


action = Registry("action", "runner.engine.actions")
condition = Registry("condition", "runner.engine.conditions")
position = Registry("position", "runner.engine.positions")


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
    def selections(self) -> MutableMapping[str, list[Entity]]:
        """The entity selections: name → members."""
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
        """An element breaks a rule and has one sensible meaning all the same,
        which its class goes on with.

        Args:
            rule: uid of the rule.
            text: what is wrong and what is assumed.
            cause: name of the cause for which the run is inconclusive by it, see
                `schemas.common.remarks.Remark`.

        Raises:
            InvalidFile: the same, where loading is strict.
        """
        ...

    def need_network(self, node: Node) -> RoadNetwork:
        """The road network, for elements that make no sense without one:
        InvalidFile at the element where there is none.
        """
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
        """All named storyboard elements in document order; complete only once
        the whole storyboard is read (`late`).
        """
        ...

    def late(self, check: Callable[[], None]) -> None:
        """Have something done once the whole storyboard is read (references to
        storyboard elements).
        """
        ...

    def each_step(self, observe: Callable[[Run], None]) -> None:
        """Have something called at the end of each step of every run."""
        ...
