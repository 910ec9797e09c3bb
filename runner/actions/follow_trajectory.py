"""FollowTrajectoryAction (OpenSCENARIO XML 1.3, classes FollowTrajectoryAction, Timing, TrajectoryFollowingMode)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from runner.contracts import registry
from runner.contracts.action import LATERAL, LONGITUDINAL, PrivateAction
from runner.contracts.running import Running
from runner.motion.following import JOINING, PathMotion, join
from runner.motion.paths import Chain, Schedule, nearest
from runner.motion.trajectories import Trajectory
from schemas.rules.trajectory_timing import UID as TIMING

if TYPE_CHECKING:
    from collections.abc import Iterable

    from runner.contracts.context import Context
    from runner.contracts.run import Run
    from runner.participants.entity import Entity
    from xosc.node import Node

_SAME_PLACE = 1e-6
"""Distance (m) within which an entity is where it was to be."""
_ROUNDING = 0.01
"""Distance (m) by which a trajectory may be shorter than its rounded vertices say."""
_SAME_TIME = 1e-9


class Timing:
    """How a trajectory's times become times of the simulation: scaled, then shifted, counted from 0 or from the action's start.

    An `initialDistanceOffset` takes the time to get there out of all times.
    """

    def __init__(self, node: Node) -> None:
        self.relative = node.choice("domainAbsoluteRelative", ("absolute", "relative")) == "relative"
        self.offset, self.scale = node.finite("offset"), node.finite("scale")
        if self.scale <= 0.0:
            raise node.invalid(f"scale={self.scale:g} must be positive")

    def origin(self, start: float, skipped: float) -> float:
        """The simulation time (s) at which the trajectory's own time is 0.

        Args:
            start: simulation time at which the action starts, s.
            skipped: trajectory time that the initial distance offset takes, s.
        """
        return (start if self.relative else 0.0) + self.offset - skipped * self.scale


@registry.action("FollowTrajectoryAction")
class FollowTrajectoryAction(PrivateAction):
    """Moves the actor along a trajectory.

    With a Timing the trajectory's times prescribe the motion, so the action takes over both control domains; without, the
    actor keeps the speed that other actions give it. followingMode `position` puts the actor on the trajectory at once;
    `follow` lets it steer there when it is elsewhere.
    """

    def __init__(self, node: Node, trajectory: Trajectory, timing: Timing | None, follow: bool) -> None:
        self.node, self.trajectory, self.timing, self.follow = node, trajectory, timing, follow
        self.skip = node.finite("initialDistanceOffset", 0.0)
        if self.skip < 0.0:
            raise node.invalid(f"initialDistanceOffset={self.skip:g} must not be negative")
        if timing is not None and not trajectory.timed:
            raise node.invalid(f"TimeReference/Timing needs times in the trajectory {trajectory.name!r}, from start to end")
        if timing is not None and trajectory.fixed is not None:
            trajectory.schedule(trajectory.fixed, timing.scale)

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> FollowTrajectoryAction:
        """Read trajectory, time reference and following mode, in the forms of all versions."""
        reference = node.find("TrajectoryRef") or node
        trajectory = Trajectory.from_xml(reference.need("Trajectory"), context)
        timing = node.need("TimeReference").find("Timing")
        if timing is not None and trajectory.timeless:
            context.repair(node, TIMING, f"Timing needs times in the trajectory {trajectory.name!r}; it is followed without")
            timing = None
        return cls(
            node,
            trajectory,
            Timing(timing) if timing is not None else None,
            node.need("TrajectoryFollowingMode").choice("followingMode", ("position", "follow")) == "follow",
        )

    @property
    def places(self) -> bool:
        """Whether it puts the actor on the trajectory at once."""
        return not self.follow

    def claims(self) -> tuple[str, ...]:
        """Lateral control; with times also longitudinal control."""
        return (LATERAL,) if self.timing is None else (LATERAL, LONGITUDINAL)

    def references(self) -> Iterable[Entity]:
        """Entities that the shape's positions are relative to."""
        return self.trajectory.references()

    def start(self, actor: Entity, run: Run) -> Running:
        """Begin at the trajectory's start, where the time says, or (`follow` without times) where the actor is closest."""
        track = self.trajectory.track(run, actor)
        path = track.path
        if self.skip > path.length + _ROUNDING:
            raise self.node.invalid(f"initialDistanceOffset={self.skip:g} is beyond the trajectory's {path.length:.2f} m")
        pace: Pace | None = None
        s = skip = min(self.skip, path.length)
        if self.timing is not None:
            schedule = self.trajectory.schedule(track, self.timing.scale)
            skipped = schedule.time(skip) - schedule.times[0] if skip else 0.0
            pace = Pace(schedule, self.timing.origin(run.time, skipped), self.timing.scale)
            s = max(pace.station(run.time), skip)
        elif self.follow and actor.placed:
            s = max(nearest(path, actor.x, actor.y), skip)
        again = path if self.trajectory.closed and pace is None else None
        oriented = self.trajectory.shape.faces
        motion = PathMotion(run.roads, path, s, again, track.grounded, pace is not None, oriented)
        if self.follow and actor.placed:
            _join(motion, actor, pace, run.time)
        else:
            motion.put(actor, actor.controls.target_speed)
            actor.placed = True
        actor.controls.motion, actor.on_lane, actor.controls.target_offset = motion, False, None
        return _Following(actor, run, motion, pace)


