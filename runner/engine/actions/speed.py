"""SpeedAction, and SpeedProfileAction: a series of speed targets over time."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, ClassVar, NamedTuple

from runner.engine.compile.element import LONGITUDINAL, PrivateAction
from runner.engine.compile.registry import action
from runner.engine.compile.run import Running
from runner.engine.motion.dynamics import (
    EPSILON,
    FOLLOWING_MODES,
    TransitionDynamics,
    TransitionShape,
    read_constraints,
    tighter,
)
from runner.engine.participants.declaration import Performance
from runner.engine.participants.entity import Entity
from xosc.document.node import Node

if TYPE_CHECKING:
    from runner.engine.compile.registry import Context
    from runner.engine.compile.run import Run


RELATIVE: dict[str, Callable[[float, float], float]] = {
    "delta": lambda speed, value: speed + value,
    "factor": lambda speed, value: speed * value,
}
"""SpeedTargetValueType → the target speed (m/s), from the reference's speed and the value."""


@action("SpeedAction")
@dataclass(frozen=True, slots=True)
class SpeedAction(PrivateAction):
    """Brings an entity to a speed, absolute or relative to another entity's.

    A relative target is the reference's speed at the action's start, or, where `continuous`, its
    speed at any time; the action then never ends by itself. A step is a change of state, which no
    Performance bounds.

    Where `lasting`, as in scenarios for CARLA, a step in a story keeps the speed over its time or
    distance, and ends then.
    """

    domains: ClassVar[tuple[str, ...]] = (LONGITUDINAL,)

    dynamics: TransitionDynamics
    value: float
    reference: Entity | None
    relation: str
    continuous: bool
    lasting: bool = False

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> SpeedAction:
        """Build from a SpeedAction element."""
        dynamics = TransitionDynamics.from_xml(node.need("SpeedActionDynamics"), context.version)
        target = node.need("SpeedActionTarget").only()
        value = target.finite("value")
        if target.tag == "AbsoluteTargetSpeed":
            return cls(dynamics, value, None, "", False, context.document.for_carla)
        relation = target.choice("speedTargetValueType", RELATIVE)
        return cls(
            dynamics,
            value,
            context.entity(target),
            relation,
            target.bool("continuous"),
            context.document.for_carla,
        )

    def references(self) -> Iterable[Entity]:
        """The entity whose speed the target is relative to."""
        return (self.reference,) if self.reference is not None else ()

    def target(self, actor: Entity) -> float:
        """Target speed now, m/s."""
        speed = (
            self.value
            if self.reference is None
            else RELATIVE[self.relation](self.reference.speed, self.value)
        )
        limit = math.inf if self.dynamics.strict else actor.declared.performance.max_speed
        return min(max(speed, -limit), limit)

    def start(self, actor: Entity, run: Run) -> Running | None:
        """Begin; a change that takes no time is complete at once, unless it never ends."""
        target = self.target(actor)
        duration = self.dynamics.speed_duration(actor.speed, target, actor.declared.performance)
        if duration <= 0.0:
            set_speed(actor, target, run)
        if self.continuous:
            return _Tracking(self, actor, duration)
        if self.lasting and duration <= 0.0 and not run.initialising:
            return _Hold(actor, self.dynamics)
        return _Transition(actor, target, duration, self.dynamics.shape) if duration > 0.0 else None


def set_speed(actor: Entity, speed: float, run: Run) -> None:
    """Have the entity drive at a speed (m/s) from the coming step on; at the start, or when it has just entered, from now on."""
    actor.controls.target_speed = speed
    if run.initialising:
        actor.speed = speed
    elif actor.entered == run.time:
        actor.begin_at(speed)


def demanded_speed(actor: Entity) -> float:
    """Speed (m/s) requested for the coming step; the driven speed while another controller drives the entity."""
    controls = actor.controls
    return (
        actor.speed
        if controls.driver is not None or controls.world_driven
        else controls.target_speed
    )


class _Transition(Running):
    """On the way to a target speed along a shape."""

    __slots__ = ("_actor", "_change", "_duration", "_elapsed", "_start", "_target", "_value")

    def __init__(
        self, actor: Entity, target: float, duration: float, shape: TransitionShape
    ) -> None:
        self._actor = actor
        self._start = actor.speed
        self._target = target
        self._change = target - actor.speed
        self._duration = duration
        self._value = shape.value
        self._elapsed = 0.0

    def step(self, dt: float) -> bool:
        """Ask for the profile's speed at the end of the step."""
        self._elapsed += dt
        progress = self._elapsed / self._duration
        if progress >= 1.0 - EPSILON:
            self._actor.controls.target_speed = self._target
            return True
        self._actor.controls.target_speed = self._start + self._change * self._value(progress)
        return False


