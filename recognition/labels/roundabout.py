"""Rules 11 to 13: into the ring of a roundabout, out of it, and round in it."""

from __future__ import annotations

import numpy as np

from recognition.labels.classes import Label
from recognition.labels.encounters import time_apart
from recognition.labels.hits import Hits, alone
from recognition.labels.scene.rolling import always
from recognition.labels.scene.scene import Scene
from recognition.labels.scene.spans import spaced
from recognition.labels.scene.stays import held, stays
from recognition.sites import Role
from recognition.sites.roles import ROLES
from xodr.array_types import BoolArray, IntArray


def roundabout_entering(scene: Scene) -> Hits:
    """11: from an entry lane into the ring."""
    row = _transitions(scene, Role.ENTRY, Role.RING)
    return alone(Label.ROUNDABOUT_ENTERING, row, yields=_yields(scene, row))


def roundabout_exiting(scene: Scene) -> Hits:
    """12: from the ring into an exit lane."""
    row = _transitions(scene, Role.RING, Role.EXIT)
    return alone(Label.ROUNDABOUT_EXITING, row, speed=scene.speed[row])


def roundabout_circulating(scene: Scene) -> Hits:
    """13: in the ring for the whole window and half a window before and after, so that it is apart from entering and exiting."""
    rules = scene.rules
    inside = scene.complete & always(_roles(scene) == ROLES.index(Role.RING), scene.rows(rules.window), scene.first, scene.last)
    row = spaced(scene, inside, rules.ring_spacing, rules.most_windows)
    return alone(Label.ROUNDABOUT_CIRCULATING, row, speed=scene.speed[row])


def _roles(scene: Scene) -> IntArray:
    """Roles without short stays: where lanes of a junction overlap, rows may jump between them."""
    return held(scene.role, scene.first, scene.rows(scene.rules.flicker))


def _transitions(scene: Scene, before: Role, after: Role) -> IntArray:
    roles = _roles(scene)
    start, _ = stays(roles, scene.first)
    row = start[1:][scene.first[start[1:]] == scene.first[start[1:] - 1]]
    row = row[(roles[row - 1] == ROLES.index(before)) & (roles[row] == ROLES.index(after))]
    return row[scene.complete[row]]


def _yields(scene: Scene, row: IntArray) -> BoolArray:
    """Whether ego was slow before it entered, or a vehicle in the ring was soon before or after it at the same place."""
    rules = scene.rules
    earlier = np.maximum(row[:, None] - np.arange(scene.rows(rules.yield_time) + 1), scene.first[row][:, None])
    slow = scene.speed[earlier].min(axis=1, initial=np.inf) < rules.yield_speed
    ring = np.flatnonzero(scene.has_role(Role.RING))
    others = scene.x[ring], scene.y[ring], scene.time[ring], scene.track[ring]
    apart = time_apart(scene.x[row], scene.y[row], scene.time[row], scene.track[row], others)
    return slow | (apart < rules.yield_time)
