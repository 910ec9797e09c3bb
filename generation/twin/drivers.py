"""The systems under test for many cases at once: their own formulas, with what they remember as arrays."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np

from generation.outcomes import FullBraking
from runner.measures.relations import MotionRows, Outline, Sight, box_distance, in_ego_frame, seen_by
from runner.measures.rss import longitudinal_distance, parameter_set
from runner.participants.boxes import Outlook, reach
from runner.sut import System, load_system
from runner.sut.aeb import EmergencyBraking
from runner.sut.cas import CollisionAvoidance, safe_sideways
from runner.sut.encounters import AheadParticipant, encounter
from runner.sut.idm import IntelligentDriver
from runner.sut.reference import CarefulCompetent, FuzzySafety, ReferenceDriver, Regulation157, SafeDistance
from schemas.common.array_types import BoolArray, FloatArray
from schemas.common.errors import Unsupported


class Situation(NamedTuple):
    """Drivers' view of all cases.

    Attributes:
        ego, others: motions, a row for each case.
        speed, acceleration, target: of the ego, and what the scenario asks for (n,).
        changed: where anyone has begun to change speed or lane (n,).
    """

    ego: MotionRows
    others: Sequence[MotionRows]
    speed: FloatArray
    acceleration: FloatArray
    target: FloatArray
    changed: BoolArray

    def encounters(self) -> list[tuple[BoolArray, AheadParticipant]]:
        """Everyone: where they are ahead (n,), and how they are met there."""
        found = []
        for other in self.others:
            x, y, c, s = seen_by(self.ego, other)
            leftwards = other.speed * s
            boxes = (self.ego.box, other.box)
            found.append((x > 0.0, encounter(other.name, Outlook(x, y, c, s), boxes, self.speed, other.speed * c, leftwards)))  # type: ignore[arg-type]
        return found


class DriverModel(Protocol):
    """A system under test in n cases."""

    def control(self, seen: Situation, dt: float) -> tuple[BoolArray, FloatArray]:
        """Return a mask of interventions (n,), and accelerations (n,), m/s²."""
        ...

    def take(self, rows: BoolArray) -> None:
        """Keep some cases only."""
        ...


class _Memory:
    """Memory of each case: the arrays among the attributes."""

    def take(self, rows: BoolArray) -> None:
        """Keep some cases only."""
        for name, values in vars(self).items():
            if isinstance(values, np.ndarray):
                setattr(self, name, values[rows])


class _Scripted(_Memory):
    """No system: the ego does what is scripted."""

    def control(self, seen: Situation, dt: float) -> tuple[BoolArray, FloatArray]:
        """Nowhere."""
        return np.zeros(len(seen.speed), bool), np.zeros(len(seen.speed))


class _Avoidance(_Memory):
    def __init__(self, system: CollisionAvoidance, n: int) -> None:
        self._system, self._rss = system, parameter_set(system.rss)

    def control(self, seen: Situation, dt: float) -> tuple[BoolArray, FloatArray]:
        """Brake fully where RSS distances to vehicles in range are violated."""
        danger = np.zeros(len(seen.speed), bool)
        for other in seen.others:
            near = np.hypot(other.x - seen.ego.x, other.y - seen.ego.y) <= self._system.sensor_range + _reach(seen.ego, other)
            rows = np.flatnonzero(near & ~danger)
            if rows.size:
                danger[rows] = self._dangerous(Outline.of(seen.ego, rows), Outline.of(other, rows))
        return danger, np.full(len(danger), -self._system.brake)

    def _dangerous(self, ego: Outline, other: Outline) -> BoolArray:
        seen = seen_by(ego, other)
        x, y, _, _ = seen
        view = in_ego_frame(ego, other, seen)
        ahead, aside = np.abs(view.ahead), np.abs(view.aside)
        found: BoolArray = (ahead == 0.0) | (ahead < longitudinal_distance(view.speed, view.other_speed, self._rss))
        found &= (x > 0.0) & (aside < safe_sideways(y > 0.0, np.zeros_like(y), -view.other_sideways, self._rss))
        rows = np.flatnonzero(found)
        if rows.size:
            sight = Sight(*(values[rows] for values in seen))
            found[rows] = box_distance(ego.at(rows), other.at(rows), sight) <= self._system.sensor_range
        return found


class _Emergency(_Memory):
    def __init__(self, system: EmergencyBraking, n: int) -> None:
        self._system, self._stage = system, np.zeros(n, int)

    def control(self, seen: Situation, dt: float) -> tuple[BoolArray, FloatArray]:
        """Brake partly or fully, or keep the speed, where the time to collision is or was short."""
        time, held = np.full(len(seen.speed), np.inf), np.zeros(len(seen.speed), bool)
        for ahead, found in seen.encounters():
            time = np.minimum(time, np.where(ahead, self._system.threat(found), np.inf))
            held |= ahead & self._system.holds(found, seen.speed)  # type: ignore[arg-type]
        self._stage = self._system.stage(time, held, self._stage)
        return self._stage > 0, self._system.acceleration(self._stage)


class _Following(_Memory):
    def __init__(self, system: IntelligentDriver, n: int) -> None:
        self._system = system

    def control(self, seen: Situation, dt: float) -> tuple[BoolArray, FloatArray]:
        """Behind the nearest one ahead, with the model's acceleration."""
        gap, wanted = np.full(len(seen.speed), np.inf), np.zeros(len(seen.speed))
        for ahead, found in seen.encounters():
            nearer = ahead & (found.aside < self._system.clearance) & (found.gap < gap)
            wanted = np.where(nearer, self._system.acceleration(found, seen.speed, seen.target), wanted)  # type: ignore[arg-type]
            gap = np.where(nearer, found.gap, gap)
        return np.isfinite(gap), wanted


