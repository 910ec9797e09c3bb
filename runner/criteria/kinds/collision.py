"""CollisionTest: the participant hits no other one while it moves."""

from __future__ import annotations

import math

import numpy as np

from runner.criteria.criterion import Contact, Drive, Finding

CRITERION = {
    "name": "CollisionTest",
    "unit": "collisions",
    "summary": "it hits no other participant while it moves; being hit in standstill does not count",
    "parameters": {},
    "on_roads": False,
}

_STANDING = 0.1
"""Speed below which a collision is not its own fault, m/s"""
_SAME_TIME, _SAME_PLACE = 5.0, 5.0
"""A contact with the same participant within this time (s), or with anybody within this distance (m), is the same collision."""


def evaluate(drive: Drive) -> Finding:
    """Count the collisions."""
    counted: list[tuple[Contact, int]] = []
    standing: list[Contact] = []
    columns = drive.columns
    for contact in drive.contacts:
        row = min(int(np.searchsorted(columns["time"], contact.time - 1e-9)), len(columns["time"]) - 1)
        if counted and _same(contact, row, *counted[-1], columns):
            continue
        if abs(columns["speed"][max(row - 1, 0)]) < _STANDING:
            standing.append(contact)
        else:
            counted.append((contact, row))
    if counted:
        contact, row = counted[0]
        speed = abs(columns["speed"][max(row - 1, 0)])
        return Finding(False, float(len(counted)), f"hit {contact.other} at {contact.time:.2f} s with {speed:.1f} m/s")
    if standing:
        return Finding(True, 0.0, f"no collision: it stood when {standing[0].other} touched it at {standing[0].time:.2f} s")
    return Finding(True, 0.0, "no collision")


def _same(contact: Contact, row: int, before: Contact, place: int, columns: dict[str, np.ndarray]) -> bool:
    """Whether a contact belongs to the collision before it."""
    if contact.other == before.other and contact.time - before.time <= _SAME_TIME:
        return True
    x, y = columns["x"], columns["y"]
    return math.hypot(x[row] - x[place], y[row] - y[place]) <= _SAME_PLACE
