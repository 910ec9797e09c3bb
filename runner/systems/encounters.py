"""Participants ahead as the ego sees them, along and across its heading: what the reference drivers decide by.

Formulas hold for one case and, as arrays, for many, so that a decision is written once: conditions
are combined by `&` and `|`, and both sides of a choice are worked out.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from runner.engine.participants.boxes import Outlook, outlook, spans
from runner.engine.participants.declaration import BoundingBox
from runner.systems.base import Observation, Participant

_OVERSHOT = 1.0
"""Distance (m) beyond a line at which a signal forbids to go on up to which one still stops at it."""


def choose(condition: Any, one: Any, other: Any) -> Any:
    """One value where a condition holds, the other one elsewhere."""
    if isinstance(condition, np.ndarray):
        return np.where(condition, one, other)
    return one if condition else other


def ratio(numerator: Any, denominator: Any, otherwise: float) -> Any:
    """A quotient where the denominator is positive, another value elsewhere."""
    if isinstance(denominator, np.ndarray):
        found = np.full(np.broadcast_shapes(np.shape(numerator), denominator.shape), otherwise)
        return np.divide(numerator, denominator, out=found, where=denominator > 0.0)
    return numerator / denominator if denominator > 0.0 else otherwise


def least(one: Any, other: Any) -> Any:
    """The lesser value."""
    return choose(one < other, one, other)


def greatest(one: Any, other: Any) -> Any:
    """The greater value."""
    return choose(one > other, one, other)


class AheadParticipant(NamedTuple):
    """A participant whose centre is ahead of the ego's; the ego's frame goes straight on, whatever the road does.

    Numbers, or arrays of them over many cases.

    Args:
        name: the participant's name.
        gap: from the ego's front to its rear, m; negative where they are beside each other.
        aside: from the ego's side to its nearer side, m; negative where it is in the ego's way.
        length: its extent along the ego's heading and the ego's own, together, m.
        speed: its speed along the ego's heading, m/s.
        closing: how much faster the ego is, m/s.
        approach: how fast the lateral gap shrinks, m/s.
    """

    name: str
    gap: float
    aside: float
    length: float
    speed: float
    closing: float
    approach: float

    @property
    def time_to_collision(self) -> float:
        """Gap over closing speed, s; infinite where the ego is not faster, 0 where they are beside each other."""
        found: float = ratio(greatest(self.gap, 0.0), self.closing, math.inf)
        return found


def encounters(observation: Observation) -> Iterator[AheadParticipant]:
    """Everyone ahead, in the order of the scenario's entities."""
    ego = observation.ego
    for other in observation.others:
        seen = outlook(ego, other)
        if seen.x > 0.0:
            yield encounter(
                other.name, seen, (ego.box, other.box), ego.speed, *_relative(ego, other)
            )


def stop_line(observation: Observation) -> AheadParticipant | None:
    """The line at which a signal forbids to go on, as something that stands in the way; None once the front is beyond it."""
    line, box = observation.stop_line, observation.ego.box
    gap = line.distance - (box.x + 0.5 * box.length) if line is not None else -math.inf
    if line is None or gap < -_OVERSHOT:
        return None
    return AheadParticipant(
        f"the signal {line.signal}", gap, -box.width, box.length, 0.0, observation.ego.speed, 0.0
    )


def encounter(
    name: str,
    seen: Outlook,
    boxes: tuple[BoundingBox, BoundingBox],
    own: float,
    speed: float,
    left: float,
) -> AheadParticipant:
    """Entity ahead.

    Args:
        seen: where the other's centre is.
        boxes: the ego's and the other's.
        own: speed of the ego, m/s.
        speed, left: of the other, along the ego's heading, and to its left as seen from the ego,
            m/s.
    """
    ego, other = boxes
    rear, front, rightmost, leftmost = spans(seen, other)
    aside = choose(seen.y > 0.0, rightmost - ego.width / 2, -leftmost - ego.width / 2)
    approach = choose(seen.y > 0.0, -left, left)
    return AheadParticipant(
        name, rear - ego.length / 2, aside, front - rear + ego.length, speed, own - speed, approach
    )


def _relative(ego: Participant, other: Participant) -> tuple[float, float]:
    """Speed of another participant along the ego's heading, and to its left as seen from the ego, m/s."""
    c, s = math.cos(ego.h), math.sin(ego.h)
    return other.vx * c + other.vy * s, (other.vy - ego.vy) * c - (other.vx - ego.vx) * s
