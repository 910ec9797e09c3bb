"""Participants ahead as the ego sees them, along and across its heading: inputs of drivers.

Formulas hold for one run and, as arrays, for many, so that a law is written once: conditions are
combined by `&` and `|`, and both sides of a choice are worked out. Parameters of type `Any` that
are m or s or m/s are numbers, or arrays of them over runs.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from runner.engine.participants.boxes import outlook, spans
from runner.engine.participants.declaration import BoundingBox
from runner.engine.participants.outlines import extents, seen_by
from runner.systems.base import Observation, Participant
from schemas.common.array_types import BoolArray, FloatArray, IntArray

if TYPE_CHECKING:
    from runner.systems.arrays import BatchObservation

_OVERSHOT = 1.0
"""Distance (m) beyond a line at which a signal forbids to go on up to which one still stops at it.
"""


def choose(condition: Any, one: Any, other: Any) -> Any:
    """One value where a condition holds, the other one elsewhere."""
    # By identity: numbers and arrays come here, and arrays have no truth of their own.
    if condition is True:
        return one
    if condition is False:
        return other
    return np.where(condition, one, other)


def ratio(numerator: Any, denominator: Any, otherwise: float) -> Any:
    """A quotient where the denominator is positive, another value elsewhere."""
    is_positive = denominator > 0.0
    if is_positive is True:
        return numerator / denominator
    if is_positive is False:
        return otherwise
    found = np.full(np.broadcast_shapes(np.shape(numerator), np.shape(denominator)), otherwise)
    return np.divide(numerator, denominator, out=found, where=is_positive)


def least(one: Any, other: Any) -> Any:
    """The lesser value, the other one where they are equal or the first is no number."""
    is_one = one < other
    if is_one is True:  # as `choose`, without a call: laws ask for it often
        return one
    return other if is_one is False else np.fmin(one, other)


def greatest(one: Any, other: Any) -> Any:
    """The greater value, the other one where they are equal or the first is no number."""
    is_one = one > other
    if is_one is True:
        return one
    return other if is_one is False else np.fmax(one, other)


def tanh(value: Any) -> Any:
    """Hyperbolic tangent."""
    return np.tanh(value) if isinstance(value, np.ndarray) else math.tanh(value)


class AheadParticipant(NamedTuple):
    """Participant with its centre ahead of the ego's, in the ego's straight frame.

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
        """Gap over closing speed, s; infinite where the ego is not faster, 0 where they are beside
        each other."""
        found: float = ratio(greatest(self.gap, 0.0), self.closing, math.inf)
        return found


def encounters(observation: Observation) -> Iterator[AheadParticipant]:
    """All participants ahead, in the order of the scenario's entities."""
    ego = observation.ego
    for other in observation.others:
        seen = outlook(ego, other)
        if seen.x > 0.0:
            speeds = ego.speed, *_relative(ego, other)
            yield _encounter(other.name, seen.y, spans(seen, other.box), ego.box, *speeds)


def encounters_arrays(observations: BatchObservation) -> tuple[BoolArray, AheadParticipant]:
    """Mask of participants that are ahead in many runs (p, n), and all of them as they are met
    there."""
    ego, others = observations.ego, observations.others
    seen, (c, s) = seen_by(ego, others), ego.facing
    along = others.vx * c + others.vy * s
    left = (others.vy - ego.vy) * c - (others.vx - ego.vx) * s
    found = _encounter("", seen.y, extents(seen, others.box), ego.box, ego.speed, along, left)
    return others.present & (seen.x > 0.0), found


def stop_line(observation: Observation) -> AheadParticipant | None:
    """Stop line of a signal as an obstacle in the way; None once the front is beyond it."""
    line, ego = observation.stop_line, observation.ego
    if line is None:
        return None
    found = _line(f"the signal {line.signal}", line.distance, ego.box, ego.speed)
    return found if found.gap >= -_OVERSHOT else None


def stop_line_arrays(observations: BatchObservation) -> tuple[BoolArray, AheadParticipant]:
    """Stop lines in many runs (n,): mask of runs with a line, and all lines."""
    ego, away = observations.ego, np.asarray(observations.stop_line.distance)
    is_there = np.isfinite(away)
    found = _line("", np.where(is_there, away, 0.0), ego.box, ego.speed)
    return is_there & (found.gap >= -_OVERSHOT), found


def nearest(
    ahead: BoolArray, found: AheadParticipant, there: BoolArray, line: AheadParticipant
) -> tuple[BoolArray, AheadParticipant]:
    """The nearest of participants (p, n) and stop lines (n,) in each run, the first of equal ones;
    and where there is one (n,)."""
    if not len(ahead):
        return there, line
    # Gaps of participants that are not ahead must not be the least.
    gaps = np.where(ahead, found.gap, np.inf)
    row = gaps.argmin(axis=0)
    first = AheadParticipant("", *(at_row(values, row) for values in found[1:]))  # type: ignore[arg-type]
    is_met = np.isfinite(gaps.min(axis=0))
    if not there.any():
        return is_met, first
    # Of equal gaps the participant counts, as `min` takes the first in single runs.
    stops = there & ~(is_met & (first.gap <= line.gap))
    both = zip(first[1:], line[1:], strict=True)
    return is_met | there, AheadParticipant("", *(np.where(stops, b, a) for a, b in both))  # type: ignore[arg-type]


def at_row(values: FloatArray, row: IntArray) -> FloatArray:
    """The value of a row (n,) of each column of (p, n)."""
    if len(values) == 1:
        return values[0]
    found: FloatArray = values[row, np.arange(len(row))]
    return found


def _line(name: str, distance: Any, box: BoundingBox, speed: Any) -> AheadParticipant:
    gap = distance - (box.x + 0.5 * box.length)
    # A line lies across the whole way: no law takes it for something beside the ego.
    return AheadParticipant(name, gap, -box.width, box.length, 0.0, speed, 0.0)


def _encounter(
    name: str,
    aside: Any,
    seen: tuple[Any, Any, Any, Any],
    ego: BoundingBox,
    own: Any,
    speed: Any,
    left: Any,
) -> AheadParticipant:
    """Entity ahead.

    Args:
        aside: y of the other's centre, m.
        seen: its least and greatest x, least and greatest y, m.
        ego: the ego's box.
        own: speed of the ego, m/s.
        speed, left: of the other, along the ego's heading, and to its left as seen from the ego,
            m/s.
    """
    rear, front, rightmost, leftmost = seen
    is_left = aside > 0.0
    gap_aside = choose(is_left, rightmost - ego.width / 2, -leftmost - ego.width / 2)
    approach = choose(is_left, -left, left)
    return AheadParticipant(
        name,
        rear - ego.length / 2,
        gap_aside,
        front - rear + ego.length,
        speed,
        own - speed,
        approach,
    )


def _relative(ego: Participant, other: Participant) -> tuple[float, float]:
    """Speed of another participant along the ego's heading, and to its left as seen from the ego,
    m/s."""
    c, s = math.cos(ego.h), math.sin(ego.h)
    return other.vx * c + other.vy * s, (other.vy - ego.vy) * c - (other.vx - ego.vx) * s
