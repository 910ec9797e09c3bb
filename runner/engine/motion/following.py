"""Motion along a path off the lanes, the way to it, and steering."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from runner.engine.motion.paths import Path, Polyline, approach, nearest, tangent
from runner.engine.motion.placement import Placement, in_world, pose_of, wrap
from runner.engine.participants.entity import STRAIGHT_AHEAD

if TYPE_CHECKING:
    from runner.engine.motion.on_roads import Roads
    from runner.engine.participants.entity import Entity


_WHEELBASE = 0.6
"""Wheelbase as a share of the length, where the file says nothing of axles."""
_SHARPEST = 1.0
"""Steering angle (rad) that front wheels can have, where the file gives no maxSteering."""


class SteeredMotion:
    """A kinematic bicycle about the rear axle, on the surface of the road: the heading turns with
    v·tan(δ)/L.

    Source: Rajamani, "Vehicle Dynamics and Control" (2012), 2.2, with the reference point on the
    rear axle.
    """

    stands = False

    def __init__(self, roads: Roads) -> None:
        self._roads = roads
        self._angle = 0.0

    def steer(self, entity: Entity, angle: float) -> None:
        """Take the entity off its lane or path and turn its front wheels, rad, positive to the
        left."""
        most = entity.declared.max_steering or _SHARPEST
        self._angle = max(-most, min(most, angle))
        entity.on_lane = False
        entity.controls.motion = self

    def advance(self, entity: Entity, speed: float, dt: float) -> float:
        """Move along the arc that the wheels ask for."""
        wheelbase = (
            entity.declared.front_axle
            if entity.declared.front_axle > 0.0
            else _WHEELBASE * entity.box.length
        )
        turn = speed * math.tan(self._angle) / wheelbase * dt if wheelbase > 0.0 else 0.0
        # The chord of an arc has the heading of its middle: exact in direction, and in length to
        # the second order of the turn.
        h = entity.h + 0.5 * turn
        entity.x += speed * dt * math.cos(h)
        entity.y += speed * dt * math.sin(h)
        entity.h = wrap(entity.h + turn)
        self._roads.lift(entity)
        return speed

    def distance_to(self, entity: Entity, placement: Placement) -> float | None:
        """Return the distance straight ahead to the place."""
        return STRAIGHT_AHEAD.distance_to(entity, placement)


class PosedMotion:
    """Pose by pose as a system under test with a vehicle model of its own gives them, on the
    surface of the road."""

    stands = False

    def __init__(self, roads: Roads) -> None:
        self._roads = roads
        self._pose = (0.0, 0.0, 0.0)

    def put(self, entity: Entity, x: float, y: float, h: float) -> None:
        """Take the entity off its lane or path and give it a pose for the end of
        the step; m, rad.
        """
        self._pose = (x, y, wrap(h))
        entity.on_lane = False
        entity.controls.motion = self

    def advance(self, entity: Entity, speed: float, dt: float) -> float:
        """Move to the pose."""
        entity.x, entity.y, entity.h = self._pose
        self._roads.lift(entity)
        return speed

    def distance_to(self, entity: Entity, placement: Placement) -> float | None:
        """Return the distance straight ahead to the place."""
        return STRAIGHT_AHEAD.distance_to(entity, placement)


JOINING = 2.0
"""Time (s) that an entity takes at least to join a path that it was not on."""
_ASIDE = 3.0
"""Way along the path, per distance from it, that an entity takes at least to join it."""
_ON_PATH = 0.01
"""Distance (m) from a path up to which an entity counts as being on it."""
_AT_END = 1e-6
"""Distance (m) from the end of a path within which an entity is there"""
_ACROSS = 1e-6
"""Cosine of an angle below which one faces neither way"""
_SHORTEST = 1e-3
"""A distance (m) that is short for every path."""


class PathMotion:
    """Along a path, at the entity's speed.

    The first motion, whatever its gear, goes towards the end; the other gear leads back, to the
    beginning at most. Where the path prescribes no orientation, an entity whose first motion is in
    reverse faces backwards. Where it does, an entity that is put inside the path moves the way that
    its orientation and gear say, and the beginning is its end where that is back.

    At the end of the path the entity goes back to its lane by itself; one that has to be there for
    a while may stand there.

    Args:
        path: where to go.
        s: where on it the entity is, m.
        again: the path to go round and round afterwards, for closed ones.
        grounded: whether height, pitch and roll are those of the road below.
        timed: whether times say when the end is left.
        oriented: whether the path prescribes orientations, which then hold in either gear.
    """

    stands = False

    def __init__(
        self,
        roads: Roads,
        path: Path,
        s: float,
        again: Path | None = None,
        grounded: bool = True,
        timed: bool = False,
        oriented: bool = False,
    ) -> None:
        self.roads, self.path, self.s, self.again = roads, path, s, again
        self._reach = _AT_END if timed else 0.0
        self._timed, self._oriented = timed, oriented
        self.turns = True
        """Whether the entity turns with the path; else it keeps its heading."""
        self._gear = 0.0
        """Direction of motion for positive speed: +1 along the path, -1 against it; 0 before the
        first motion"""
        self._back = False
        self.left = False
        """Whether the entity has gone back to its lane by itself."""
        self.ending = False
        """Whether the entity goes back to its lane after the coming step, wherever it is then."""
        self._surface = grounded and roads.network is not None and not roads.network.flat
        self._target: tuple[Placement, float] | None = None

    def advance(self, entity: Entity, speed: float, dt: float) -> float:
        """Move along the path."""
        # The gear is engaged by the first motion, not by the assignment: an entity may stand until
        # then.
        if self._gear == 0.0 and speed:
            self._gear = self._engaged(speed)
            self._back = self._gear * speed < 0.0 and not self._timed
        before, self.s = self.s, self._kept(self.reached(speed, dt))
        # Stopped where backward motion ends: the speed is that of the way it had left.
        if self.s == self._origin and (self.s != before or speed):
            speed = self._gear * (self.s - before) / dt or 0.0
        if self.s >= self.path.length and self.again is not None and not self._back:
            # Modulo, since a fast entity may go round a short path more than once in a step.
            self.s = (self.s - self.path.length) % max(self.again.length, _SHORTEST)
            self.path, self._target = self.again, None
        self.put(entity, speed)
        if self.ending or self._left():
            self.left = True
            self.roads.back_to_lane(entity)
        return speed

    @property
    def remaining(self) -> float:
        """Way (m) to its end, which is the beginning of the path on the way back."""
        return self.s if self._back else max(self.path.length - self.s, 0.0)

    @property
    def _origin(self) -> float:
        """Return the station (m) at which backward motion ends."""
        return self.path.length if self._back else 0.0

    def _kept(self, s: float) -> float:
        return min(s, self._origin) if self._back else max(s, self._origin)

    def _left(self) -> bool:
        if self._back:
            return self.s <= 0.0
        return self.s >= self.path.length + self._reach and self.again is None

    def _engaged(self, speed: float) -> float:
        """The gear of a first motion at a speed (m/s)."""
        if self._oriented and not self._timed and self.s > _AT_END:
            return -1.0 if self.backwards() else 1.0
        return math.copysign(1.0, speed)

    def put(self, entity: Entity, speed: float) -> None:
        """Give the entity the pose of the path where it is.

        If the path does not define the heading, the sign of the first speed (m/s) does; a standing
        entity keeps its heading.
        """
        # The first of these that is known decides which way it faces: its gear, its speed, its
        # heading now.
        reverse = not self._oriented and (self._gear or speed or self._along(entity)) < 0.0
        kept = entity.h
        entity.x, entity.y, entity.z, entity.h, entity.pitch, entity.roll = self.path.at(self.s)
        if not self.turns:
            entity.h = kept
        elif reverse and self._along(entity) > 0.0:
            entity.h += math.pi
        # On level roads the heights of the path are those of the road: the search for the place is
        # spared.
        if self._surface:
            place = in_world(
                self.roads.network,
                pose_of(entity),
                z_known=False,
                hint=self.roads.road_point(entity),
            )
            entity.z, entity.pitch, entity.roll = place.z, place.pitch, place.roll

    def _along(self, entity: Entity) -> float:
        """Cosine of the angle between an entity's heading and the path."""
        return math.cos(entity.h - tangent(self.path, self.s))

    def reached(self, speed: float, dt: float) -> float:
        """Return the station (m) after a step of dt (s) at a speed (m/s). Times always increase
        along the path."""
        gear = self._gear or self._engaged(speed)
        return self.s + (abs(speed) if self._timed else gear * speed) * dt

    def ends(self, speed: float, dt: float) -> bool:
        """Whether a step of dt (s) at a speed (m/s) leads to the end."""
        s = self.reached(speed, dt)
        if self._back or (not self._gear and s < self.s):
            return s <= _AT_END
        return s >= self.path.length - _AT_END and self.again is None

    def backwards(self) -> bool:
        """Whether the orientation that the path prescribes faces against its direction, so that one
        reverses along it."""
        # Asked in every step: recorded trajectories face ahead everywhere.
        if isinstance(self.path, Polyline) and self.path.faces_ahead:
            return False
        return math.cos(self.path.at(self.s).h - tangent(self.path, self.s)) < -_ACROSS

    def distance_to(self, entity: Entity, placement: Placement) -> float | None:
        """Distance (m) along the path to the point of it nearest to a place;
        negative once passed.
        """
        # The place of a fixed position is one object throughout a run: the search is done once.
        if self._target is None or self._target[0] is not placement:
            self._target = placement, nearest(self.path, placement.x, placement.y)
        left = self._target[1] - self.s
        return -left if self._gear * entity.speed < 0.0 and not self._timed else left


def join(path: Path, s: float, ahead: float, entity: Entity) -> tuple[Path, float] | None:
    """The way of an entity to a path that it is not on, and the s (m) where it meets the path; None
    where it is on it.

    Args:
        s: the place on the path that it would have to be at, m.
        ahead: where it may meet the path at the earliest, m.
    """
    here = path.at(s)
    dx, dy = here.x - entity.x, here.y - entity.y
    if math.hypot(dx, dy) <= _ON_PATH:
        return None
    h = tangent(path, s)
    aside = abs(dy * math.cos(h) - dx * math.sin(h))
    # Whichever is longer: an angle that a vehicle can drive, or time to drive it.
    reach = max(_ASIDE * aside, JOINING * abs(entity.speed))
    before = max(dx * math.cos(h) + dy * math.sin(h), 0.0)
    station = min(max(s + reach - before, ahead, s), path.length)
    return approach(entity.x, entity.y, entity.h, entity.z, path.at(station)), station
