"""FollowTrajectoryAction (OpenSCENARIO XML 1.3, classes FollowTrajectoryAction, Timing,
TrajectoryFollowingMode)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from runner.engine.actions.speed import demanded_speed
from runner.engine.compile import registry
from runner.engine.compile.element import LATERAL, LONGITUDINAL, PrivateAction
from runner.engine.compile.protocols import Rest, Running
from runner.engine.motion.dynamics import GapController
from runner.engine.motion.following import JOINING, PathMotion, join
from runner.engine.motion.paths import Chain, turns_back
from runner.engine.motion.schedules import Schedule, delayed, paced, prescribed, smooth, steady
from runner.engine.motion.trajectories import Rests, TimedPath, Trajectory
from runner.engine.participants.declaration import Performance
from runner.engine.participants.trailers import line_up
from xosc.resolve import CLOCK
from xosc.rules.positions import TIMING_UID

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from runner.engine.compile.element import Position
    from runner.engine.compile.protocols import Run
    from runner.engine.compile.registry import Context
    from runner.engine.participants.entity import Entity
    from xosc.document.node import Node

_SAME_PLACE = 1e-6
"""Distance (m) within which an entity is where it was to be."""
_ROUNDING = 0.01
"""Distance (m) by which a trajectory may be shorter than its rounded vertices say, or begin beside
its actor."""
_STANDSTILL = 1e-3
"""Speed (m/s) below which a schedule ends in standstill."""
NOT_BEGUN_UID = "xosc.toolchain:xosc:1.0.0:trajectory.begins_while_it_is_followed"
_END_TOLERANCE = 0.1
"""Way (m) to the end of a trajectory that counts as none"""
_LATE = 0.05
"""Time (s) beyond a step by which a trajectory may come late"""
_SAME_TIME = 1e-9
_MOMENT = 1e-4
"""Time (s) over which a speed is measured."""
_SAME_CHANGE = 1e-6
"""Change of speed (m/s) by which rounding may exceed a limit."""


class Timing:
    """Mapping of a trajectory's times to simulation times: scaled, then shifted, counted from 0 or
    from the action's start.

    An `initialDistanceOffset` takes the time to get there out of all times.
    """

    def __init__(self, node: Node) -> None:
        self.relative = (
            node.choice("domainAbsoluteRelative", ("absolute", "relative")) == "relative"
        )
        self.offset, self.scale = node.finite("offset"), node.finite("scale")
        if self.scale <= 0.0:
            raise node.invalid(f"scale={self.scale:g} must be positive")

    def origin(self, start: float) -> float:
        """The simulation time (s) at which the trajectory's own time is 0, for an action that
        starts at a time (s)."""
        return (start if self.relative else 0.0) + self.offset


def _read_clock(node: Node, trajectory: Trajectory, timing: Timing, context: Context) -> None:
    """Count the times of a clock, such as UNIX seconds, from the first that the scenario has.

    An offset that takes that clock back is worked into it, which keeps the digits of the times.
    """
    first = trajectory.base = context.document.first_clock_time
    moved = timing.offset + timing.scale * first
    if abs(moved) < CLOCK:
        timing.offset = moved
        return
    timing.offset = timing.offset if abs(timing.offset) < CLOCK else 0.0
    context.repair(
        node,
        TIMING_UID,
        f"the times of the trajectory {trajectory.name!r} are those of a clock, and the "
        "scenario's begins at 0: "
        f"they are counted from {first:.15g} s, the first of the scenario",
    )


@registry.action("FollowTrajectoryAction")
class FollowTrajectoryAction(PrivateAction):
    """Moves the actor along a trajectory.

    With a Timing the trajectory's times prescribe the motion, so the action takes over both control
    domains; without, the actor keeps the speed that other actions give it, or has those that the
    trajectory's Motions prescribe. followingMode `position` puts the actor on the trajectory at
    once, and has it at each vertex at its time, whatever speeds that takes; `follow` lets it steer
    there when it is elsewhere, with continuous speeds (`schedules.smooth`) and within its
    Performance: where that does not suffice it is late, and catches up.
    """

    run_by_run = True

    def __init__(
        self, node: Node, trajectory: Trajectory, timing: Timing | None, follow: bool
    ) -> None:
        self.node, self.trajectory, self.timing, self.follow = node, trajectory, timing, follow
        self.skip = node.finite("initialDistanceOffset", 0.0)
        if self.skip < 0.0:
            raise node.invalid(f"initialDistanceOffset={self.skip:g} must not be negative")
        if timing is not None and not trajectory.timed:
            raise node.invalid(
                f"TimeReference/Timing needs times in the trajectory {trajectory.name!r}, from "
                "start to end"
            )
        if timing is not None and trajectory.fixed is not None:
            trajectory.timetable(trajectory.fixed, timing.scale)

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> FollowTrajectoryAction:
        """Read trajectory, time reference and following mode, in the forms of all versions."""
        reference = node.find("TrajectoryRef") or node
        trajectory = Trajectory.from_xml(reference.need("Trajectory"), context)
        timing = node.need("TimeReference").find("Timing")
        if timing is not None and trajectory.timeless:
            context.repair(
                node,
                TIMING_UID,
                f"Timing needs times in the trajectory {trajectory.name!r}; it is followed without",
            )
            timing = None
        for motion in trajectory.shape.untimed_motions() if timing is not None else ():
            context.repair(
                motion,
                TIMING_UID,
                f"{motion.tag} at a place without a time, which Timing needs; it is left out",
            )
        read = Timing(timing) if timing is not None else None
        if read is not None and trajectory.clock:
            _read_clock(node, trajectory, read, context)
        return cls(
            node,
            trajectory,
            read,
            node.need("TrajectoryFollowingMode").choice("followingMode", ("position", "follow"))
            == "follow",
        )

    @property
    def places(self) -> bool:
        """Whether it puts the actor on the trajectory at once."""
        return not self.follow

    def puts(self, actor: Entity) -> Iterable[tuple[Entity, Position | None]]:
        """The actor, without a position: the trajectory leads anywhere."""
        return [(actor, None)]

    def claims(self) -> tuple[str, ...]:
        """Lateral control; with times, or speeds and accelerations, also longitudinal control."""
        return (
            (LATERAL, LONGITUDINAL)
            if self.timing is not None or self.trajectory.moved
            else (LATERAL,)
        )

    def references(self) -> Iterable[Entity]:
        """Entities that the shape's positions are relative to."""
        return self.trajectory.references()

    def start(self, actor: Entity, run: Run) -> Running:
        """Begin at the trajectory's start, after its initialDistanceOffset, or
        where the time says.
        """
        track = self.trajectory.track(run, actor)
        path = track.path
        if self.skip > path.length + _ROUNDING:
            raise self.node.invalid(
                f"initialDistanceOffset={self.skip:g} is beyond the trajectory's "
                f"{path.length:.2f} m"
            )
        pace: Pace | None = None
        s = skip = min(self.skip, path.length)
        if self.timing is not None:
            pace = self._pace(self.timing, track, skip, actor, run.time)
            s = max(pace.station(run.time), skip)
        elif self.trajectory.moved:
            pace = self._prescribed_pace(track, skip, actor, run.time)
        again = path if self.trajectory.closed and pace is None else None
        oriented = self.trajectory.shape.faces or (pace is not None and track.rests is Rests.SOME)
        motion = PathMotion(run.roads, path, s, again, track.grounded, pace is not None, oriented)
        motion.turns = track.rests is not Rests.ALL or not actor.placed
        following = _Following(actor, run, motion, pace, self._limits(actor))
        if self.follow and actor.placed:
            _join(motion, actor, pace, run.time)
        elif actor.placed and pace is not None and pace.begin > run.time + _SAME_TIME:
            return _Waiting(actor, run, following, pace, self.node)
        else:
            if pace is not None and self.trajectory.moved:
                actor.controls.target_speed = pace.speed(run.time)
            _put(actor, motion, run)
            run.relocated(actor)
        _lead(actor, motion)
        return following

    def _limits(self, actor: Entity) -> Performance:
        """Return the limits on changes of speed. Jerk is unlimited: accelerations constant between
        vertices jump there."""
        if not self.follow:
            return Performance()
        return actor.declared.performance._replace(
            max_acceleration_rate=math.inf, max_deceleration_rate=math.inf
        )

    def _pace(
        self, timing: Timing, track: TimedPath, skip: float, actor: Entity, now: float
    ) -> Pace:
        """The times, from now (s) on, of an actor that begins at a distance (m) along the track."""
        times, stations = self.trajectory.timetable(track, timing.scale)
        origin, rests = timing.origin(now), list[float]()
        if not self.follow:
            schedule = steady(times, stations)
        else:
            wait = origin + times[0] - now
            begins = not skip and wait >= -_SAME_TIME
            speed = 0.0 if wait > _SAME_TIME else abs(demanded_speed(actor))
            rests = [s for s in stations[1:-1] if turns_back(track.path, s)]
            schedule = smooth(times, stations, speed if begins else None, rests)
        if self.trajectory.moved:
            motions = [
                motion
                for motion, time in zip(track.motions, track.times, strict=True)
                if time is not None
            ]
            try:
                schedule = prescribed(times, stations, motions, schedule)
            except ValueError as error:
                raise self.trajectory.node.invalid(
                    f"{error}: its times, speeds and accelerations contradict each other"
                ) from None
        return Pace(schedule, origin - (schedule.time(skip) - times[0] if skip else 0.0), rests)

    def _prescribed_pace(self, track: TimedPath, skip: float, actor: Entity, now: float) -> Pace:
        """Times, from now (s) on, that follow from the trajectory's speeds and accelerations."""
        try:
            schedule = paced(track.stations, track.motions, abs(demanded_speed(actor)))
        except ValueError as error:
            raise self.trajectory.node.invalid(
                f"{error}: no motion to the trajectory's end follows from its Motions"
            ) from None
        return Pace(schedule, now - (schedule.time(skip) if skip else 0.0), [], free=True)


