"""The event log of a run."""

from __future__ import annotations

from typing import NamedTuple


class LogEntry(NamedTuple):
    """One line of the event log: when (s), what kind of event, which element or entity, and why."""

    time: float
    kind: str
    subject: str
    text: str
