"""The event log as rows of bars over time: acts, events and actions of the storyboard, interventions, collisions, notes."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from runner.interpreter.event_log import LogEntry

_LEVELS = {2: "act", 5: "event", 6: "action"}
"""Storyboard elements that are shown, by their depth: story, act, maneuver group, maneuver, event, action"""
_STARTS = {"startTransition", "interventionStart", "collision"}
_ENDS = {
    "endTransition": "startTransition",
    "stopTransition": "startTransition",
    "interventionEnd": "interventionStart",
    "collisionEnd": "collision",
}
_ORDER = ("act", "event", "action", "intervention", "collision", "note")
_INIT = "Init::"
_SEPARATOR = "::"


@dataclass
class Row:
    """One thing over time.

    Args:
        level: one of act, event, action, intervention, collision, note.
        label: its own name. subject: its whole name, as in the event log.
        bars: from when to when (s; None: to the end of the run), and why.
    """

    level: str
    label: str
    subject: str
    bars: list[tuple[float, float | None, str]] = field(default_factory=list)


def is_shown(entry: LogEntry) -> bool:
    """Whether a line of the event log tells more than the bookkeeping of the storyboard: what is worth a line in a list."""
    return not entry.kind.endswith("Transition") or (not entry.subject.startswith(_INIT) and _level(entry) != "")


def rows(events: Iterable[LogEntry]) -> list[Row]:
    """Rows in the order of the storyboard's levels, then of their first appearance."""
    found: dict[tuple[str, str], Row] = {}
    for entry in events:
        level = _level(entry)
        if not level:
            continue
        key = (level, _whole(entry))
        if entry.kind in _ENDS:
            if key in found:
                _close(found[key], entry.time)
            continue
        row = found.setdefault(key, Row(level, _label(entry), _whole(entry)))
        until = None if entry.kind in _STARTS else entry.time
        row.bars.append((entry.time, until, entry.text))
    lasting = [row for row in found.values() if not row.subject.startswith(_INIT) or any(a != b for a, b, _ in row.bars)]
    return sorted(lasting, key=lambda row: _ORDER.index(row.level))


def _close(row: Row, time: float) -> None:
    start, end, text = row.bars[-1]
    if end is None:
        row.bars[-1] = (start, time, text)


def _level(entry: LogEntry) -> str:
    """The level of the row that a line belongs to; empty for storyboard elements that are not shown."""
    if entry.kind.endswith("Transition"):
        return "action" if entry.subject.startswith(_INIT) else _LEVELS.get(entry.subject.count(_SEPARATOR) + 1, "")
    kind = _ENDS.get(entry.kind, entry.kind)
    return {"interventionStart": "intervention", "collision": "collision"}.get(kind, "note")


def _whole(entry: LogEntry) -> str:
    """What tells rows of one level apart: of a collision both participants, of notes their kind."""
    level = _level(entry)
    if level == "collision":
        return f"{entry.subject} – {entry.text.removeprefix('no longer ').removeprefix('touches ')}"
    return entry.kind if level == "note" else entry.subject


def _label(entry: LogEntry) -> str:
    whole = _whole(entry)
    return whole.rpartition(_SEPARATOR)[2] if entry.kind.endswith("Transition") else whole
