"""The verdict of a run."""

from __future__ import annotations

from typing import TYPE_CHECKING

from runner.interpreter.result import Verdict

if TYPE_CHECKING:
    from runner.interpreter.collision import Contacts
    from runner.participants.entity import Entity


def judge(contacts: Contacts, ego: Entity | None) -> Verdict:
    """A run fails when the ego touched another participant; scenarios without an ego can only pass."""
    if ego is None:
        return Verdict(True)
    reasons = tuple(
        f"collision with {second if first == ego.name else first} at {time:.2f} s"
        for time, first, second in contacts.history
        if ego.name in (first, second)
    )
    return Verdict(not reasons, reasons)