class _Hold(Running):
    """Keeping a speed over a time (s) or distance (m)."""

    __slots__ = ("_actor", "_elapsed", "_extent", "_origin", "_over_distance")

    def __init__(self, actor: Entity, dynamics: TransitionDynamics) -> None:
        self._actor = actor
        self._extent = dynamics.value
        self._over_distance = dynamics.dimension == "distance"
        self._origin = actor.odometer
        self._elapsed = 0.0

    def step(self, dt: float) -> bool:
        """Wait."""
        self._elapsed += dt
        return (
            self._actor.odometer - self._origin if self._over_distance else self._elapsed
        ) >= self._extent - EPSILON


class _Tracking(Running):
    """Towards, and then at, a speed that follows another entity's.

    With a rate, the demand moves by at most that rate; with a time or distance, the shape blends
    into the moving target, which is then kept exactly.
    """

    __slots__ = ("_action", "_actor", "_duration", "_elapsed", "_start")

    def __init__(self, action: SpeedAction, actor: Entity, duration: float) -> None:
        self._action = action
        self._actor = actor
        self._start = actor.speed
        self._duration = duration
        self._elapsed = 0.0

    def step(self, dt: float) -> bool:
        """Ask for the target's speed as far as it may be reached."""
        self._elapsed += dt
        actor, dynamics = self._actor, self._action.dynamics
        target = self._action.target(actor)
        if dynamics.dimension == "rate" and dynamics.shape.slope > 0.0:
            reach = dynamics.value * dt
            target = min(max(target, actor.speed - reach), actor.speed + reach)
        elif self._elapsed < self._duration:
            target = self._start + (target - self._start) * dynamics.shape.value(
                self._elapsed / self._duration
            )
        actor.controls.target_speed = target
        return False


_UNLIMITED = Performance()
STRETCH, STRETCHES = 1.25, 100
"""Factor and number of the attempts to give a segment the time that its jerk limits need."""
_EPSILON = 1e-9


class ProfileEntry(NamedTuple):
    """A speed (m/s) to be reached `time` (s) after the entry before; None: as soon as the limits allow."""

    time: float | None
    speed: float


@action("SpeedProfileAction")
@dataclass(frozen=True, slots=True)
class SpeedProfileAction(PrivateAction):
    """Runs through speed targets, absolute or relative to another entity's speed at any time.

    followingMode `position` interpolates linearly. `follow` rounds the corners of that profile with
    the jerk limits,
    from no acceleration at the start to none at the end. Limits are those of DynamicConstraints and, where these say
    nothing and the mode is `follow`, the entity's Performance; what they forbid takes longer than
    the entries say.
    """

    domains: ClassVar[tuple[str, ...]] = (LONGITUDINAL,)

    entries: tuple[ProfileEntry, ...]
    reference: Entity | None
    smooth: bool
    constraints: Performance

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> SpeedProfileAction:
        """Build from a SpeedProfileAction element."""
        entries = tuple(_read_entry(entry) for entry in node.children("SpeedProfileEntry"))
        if not entries:
            raise node.invalid("a SpeedProfileEntry is expected inside")
        reference = context.entity(node) if node.has("entityRef") else None
        constraints = read_constraints(node.find("DynamicConstraints")) or _UNLIMITED
        return cls(
            entries,
            reference,
            node.choice("followingMode", FOLLOWING_MODES) == "follow",
            constraints,
        )

    def references(self) -> Iterable[Entity]:
        """The entity whose speed the targets are relative to."""
        return (self.reference,) if self.reference is not None else ()

    def start(self, actor: Entity, run: Run) -> Running:
        """Plan the profile from the speed that the actor has, or that a SpeedAction has just demanded."""
        limits = (
            tighter(self.constraints, actor.declared.performance)
            if self.smooth
            else self.constraints
        )
        speed = demanded_speed(actor) - (
            self.reference.speed if self.reference is not None else 0.0
        )
        return _Profile(actor, self.reference, plan(speed, self.entries, limits, self.smooth))


def _read_entry(node: Node) -> ProfileEntry:
    time = node.finite("time", None)
    if time is not None and time < 0.0:
        raise node.invalid(f"time={time:g} must not be negative")
    return ProfileEntry(time, node.finite("speed"))


class ProfilePiece(NamedTuple):
    """A stretch of the profile with constant jerk: from `time` (s) on, speed (m/s), acceleration (m/s²), jerk (m/s³)."""

    time: float
    speed: float
    acceleration: float
    jerk: float

    def at(self, time: float) -> float:
        """Speed at a time (s) of the profile."""
        past = time - self.time
        return self.speed + past * (self.acceleration + 0.5 * self.jerk * past)


class _Segment(NamedTuple):
    """A straight line of the profile: duration (s), slope (m/s²), and the speed reached (m/s)."""

    duration: float
    slope: float
    reached: float

    def stretched(self, factor: float) -> _Segment:
        """The same change of speed in more time."""
        return _Segment(self.duration * factor, self.slope / factor, self.reached)


