"""First contact between two entities: severity, side, striking and struck entity."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely

from runner.measures.relations import Motion, relations
from runner.participants.boxes import box_corners

FRONT, REAR, LEFT, RIGHT = "front", "rear", "left", "right"
_TOUCHING = 1e-6
"""Distance (m) at which boxes touch"""
_STILL = 1e-9
"""Closing speeds below this (m/s) do not close a gap"""


class Impact(NamedTuple):
    """A first contact.

    Attributes:
        time: s.
        other: name of the other one.
        speed: relative speed of the two, m/s.
        side: of the own box that is touched: `front`, `rear`, `left` or `right`.
        point: middle of the overlap at the first instant of contact, m ahead of the middle of the own box and to its left.
        striking: whether the participant itself hit the other one: of the two it was the faster one towards the other,
            across the side that is touched.
    """

    time: float
    other: str
    speed: float
    side: str
    striking: bool
    point: tuple[float, float]


def sentence(ego: str, other: str, side: str, striking: bool) -> str:
    """Describe a contact: striking entity, struck entity, side of the ego."""
    where = side if side in (FRONT, REAR) else f"{side} side"
    if striking:
        return f"{ego} hit {other} with its {where}"
    return f"{other} hit {ego} {'in the' if side in (FRONT, REAR) else 'on its'} {where}"


class _View(NamedTuple):
    """`runner.measures.relations.View` at one instant."""

    ahead: float
    aside: float
    speed: float
    sideways: float
    other_speed: float
    other_sideways: float


def first_impact(ego: Motion, others: Sequence[Motion]) -> Impact | None:
    """The earliest contact of the ego's box with another one; None where there is none."""
    found = [impact for other in others if (impact := _with(ego, other)) is not None]
    return min(found, key=lambda impact: impact.time, default=None)


def _with(ego: Motion, other: Motion) -> Impact | None:
    rows, _, distance, view = relations(ego, [other])
    touching = np.flatnonzero(distance == 0.0)
    if not touching.size:
        return None
    first = int(touching[0])
    now, before = (_View(*(float(values[row]) for values in view)) for row in (first, max(first - 1, 0)))
    side = _side(before, _bearing(ego.at(rows[first : first + 1]), other, float(ego.time[rows[first]])))
    own, its = (now.speed, now.other_speed) if side in (FRONT, REAR) else (now.sideways, now.other_sideways)
    way = 1.0 if side in (FRONT, LEFT) else -1.0
    speed = float(np.hypot(now.speed - now.other_speed, now.sideways - now.other_sideways))
    striking, point = bool(way * own > -way * its), _point(ego, other, float(ego.time[rows[first]]))
    return Impact(float(ego.time[rows[first]]), other.name, speed, side, striking, point)


def _point(ego: Motion, other: Motion, time: float) -> tuple[float, float]:
    """Middle of the overlap of two boxes at an instant (s), ahead of the middle of the ego's box and to its left, m."""
    own, its = (_outline(each, int(np.argmin(np.abs(each.time - time)))) for each in (ego, other))
    place = shapely.intersection(own, its.buffer(_TOUCHING)).centroid
    row = int(np.argmin(np.abs(ego.time - time)))
    c, s = float(np.cos(ego.h[row])), float(np.sin(ego.h[row]))
    dx, dy = place.x - float(ego.x[row]), place.y - float(ego.y[row])
    return dx * c + dy * s - ego.box.x, dy * c - dx * s - ego.box.y


def _outline(motion: Motion, row: int) -> shapely.Polygon:
    return shapely.Polygon(box_corners(float(motion.x[row]), float(motion.y[row]), float(motion.h[row]), motion.box))


def _side(before: _View, bearing: tuple[float, float]) -> str:
    """The side that is touched next: that of the gap which closes last.

    Args:
        before: a step before the contact.
        bearing: the other's centre ahead and to the left, in half lengths and widths of the two: decides where no gap was left.
    """
    along = _closing_time(before.ahead, before.speed - before.other_speed)
    across = _closing_time(before.aside, before.sideways - before.other_sideways)
    lengthwise = along > across if along != across else abs(bearing[0]) >= abs(bearing[1])
    if lengthwise:
        return FRONT if (before.ahead or bearing[0]) > 0.0 else REAR
    return LEFT if (before.aside or bearing[1]) > 0.0 else RIGHT


def _closing_time(gap: float, closing: float) -> float:
    """Time (s) in which a signed gap closes, 0 where there is none; infinite where it does not close."""
    if gap == 0.0:
        return 0.0
    return gap / closing if abs(closing) > _STILL and gap * closing > 0.0 else np.inf


def _bearing(ego: Motion, other: Motion, time: float) -> tuple[float, float]:
    """The other's centre at an instant as the ego sees it, ahead and to the left, in half lengths and widths of both."""
    row = int(np.argmin(np.abs(other.time - time)))
    c, s = float(np.cos(ego.h[0])), float(np.sin(ego.h[0]))
    dx, dy = float(other.x[row] - ego.x[0]), float(other.y[row] - ego.y[0])
    ahead, aside = dx * c + dy * s, dy * c - dx * s
    return 2.0 * ahead / (ego.box.length + other.box.length), 2.0 * aside / (ego.box.width + other.box.width)