def _join(motion: PathMotion, actor: Entity, pace: Pace | None, now: float) -> None:
    """Let the actor steer to the path from where it is, at a time (s)."""
    ahead = pace.station(now + JOINING) if pace is not None else motion.s
    detour = join(motion.path, motion.s, ahead, actor)
    if detour is not None:
        way, station = detour
        motion.path = Chain(way, motion.path, station)
        motion.s = 0.0
        if pace is not None:
            pace.detour(now, way.length, station)


class Pace:
    """When a follower is where on its path, in times of the simulation.

    An entity that a system under test has slowed down goes on by the times of the place where it is.

    Args:
        schedule: by the trajectory's own times.
        origin: simulation time at which the trajectory's own time is 0, s.
        scale: seconds of simulation for one of the trajectory.
    """

    def __init__(self, schedule: Schedule, origin: float, scale: float) -> None:
        self.schedule = Schedule([origin + scale * time for time in schedule.times], schedule.stations)
        self.late = 0.0

    @property
    def end(self) -> float:
        """Run time (s) at which the path's end is due."""
        return self.schedule.times[-1] + self.late

    def station(self, time: float) -> float:
        """Where (m) the follower is to be at a time of the simulation (s); after the end it goes on evenly."""
        schedule = self.schedule
        time -= self.late
        over = time - schedule.times[-1]
        return schedule.station(time) + (over * schedule.final_speed() if over > 0.0 else 0.0)

    def resume(self, time: float, station: float) -> None:
        """Go on from where (m) the follower is at a time (s)."""
        self.late = time - self.schedule.time(station)

    def detour(self, now: float, length: float, station: float) -> None:
        """Go a way of some length (m) first, from now (s) on, that leads to the path at a station (m)."""
        arrival = max(self.schedule.time(station), now + JOINING)
        rest = [(t, s) for t, s in zip(self.schedule.times, self.schedule.stations, strict=True) if t > arrival and s > station]
        times, stations = [t for t, _ in rest], [length + s - station for _, s in rest]
        self.schedule = Schedule([now, arrival, *times], [0.0, length, *stations])


class _Following:
    """One actor on a trajectory."""

    def __init__(self, actor: Entity, run: Run, motion: PathMotion, pace: Pace | None) -> None:
        self.actor, self.run, self.motion, self.pace = actor, run, motion, pace
        self.expected = motion.s
        self.done = False

    def step(self, dt: float) -> bool:
        """Ask for the speed that the times prescribe, and see whether this step leads to the end."""
        motion = self.motion
        if self.actor.controls.motion is not motion:  # something has put the actor elsewhere, or the end came early
            return True
        if self.pace is not None:
            self.done = self._keep_pace(self.pace, dt)
        elif motion.again is None:
            self.done = motion.reached(self.actor.controls.target_speed, dt) >= motion.path.length - _SAME_PLACE
        return self.done

    def _keep_pace(self, pace: Pace, dt: float) -> bool:
        motion, now = self.motion, self.run.time
        if abs(motion.s - self.expected) > _SAME_PLACE:
            pace.resume(now, motion.s)
        self.expected = max(pace.station(now + dt), motion.s)
        speed = (self.expected - motion.s) / dt
        self.actor.controls.target_speed = -speed if motion.backwards() else speed
        return now + dt >= pace.end - _SAME_TIME

    def stop(self) -> None:
        """Back to the lane: at the end of this step where the trajectory is done, else at once."""
        if self.actor.controls.motion is not self.motion:
            return
        if self.done:
            self.motion.ending = True
        else:
            self.run.roads.back_to_lane(self.actor)
