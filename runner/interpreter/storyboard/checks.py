"""Checks of a storyboard: its actions and their actors before any run, and elements that can't start any more after one."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from runner.contracts.element import PrivateAction
from runner.contracts.run import Instant, Transition
from runner.interpreter.storyboard.elements import ActionElement
from runner.interpreter.storyboard.storyboard import Act, Event, Storyboard

if TYPE_CHECKING:
    from runner.contracts.element import Action, Position
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


def placeable(storyboard: Storyboard) -> set[Entity] | None:
    """Entities that some action can put somewhere; None where triggers select actors, which are known in a run only."""
    if any(event.group.select_triggering for act in storyboard.acts for event in act.events):
        return None
    return {entity for action, actors in _starts(storyboard) for entity, _ in _puts(action, actors)}


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


def idleness(board: Storyboard, end: Instant) -> Iterator[str]:
    """One sentence on each reason for which elements can't start any more.

    Args:
        board: the storyboard as the run has left it.
        end: the last instant.
    """
    waiting: dict[str, list[Act | Event]] = {}
    elements: list[Act | Event] = [*board.acts, *(event for act in board.acts for event in act.events)]
    for element in elements:
        if Transition.START in element.first:
            continue
        reason = element.trigger.missed(end) if element.trigger is not None else ""
        if reason:
            waiting.setdefault(reason, []).append(element)
    for reason, (first, *others) in waiting.items():
        more = f" (and {len(others)} more)" if others else ""
        yield f"{first.kind} {first.name!r}{more} can't start: {reason} was true too early, and does not rise again"
