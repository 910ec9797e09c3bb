"""Participants ahead as the ego sees them, along and across its heading: what the reference drivers decide by."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

from runner.participants.boxes import Outlook, outlook, spans
from runner.participants.declaration import BoundingBox
from runner.sut.base import Observation, Participant
from runner.sut.formulas import choose, greatest, ratio


class Encounter(NamedTuple):
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


def encounters(observation: Observation) -> Iterator[Encounter]:
    """Everyone ahead, in the order of the scenario's entities."""
    ego = observation.ego
    for other in observation.others:
        seen = outlook(ego, other)
        if seen.x > 0.0:
            yield encounter(other.name, seen, (ego.box, other.box), ego.speed, *_relative(ego, other))


def encounter(
    name: str, seen: Outlook, boxes: tuple[BoundingBox, BoundingBox], own: float, speed: float, left: float
) -> Encounter:
    """Someone ahead.

    Args:
        seen: where the other's centre is.
        boxes: the ego's and the other's.
        own: speed of the ego, m/s.
        speed, left: of the other, along the ego's heading, and to its left as seen from the ego, m/s.
    """
    ego, other = boxes
    rear, front, rightmost, leftmost = spans(seen, other)
    aside = choose(seen.y > 0.0, rightmost - ego.width / 2, -leftmost - ego.width / 2)
    approach = choose(seen.y > 0.0, -left, left)
    return Encounter(name, rear - ego.length / 2, aside, front - rear + ego.length, speed, own - speed, approach)


def _relative(ego: Participant, other: Participant) -> tuple[float, float]:
    """Speed of another participant along the ego's heading, and to its left as seen from the ego, m/s."""
    c, s = math.cos(ego.h), math.sin(ego.h)
    return other.vx * c + other.vy * s, (other.vy - ego.vy) * c - (other.vx - ego.vx) * s