def _put(actor: Entity, motion: PathMotion, run: Run) -> None:
    """Put the actor on the path, its trailers behind it."""
    here = actor.x, actor.y
    motion.put(actor, actor.controls.target_speed)
    if not actor.placed or math.dist(here, (actor.x, actor.y)) > _ROUNDING:
        line_up(run.roads, actor)
    actor.placed = True


def _lead(actor: Entity, motion: PathMotion) -> None:
    """Have the actor move along the path from now on."""
    actor.controls.motion, actor.on_lane, actor.controls.target_offset = motion, False, None


def _join(motion: PathMotion, actor: Entity, pace: Pace | None, now: float) -> None:
    """Let the actor steer to the path from where it is, at a time (s)."""
    ahead = pace.station(now + JOINING) if pace is not None else motion.s
    detour = join(motion.path, motion.s, ahead, actor)
    if detour is not None:
        way, station = detour
        motion.path = Chain(way, motion.path, station)
        motion.s = 0.0
        if pace is not None:
            pace.detour(now, way.length, station, abs(demanded_speed(actor)))


class Pace:
    """Station of a follower on its path, by times of the simulation.

    An entity that a system under test has slowed down goes on by the times of the place where it
    is.

    Args:
        schedule: by the trajectory's own times, scaled.
        origin: simulation time at which the trajectory's own time is 0, s.
        rests: stations (m) at which the follower has to stop.
        free: whether the times only follow from the speeds, so that a detour delays them.
    """

    def __init__(
        self, schedule: Schedule, origin: float, rests: Sequence[float], free: bool = False
    ) -> None:
        self._schedule, self._origin, self._rests, self._free = schedule, origin, rests, free

    @property
    def begin(self) -> float:
        """Time of the simulation at which the path begins (s)."""
        return self._schedule.times[0] + self._origin

    @property
    def end(self) -> float:
        """Time of the simulation at which the path ends (s)."""
        return self._schedule.times[-1] + self._origin

    def due(self, time: float) -> bool:
        """Whether the path's end is due at a time of the simulation (s)."""
        return time >= self.end - _SAME_TIME

    @property
    def length(self) -> float:
        """End of the schedule (m)."""
        return self._schedule.stations[-1]

    @property
    def rests(self) -> bool:
        """Whether the schedule ends in standstill."""
        return self._schedule.final_speed < _STANDSTILL

    def station(self, time: float) -> float:
        """Return the scheduled station (m) at a simulation time (s); after the end it grows at
        constant speed."""
        schedule = self._schedule
        time -= self._origin
        over = time - schedule.times[-1]
        return schedule.station(time) + (over * schedule.final_speed if over > 0.0 else 0.0)

    def speed(self, time: float) -> float:
        """The speed (m/s) that the schedule has from a time of the simulation (s) on."""
        return (self.station(time + _MOMENT) - self.station(time)) / _MOMENT

    def resume(self, time: float, station: float) -> None:
        """Go on from where (m) the follower is at a time (s)."""
        self._origin = time - self._schedule.time(station)

    def detour(self, now: float, length: float, station: float, speed: float) -> None:
        """Go a way of some length (m) first, from now (s) and a speed (m/s) on, that leads to the
        path at a station (m)."""
        if self._free:
            self._schedule, self._origin = delayed(self._schedule, length, station, speed), now
            return
        arrival = max(self._schedule.time(station) + self._origin, now + JOINING)
        vertices = zip(self._schedule.times, self._schedule.stations, strict=True)
        rest = [
            (t + self._origin, s - station)
            for t, s in vertices
            if t + self._origin > arrival and s > station
        ]
        times, stations = [t for t, _ in rest], [length + s for _, s in rest]
        rests = [length + s - station for s in self._rests]
        self._schedule, self._origin = (
            smooth([now, arrival, *times], [0.0, length, *stations], speed, rests),
            0.0,
        )