class _Reference(_Memory):
    def __init__(self, system: ReferenceDriver, n: int) -> None:
        self._system = system
        self._waiting, self._deceleration = np.full(n, system.reaction), np.zeros(n)
        self._alarmed = np.zeros(n, bool)

    def control(self, seen: Situation, dt: float) -> tuple[BoolArray, FloatArray]:
        """Brake with the model's deceleration after its reaction time where there was danger."""
        danger, demand = np.zeros(len(seen.speed), bool), np.zeros(len(seen.speed))
        moving: Any = seen
        for ahead, found in seen.encounters():
            dangerous = ahead & self._system.dangerous(found, moving)
            demand = np.where(dangerous, np.maximum(demand, self._system.demand(found, moving)), demand)
            danger |= dangerous
        waiting, deceleration = self._system.react(self._waiting, self._deceleration, demand, dt)
        self._waiting = np.where(danger, waiting, self._waiting)
        self._deceleration = np.where(danger, deceleration, self._deceleration)
        self._alarmed |= danger
        return self._alarmed.copy(), np.where(danger, -self._deceleration, 0.0)


class _Bound(_Memory):
    def __init__(self, system: FullBraking, n: int) -> None:
        self._system, self._begun = system, np.zeros(n, bool)

    def control(self, seen: Situation, dt: float) -> tuple[BoolArray, FloatArray]:
        """From the instant on at which anyone begins to manoeuvre, with full braking."""
        self._begun = self._begun | seen.changed
        return self._begun.copy(), np.full(len(seen.speed), -self._system.brake)


_KINDS: dict[type, Callable[[Any, int], DriverModel]] = {
    CollisionAvoidance: _Avoidance,
    EmergencyBraking: _Emergency,
    IntelligentDriver: _Following,
    FullBraking: _Bound,
    **dict.fromkeys((CarefulCompetent, Regulation157, SafeDistance, FuzzySafety), _Reference),
}


def driver(system: str | System | None, n: int) -> DriverModel:
    """A system under test in n cases.

    Raises:
        Unsupported: it can't be asked for many cases at once.
        UsageError: there is no such system.
    """
    found = load_system(system)
    if found is None:
        return _Scripted()
    if type(found) not in _KINDS:
        raise Unsupported(f"the system under test {system!r} can't be asked for many points at once")
    return _KINDS[type(found)](found, n)


def _reach(ego: MotionRows, other: MotionRows) -> float:
    return reach(ego.box) + reach(other.box)
