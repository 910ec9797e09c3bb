"""Participants ahead as the ego sees them, along and across its heading: what the reference drivers decide by."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

from runner.participants.boxes import outlook, spans
from runner.sut.base import Observation, Participant


class Encounter(NamedTuple):
    """A participant whose centre is ahead of the ego's; the ego's frame goes straight on, whatever the road does.

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
        return max(self.gap, 0.0) / self.closing if self.closing > 0.0 else math.inf


def encounters(observation: Observation) -> Iterator[Encounter]:
    """Everyone ahead, in the order of the scenario's entities."""
    ego = observation.ego
    for other in observation.others:
        seen = outlook(ego, other)
        if seen.x > 0.0:
            rear, front, right, left = spans(seen, other.box)
            half_length, half_width = ego.box.length / 2, ego.box.width / 2
            speed, leftwards = _relative(ego, other)
            aside = right - half_width if seen.y > 0.0 else -left - half_width
            approach = -leftwards if seen.y > 0.0 else leftwards
            length = front - rear + ego.box.length
            yield Encounter(other.name, rear - half_length, aside, length, speed, ego.speed - speed, approach)


def _relative(ego: Participant, other: Participant) -> tuple[float, float]:
    """Speed of another participant along the ego's heading, and to its left as seen from the ego, m/s."""
    c, s = math.cos(ego.h), math.sin(ego.h)
    return other.vx * c + other.vy * s, (other.vy - ego.vy) * c - (other.vx - ego.vx) * s