class _Waiting(Running):
    """Actor whose trajectory begins later: it continues its motion, and is placed at that time."""

    def __init__(
        self, actor: Entity, run: Run, following: _Following, pace: Pace, node: Node
    ) -> None:
        self.actor, self.run, self.following, self.pace = actor, run, following, pace
        self.node, self.put = node, False

    def step(self, dt: float) -> bool:
        """Wait for the beginning, and follow from the step on in which it comes."""
        if not self.put and self.pace.begin > self.run.time + dt + _SAME_TIME:
            return False
        if not self.put:
            self.put = True
            _put(self.actor, self.following.motion, self.run)
            _lead(self.actor, self.following.motion)
        return self.following.step(dt)

    def rest(self) -> Rest | None:
        """Return the rest of the follower; a trajectory that has not begun is a
        remark of its own.
        """
        if self.put:
            return self.following.rest()
        text = (
            f"{self.actor.name} follows none of its trajectory: it would begin at"
            f" {self.pace.begin:.2f} s, and the action ends at {self.run.time:.2f} s"
        )
        self.run.remarks.note(self.node.remark(NOT_BEGUN_UID, text))
        return None

    def stop(self) -> None:
        """End the following; a trajectory that has not begun is a remark."""
        if not self.put:
            self.rest()
        self.following.stop()


