"""What the actions of a storyboard can be told before any run: their actors, and where these can be put."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from runner.contracts.action import PrivateAction
from runner.interpreter.storyboard.elements import ActionElement

if TYPE_CHECKING:
    from runner.contracts.action import Action
    from runner.contracts.position import Position
    from runner.interpreter.storyboard.storyboard import Storyboard
    from runner.motion.placement import Placement
    from runner.participants.entity import Entity

_Puts = list[tuple["Entity", "Position | None"]]


def check_actors(storyboard: Storyboard) -> None:
    """Have every action look at the actors that it is sure to have.

    Raises:
        InvalidFile: one makes no sense for one of its actors.
    """
    starts = list(_starts(storyboard))
    puts: _Puts = [put for action, actors in starts for put in _puts(action, actors)]
    selects = any(event.group.select_triggering for act in storyboard.acts for event in act.events)
    for action, actors in starts:
        if isinstance(action, PrivateAction):
            for actor in actors:
                action.check(actor, None if selects else _places(puts, actor))


def _starts(storyboard: Storyboard) -> Iterator[tuple[Action, list[Entity]]]:
    """Every action, with the actors that it is sure to have."""
    for actor, element in storyboard.init:
        for action in element.actions:
            yield action, [actor] if actor is not None else []
    for act in storyboard.acts:
        for event in act.events:
            for child in event.children:
                if isinstance(child, ActionElement):
                    for action in child.actions:
                        yield action, event.group.actors


def _puts(action: Action, actors: list[Entity]) -> Iterator[tuple[Entity, Position | None]]:
    if isinstance(action, PrivateAction):
        for actor in actors:
            yield from action.puts(actor)
    else:
        yield from action.puts()


def _places(puts: _Puts, actor: Entity) -> list[Placement] | None:
    """All places where an actor can be put; None where one of them changes."""
    positions = [position for entity, position in puts if entity is actor]
    fixed = [position.fixed for position in positions if position is not None and position.fixed is not None]
    return fixed if len(fixed) == len(positions) else None
