"""StoryboardElementStateCondition: conditions on the storyboard itself (OpenSCENARIO XML 1.3)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from runner.contracts.element import Condition
from runner.contracts.registry import condition
from runner.contracts.run import ElementState, StoryboardElement, Transition
from xosc.names import names_of, nearest
from xosc.node import Node

if TYPE_CHECKING:
    from runner.contracts.registry import Context
    from runner.contracts.run import Instant

_KINDS = ("story", "act", "maneuverGroup", "maneuver", "event", "action")
_STATES = tuple(state.value for state in ElementState)
_TRANSITIONS = tuple(transition.value for transition in Transition)


@condition("StoryboardElementStateCondition")
class StoryboardElementStateCondition(Condition):
    """True while a storyboard element is in a state, or in the step after it made a transition.

    The element is named by its name or, where that is not unique among the elements of its type, by the end of its path
    (`Act::Group::Maneuver::Event`). Of several that a name fits, the one meant is that nearest to the condition: within
    the same maneuver, else the same group, act or story (maneuvers from catalogues may be used more than once).
    """

    element: StoryboardElement
    around: bool = False
    """whether the element contains the condition: then it has always done its part of a step before the condition looks"""

    def __init__(self, state: str) -> None:
        self.state = state
        self._is_state = state in _STATES

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> StoryboardElementStateCondition:
        """Read reference, type and state; the element is looked up once the storyboard is complete."""
        kind = node.choice("storyboardElementType", _KINDS)
        name = node.get("storyboardElementRef")
        self = cls(node.choice("state", _STATES + _TRANSITIONS))

        def find() -> None:
            self.element = find_element(node, name, kind, context.storyboard_elements())
            own = self.element.names
            self.around = names_of(node.element)[: len(own)] == own

        context.late(find)
        return self

    def keeps(self, run: Instant) -> float:
        """From the first step on, until something happens."""
        return math.inf if run.step_index > 0 else -math.inf

    def evaluate(self, run: Instant) -> bool:
        """Whether the element was in the state, or had made the transition, when this step began.

        Elements that contain the condition are seen as they are now: an event can start in the very step of its act.
        """
        element = self.element
        if self._is_state:
            return self.state == (element.state if self.around else element.seen_state)
        if self.around and run.step_index > 0:  # before the first step, stories have started already
            return self.state in element.transitions
        return self.state in element.seen_transitions or (self.around and self.state in element.transitions)

    def describe(self, run: Instant) -> str:
        """The element's state and transitions."""
        element = self.element
        seen = ", ".join((str(element.seen_state), *element.seen_transitions))
        return f"{element.kind} {element.path} is in {seen}, {self.state} expected"


def find_element(node: Node, name: str, kind: str, elements: Sequence[StoryboardElement]) -> StoryboardElement:
    """Return the only storyboard element of a type that a name or the end of a path refers to.

    Raises:
        InvalidFile: there is none, or more than one are equally near to the condition.
    """
    found = nearest(name, names_of(node.element), [(e.names, e) for e in elements if e.kind == kind])
    if not found:
        raise node.invalid(f"storyboardElementRef={name!r} is no {kind} of this storyboard")
    if len(found) > 1:
        paths = ", ".join(e.path for e in found[:4])
        raise node.invalid(f"storyboardElementRef={name!r} is ambiguous: {paths}; name it with those around it, as a path")
    return found[0]
