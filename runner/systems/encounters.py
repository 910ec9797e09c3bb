"""Participants ahead as the ego sees them, along and across its heading: inputs of drivers; and
sensor models, which decide what a system sees.

Formulas hold for one run and, as arrays, for many, so that a law is written once: conditions are
combined by `&` and `|`, and both sides of a choice are worked out. Parameters of type `Any` that
are m or s or m/s are numbers, or arrays of them over runs.
"""

from __future__ import annotations

import hashlib
import math
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from runner.engine.participants.boxes import outlook, spans
from runner.engine.participants.declaration import BoundingBox
from runner.engine.participants.outlines import extents, seen_by
from runner.systems.base import (
    Control,
    Observation,
    Participant,
    Pose,
    SystemUnderTest,
    Value,
    parameters_of,
)
from schemas.common.array_types import BoolArray, FloatArray, IntArray
from schemas.common.errors import UsageError

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


# sensor models ------------------------------------------------------------------------------

_SPELL = 0.5
"""Time (s) for which a participant is missed, or a ghost is seen: chance must not depend on the
time step"""
_GHOST = BoundingBox(0.0, 0.0, 0.75, 4.5, 1.8, 1.5)
_GHOST_NEAR, _GHOST_FAR = 10.0, 100.0
"""Distances (m) between which ghosts stand ahead"""
_RAIN_K, _RAIN_A = 1.13, 0.72
"""Specific attenuation k·Rᵃ (dB/km) of rain of R mm/h at 77 GHz, horizontal polarisation: 1.132 and
0.7177 by equations 2 and 3 of ITU-R P.838-3 with the constants of its tables 1 and 3"""


@dataclass(frozen=True)
class SensorModel:
    """Detections of the participants around a system; without parameters all of them, at once.

    A participant is seen if its box is within range and field of view, and not hidden. Chance is
    drawn anew every 0.5 s by the run's seed, so that a run repeats.

    T. Hanke and others, Generic architecture for simulation of ADAS sensors, International Radar
    Symposium 2015 (stages: field of view, occlusion, detection, delay).

    Args:
        reach: greatest distance of the centres of the boxes, m.
        field: angle of the field of view about the heading, °.
        occlusion: whether boxes of others hide a participant of which neither the centre nor a
            corner can be seen from the centre of the ego's box.
        delay: age of what is seen, s.
        missed: share of time in which a participant is not detected.
        ghosts: standing cars that are not there, ahead in the ego's lane, per minute.
        rain: whether the environment's rain shortens the reach as that of a 77 GHz radar: the
            power of the echo falls by the fourth power of the distance, and by the attenuation of
            the rain both ways.
    """

    reach: float = math.inf
    field: float = 360.0
    occlusion: bool = False
    delay: float = 0.0
    missed: float = 0.0
    ghosts: float = 0.0
    rain: bool = False

    def __post_init__(self) -> None:
        limits = {
            "reach": (0.0, math.inf), "field": (0.0, 360.0), "delay": (0.0, 10.0),
            "missed": (0.0, 1.0), "ghosts": (0.0, 120.0),
        }  # fmt: skip
        for name, (low, high) in limits.items():
            value = getattr(self, name)
            if not low <= value <= high:
                raise UsageError(f"the sensor's {name} is from {low:g} to {high:g}, not {value:g}")

    def detected(self, observation: Observation, seed: int) -> list[Participant]:
        """Participants that are seen, and ghosts."""
        ego, spell = observation.ego, math.floor(observation.time / _SPELL + 1e-6)
        most = self.reach
        if self.rain:
            most = rainy_reach(most, rain_of(observation.environment.weather))
        found = [
            other
            for other in observation.others
            if self._is_in_view(ego, other, most)
            and not (self.occlusion and _is_hidden(ego, other, observation.others))
            and _chance(seed, "missed", other.name, spell) >= self.missed
        ]
        if _chance(seed, "ghost", "", spell) < self.ghosts * _SPELL / 60.0:
            far = min(_GHOST_FAR, most)
            ahead = _GHOST_NEAR + (far - _GHOST_NEAR) * _chance(seed, "place", "", spell)
            found.append(_ghost(ego, max(ahead, _GHOST_NEAR), spell))
        return found

    def _is_in_view(self, ego: Participant, other: Participant, most: float) -> bool:
        view = outlook(ego, other)
        if math.hypot(view.x, view.y) > most:
            return False
        half = math.radians(self.field / 2.0)
        # A box that the border of the field crosses is seen in part.
        return half >= math.pi or any(
            abs(math.atan2(y, x)) <= half for x, y in _outline(view, other.box)
        )


