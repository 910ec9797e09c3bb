"""What is said of a run that ends before any event has started, and of acts and events that can't start any more."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from runner.contracts.run import Instant
from runner.contracts.storyboard import Transition
from runner.interpreter.storyboard.storyboard import Act, Event, Storyboard


def idleness(board: Storyboard, end: Instant, finished: bool) -> tuple[str, ...]:
    """A sentence on a stop trigger that has ended a run before any event, and one on each reason why elements never can start.

    Args:
        board: the storyboard as the run has left it.
        end: the last instant.
        finished: whether the storyboard ended the run.
    """
    acts = [act for act in board.acts if Transition.START not in act.first]
    events = [event for act in board.acts for event in act.events if Transition.START not in event.first]
    found = list(_missed([*acts, *events], end))
    if finished and board.stop_trigger is not None and events and len(events) == sum(len(act.events) for act in board.acts):
        found.append(f"no event has started: the run ended at {end.time:.2f} s, by {board.stop_trigger.reason}")
    return tuple(found)


def _missed(idle: Iterable[Act | Event], end: Instant) -> Iterator[str]:
    """One sentence on all that wait for the same in vain."""
    waiting: dict[str, list[Act | Event]] = {}
    for element in idle:
        reason = element.trigger.missed(end) if element.trigger is not None else ""
        if reason:
            waiting.setdefault(reason, []).append(element)
    for reason, (first, *others) in waiting.items():
        more = f" (and {len(others)} more)" if others else ""
        yield f"{first.kind} {first.name!r}{more} can't start: {reason} was true too early, and does not rise again"
