"""What can be seen of a storyboard element: its place in the storyboard, states and transitions (OpenSCENARIO XML 1.3, 8.3)."""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum
from typing import Protocol


class ElementState(StrEnum):
    """State of a storyboard element (StoryboardElementState)."""

    STANDBY = "standbyState"
    RUNNING = "runningState"
    COMPLETE = "completeState"


class Transition(StrEnum):
    """Transition between states (StoryboardElementState)."""

    START = "startTransition"
    END = "endTransition"
    STOP = "stopTransition"
    SKIP = "skipTransition"


class StoryboardElement(Protocol):
    """A story, act, maneuver group, maneuver, event or action."""

    @property
    def kind(self) -> str:
        """Which of these it is, as the standard's StoryboardElementType says it."""
        ...

    @property
    def path(self) -> str:
        """Name with the names of the enclosing elements, joined by `::` as in a StoryboardElementRef."""
        ...

    @property
    def names(self) -> tuple[str, ...]:
        """The name with the names of the enclosing elements, from the story inwards."""
        ...

    @property
    def state(self) -> ElementState:
        """The state now."""
        ...

    @property
    def transitions(self) -> Sequence[Transition]:
        """The transitions of this step."""
        ...

    @property
    def seen_state(self) -> ElementState:
        """The state at the beginning of the current step, which conditions look at."""
        ...

    @property
    def seen_transitions(self) -> Sequence[Transition]:
        """The transitions of the step before."""
        ...