def plan(
    speed: float, entries: Iterable[ProfileEntry], limits: Performance, smooth: bool
) -> list[ProfilePiece]:
    """The profile as pieces of constant jerk, the last of which has no end.

    Args:
        speed: at the start, m/s.
        entries: the targets.
        limits: infinite where there are none.
        smooth: whether corners are rounded with the jerk limits, with no acceleration at the start
            and the end.
    """
    segments = _segments(speed, entries, limits)
    if (
        smooth
        and limits.max_acceleration_rate < math.inf
        and limits.max_deceleration_rate < math.inf
    ):
        return _rounded(speed, segments, limits)
    pieces, time = [ProfilePiece(0.0, speed, 0.0, 0.0)], 0.0
    for segment in segments:
        pieces.append(ProfilePiece(time, speed, segment.slope, 0.0))
        time, speed = time + segment.duration, segment.reached
        pieces.append(ProfilePiece(time, speed, 0.0, 0.0))
    return pieces


def _segments(speed: float, entries: Iterable[ProfileEntry], limits: Performance) -> list[_Segment]:
    """The ways between the targets within the limits of speed and acceleration; a last one may have no end."""
    segments: list[_Segment] = []
    for entry in entries:
        target = min(max(entry.speed, -limits.max_speed), limits.max_speed)
        change = target - speed
        limit = limits.max_acceleration if abs(target) > abs(speed) else limits.max_deceleration
        if change and limit == 0.0:
            return [*segments, _Segment(math.inf, 0.0, speed)]
        duration = max(entry.time or 0.0, abs(change) / limit if change else 0.0)
        segments.append(_Segment(duration, change / duration if duration > 0.0 else 0.0, target))
        speed = target
    return segments


def _rounded(speed: float, segments: list[_Segment], limits: Performance) -> list[ProfilePiece]:
    """The linear profile with each corner replaced by a stretch of constant jerk, centred on the corner.

    The first one can't begin before the profile does, so the first line comes half of it late; it
    is left where it meets the second line, or shifts all that follows where it doesn't.
    """
    segments = [s for s in segments if s.duration > 0.0]
    for _ in range(STRETCHES):
        tight = _tight(segments, limits)
        if not tight:
            break
        segments = [s.stretched(STRETCH) if i in tight else s for i, s in enumerate(segments)]
    slopes = [0.0, *(segment.slope for segment in segments), 0.0]
    corners = _corners(segments, _blend(slopes[0], slopes[1], limits) / 2.0)
    pieces = [ProfilePiece(0.0, speed, 0.0, 0.0)]
    for corner, before, after in zip(corners, slopes, slopes[1:], strict=False):
        blend = _blend(before, after, limits)
        begin = corner - blend / 2.0
        if blend > 0.0:
            pieces.append(
                ProfilePiece(begin, pieces[-1].at(begin), before, (after - before) / blend)
            )
        pieces.append(ProfilePiece(begin + blend, pieces[-1].at(begin + blend), after, 0.0))
    return pieces


def _blend(before: float, after: float, limits: Performance) -> float:
    """Time (s) that the change from one acceleration to another takes."""
    rate = limits.max_acceleration_rate if after > before else limits.max_deceleration_rate
    return abs(after - before) / rate if rate > 0.0 else 0.0


def _corners(segments: list[_Segment], late: float) -> list[float]:
    corners, time = [late], 0.0
    for index, segment in enumerate(segments):
        time += segment.duration
        shift = late
        if index == 0 and len(segments) > 1 and segment.slope != segments[1].slope:
            meeting = late * segment.slope / (segment.slope - segments[1].slope)
            if -segment.duration < meeting < segments[1].duration:
                shift, late = meeting, 0.0
        corners.append(time + shift)
    return corners


def _tight(segments: list[_Segment], limits: Performance) -> set[int]:
    """Segments shorter than the halves of the blends at their ends."""
    slopes = [0.0, *(segment.slope for segment in segments), 0.0]
    blends = [_blend(before, after, limits) for before, after in pairwise(slopes)]
    return {
        index
        for index, segment in enumerate(segments)
        if segment.duration + _EPSILON < (blends[index] + blends[index + 1]) / 2.0
    }


class _Profile(Running):
    """The profile in execution."""

    __slots__ = ("_actor", "_elapsed", "_pieces", "_reference", "_times")

    def __init__(self, actor: Entity, reference: Entity | None, pieces: list[ProfilePiece]) -> None:
        self._actor = actor
        self._reference = reference
        self._pieces = pieces
        self._times = [piece.time for piece in pieces]
        self._elapsed = 0.0

    def step(self, dt: float) -> bool:
        """Ask for the profile's speed at the end of the step."""
        self._elapsed += dt
        time = self._elapsed + _EPSILON
        piece = self._pieces[bisect_right(self._times, time) - 1]
        base = self._reference.speed if self._reference is not None else 0.0
        self._actor.controls.target_speed = base + piece.at(self._elapsed)
        return time >= self._times[-1]
