"""The event log as rows of bars over time: acts, events and actions of the storyboard, interventions, collisions, notes."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field

from runner.recording import LogEntry

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
_GROUP = 3
"""Depth of maneuver groups, which have the actors"""
_PAIR = " – "


@dataclass
class Row:
    """One thing over time.

    Args:
        level: one of act, event, action, intervention, collision, note.
        label: its own name. subject: its whole name, as in the event log.
        who: entities it concerns; empty for the whole run.
        bars: from when to when (s; None: to the end of the run), and why.
    """

    level: str
    label: str
    subject: str
    who: tuple[str, ...] = ()
    bars: list[tuple[float, float | None, str]] = field(default_factory=list)


def is_shown(entry: LogEntry) -> bool:
    """Whether a line of the event log is worth a line in a list, beyond the bookkeeping of the storyboard."""
    return not entry.kind.endswith("Transition") or (not entry.subject.startswith(_INIT) and _level(entry) != "")


def rows(events: Iterable[LogEntry], actors: Mapping[str, tuple[str, ...]], names: Collection[str]) -> list[Row]:
    """Rows in the order of the storyboard's levels, then of their first appearance.

    Args:
        actors: actors of each maneuver group, by its path.
        names: of all participants.
    """
    found: dict[tuple[str, str], Row] = {}
    for entry in events:
        level = _level(entry)
        if not level:
            continue
        who = tuple(name for name in _who(entry, level, actors) if name in names)
        key = (level, f"{_whole(entry)} {who}" if level == "note" else _whole(entry))
        if entry.kind in _ENDS:
            if key in found:
                _close(found[key], entry.time)
            continue
        row = found.setdefault(key, Row(level, _label(entry), _whole(entry), who))
        until = None if entry.kind in _STARTS else entry.time
        row.bars.append((entry.time, until, entry.text))
    lasting = [row for row in found.values() if not row.subject.startswith(_INIT) or any(a != b for a, b, _ in row.bars)]
    return sorted(lasting, key=lambda row: _ORDER.index(row.level))


def _who(entry: LogEntry, level: str, actors: Mapping[str, tuple[str, ...]]) -> tuple[str, ...]:
    """The participants that a line may be about."""
    if level == "collision":
        return tuple(_whole(entry).split(_PAIR))
    parts = entry.subject.split(_SEPARATOR)
    if not entry.kind.endswith("Transition"):
        return (entry.subject,)
    if entry.subject.startswith(_INIT):
        return tuple(parts[1:2])
    return actors.get(_SEPARATOR.join(parts[:_GROUP]), ()) if level != "act" else ()


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
    """Return the text that distinguishes rows of one level: both entities of a collision, the kind of notes."""
    level = _level(entry)
    if level == "collision":
        return f"{entry.subject}{_PAIR}{entry.text.removeprefix('no longer ').removeprefix('touches ')}"
    return entry.kind if level == "note" else entry.subject


def _label(entry: LogEntry) -> str:
    whole = _whole(entry)
    return whole.rpartition(_SEPARATOR)[2] if entry.kind.endswith("Transition") else whole