def rain_of(weather: Mapping[str, str]) -> float:
    """Intensity of rain (mm/h) of an environment's weather; 0 where it does not rain."""
    if weather.get("Precipitation.precipitationType", "rain") != "rain":
        return 0.0
    try:
        return max(float(weather.get("Precipitation.precipitationIntensity", 0.0)), 0.0)
    except ValueError:
        return 0.0


def rainy_reach(reach: float, intensity: float) -> float:
    """Distance (m) at which the echo in rain (mm/h) is as strong as at the reach (m) in dry air."""
    if intensity <= 0.0 or not 0.0 < reach < math.inf:
        return reach
    loss = 2.0 * _RAIN_K * intensity**_RAIN_A / 1000.0
    low, high = 0.0, reach
    for _ in range(40):
        middle = (low + high) / 2.0
        low, high = (
            (middle, high)
            if 40.0 * math.log10(middle / reach) + loss * middle <= 0.0
            else (low, middle)
        )
    return low


def _outline(view: Any, box: BoundingBox) -> list[tuple[float, float]]:
    """Centre and corners of a box as seen from the centre of another one, m."""
    half = box.length / 2.0, box.width / 2.0
    corners = [(a * half[0], b * half[1]) for a in (1, -1) for b in (1, -1)]
    return [(view.x, view.y)] + [
        (view.x + x * view.cos - y * view.sin, view.y + x * view.sin + y * view.cos)
        for x, y in corners
    ]


def _is_hidden(ego: Participant, other: Participant, everyone: Sequence[Participant]) -> bool:
    """Whether boxes of others are before the centre and all corners of a participant's box."""
    rays = _outline(outlook(ego, other), other.box)
    screens = [(outlook(ego, each), each.box) for each in everyone if each is not other]
    return bool(screens) and all(
        any(_crosses(ray, view, box) for view, box in screens) for ray in rays
    )


def _crosses(ray: tuple[float, float], view: Any, box: BoundingBox) -> bool:
    """Whether the segment from the origin to a point crosses a box: slabs in the box's frame."""
    low, high = 0.0, 1.0
    start = (-view.x * view.cos - view.y * view.sin, view.x * view.sin - view.y * view.cos)
    way = (ray[0] * view.cos + ray[1] * view.sin, ray[1] * view.cos - ray[0] * view.sin)
    for at, step, half in zip(start, way, (box.length / 2.0, box.width / 2.0), strict=True):
        if abs(step) < 1e-12:
            if abs(at) >= half:
                return False
            continue
        ends = sorted(((-half - at) / step, (half - at) / step))
        low, high = max(low, ends[0]), min(high, ends[1])
    return low < high


def _ghost(ego: Participant, ahead: float, spell: int) -> Participant:
    """A standing car that is not there, at a distance (m) ahead of the ego."""
    return Participant(
        f"ghost {spell}", "vehicle", "car", _GHOST,
        x=ego.x + ahead * math.cos(ego.h), y=ego.y + ahead * math.sin(ego.h), z=ego.z, h=ego.h,
    )  # fmt: skip


def _chance(seed: int, kind: str, name: str, spell: int) -> float:
    """A number from 0 to below 1 that is the same in each run of a seed."""
    text = f"{seed}|{kind}|{name}|{spell}".encode()
    return int.from_bytes(hashlib.blake2b(text, digest_size=7).digest()) / 2.0**56


@dataclass
class SensedSystem:
    """A system under test that sees through a sensor model."""

    system: SystemUnderTest
    model: SensorModel
    _seed: int = field(init=False, repr=False, default=0)
    _seen: deque[tuple[float, list[Participant]]] = field(
        init=False, repr=False, default_factory=deque
    )

    @property
    def remote_parameters(self) -> dict[str, Value]:
        """Parameters of both."""
        return parameters_of(self.system) | asdict(self.model)

    def reset(self, ego: Participant, timestep: float, seed: int) -> None:
        """Forget the last run."""
        self._seed, self._seen = seed, deque()
        self.system.reset(ego, timestep, seed)

    def control(self, observation: Observation, dt: float) -> Control | Pose:
        """Answer of the system to what the sensor sees."""
        detected = self.model.detected(observation, self._seed)
        self._seen.append((observation.time, detected))
        due = observation.time - self.model.delay + 1e-9
        while len(self._seen) > 1 and self._seen[1][0] <= due:
            self._seen.popleft()
        time, others = self._seen[0]
        # Until something is old enough, nothing is seen.
        seen = others if time <= due else []
        return self.system.control(observation._replace(others=seen), dt)