class _Following(Running):
    """One actor on a trajectory."""

    def __init__(
        self, actor: Entity, run: Run, motion: PathMotion, pace: Pace | None, limits: Performance
    ) -> None:
        self.actor, self.run, self.motion, self.pace = actor, run, motion, pace
        self.limits = limits
        self.catch_up = GapController(limits)
        self.expected = motion.s
        self.done = False

    def rest(self) -> Rest | None:
        """The end of the trajectory, if it has one: what is left is the way (m) to it, or the time
        (s) that it came late."""
        motion, pace, dt = self.motion, self.pace, self.run.dt
        if motion.again is not None:
            return None
        if not self.done and not motion.left:
            left = motion.remaining if pace is None else max(pace.length - motion.s, 0.0)
            tolerance = _END_TOLERANCE + abs(self.actor.speed) * dt
            return Rest("the end of its trajectory", f"{left:.1f} m before it", left, tolerance)
        late = max(self.run.time - pace.end, 0.0) if pace is not None else 0.0
        asked = f" at {pace.end:.2f} s" if pace is not None else ""
        goal, reached = f"the end of its trajectory{asked}", f"it at {self.run.time:.2f} s"
        return Rest(goal, reached, late, dt + _LATE)

    def step(self, dt: float) -> bool:
        """Ask for the speed that the times prescribe, and see whether this step
        leads to the end.
        """
        motion = self.motion
        if (
            self.actor.controls.motion is not motion
        ):  # something has put the actor elsewhere, or the end came early
            return not (motion.left and self.pace is not None and self.pace.rests) or self._brake(
                dt
            )
        if self.pace is not None:
            self.done = self._keep_pace(self.pace, dt)
        else:
            self.done = motion.ends(self.actor.controls.target_speed, dt)
        return self.done

    def _keep_pace(self, pace: Pace, dt: float) -> bool:
        motion, now = self.motion, self.run.time
        if abs(motion.s - self.expected) > _SAME_PLACE:
            pace.resume(now, motion.s)
        speed = self._possible(pace, now, dt)
        self.expected = motion.s + speed * dt
        self.actor.controls.target_speed = -speed if motion.backwards() else speed
        arrived = pace.due(now + dt) and self.expected >= pace.length - _SAME_PLACE
        return arrived and (speed < _STANDSTILL or not pace.rests)

    def _brake(self, dt: float) -> bool:
        """Come to a standstill beyond the end, where the Performance did not suffice before it;
        whether that is reached."""
        own = demanded_speed(self.actor)
        speed = max(abs(own) - self.limits.max_deceleration * dt, 0.0)
        self.actor.controls.target_speed = math.copysign(speed, own)
        return speed == 0.0

    def _possible(self, pace: Pace, now: float, dt: float) -> float:
        """The speed (m/s) that leads to where the times ask for, or towards it
        within the limits.
        """
        here, there, s = pace.station(now), pace.station(now + dt), self.motion.s
        wanted, own, limits = max(there - s, 0.0) / dt, abs(demanded_speed(self.actor)), self.limits
        slowest, fastest = (
            own - limits.max_deceleration * dt,
            min(own + limits.max_acceleration * dt, limits.max_speed),
        )
        if pace.rests and limits.max_deceleration < math.inf:
            fastest = min(fastest, max(self._stopping(pace.length - s, dt), slowest))
            wanted = min(wanted, fastest)
        if slowest - _SAME_CHANGE <= wanted <= fastest + _SAME_CHANGE:
            return wanted
        return min(
            max(self.catch_up.speed(here - s, own, (there - here) / dt, dt), 0.0), max(fastest, 0.0)
        )

    def _stopping(self, way: float, dt: float) -> float:
        """The highest speed (m/s) of a step from which the actor can stop within a way (m), by
        steps of dt (s)."""
        half = 0.5 * self.limits.max_deceleration * dt
        return math.sqrt(half * half + 2.0 * self.limits.max_deceleration * max(way, 0.0)) - half

    def stop(self) -> None:
        """Back to the lane: at the end of this step where the trajectory is done, else at once."""
        if self.actor.controls.motion is not self.motion:
            return
        if self.done:
            self.motion.ending = True
        else:
            self.run.roads.back_to_lane(self.actor)
