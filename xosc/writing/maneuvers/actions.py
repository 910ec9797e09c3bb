"""Actions and the conditions that start them, and the events and manoeuvres that hold them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scenariogeneration import xosc as sg

from schemas.common.errors import UsageError
from xosc.writing.maneuvers.entities import (
    Number,
    PolylineTrajectory,
    declarations,
    enum_value,
    number,
)


@dataclass(frozen=True)
class TriggerCondition:
    """A condition, which becomes part of a start or a stop trigger.

    Attributes:
        name: its name in the file.
        condition: scenariogeneration's object.
        edge: none, rising, falling or risingOrFalling.
        entity: whose condition it is; None for a condition by value.
        delay: time (s) after which it counts.
    """

    name: str
    condition: Any
    edge: str
    entity: str | None = None
    delay: Number = 0.0

    def build(self, point: str) -> Any:
        """Return scenariogeneration's object, in a trigger to "start" or to "stop"."""
        edge, delay = enum_value("ConditionEdge", self.edge), number(self.delay)
        if self.entity is None:
            return sg.ValueTrigger(self.name, delay, edge, self.condition, point)
        return sg.EntityTrigger(
            f"{self.name} of {self.entity}",
            delay,
            edge,
            self.condition,
            self.entity,
            triggeringpoint=point,
        )


Conditions = TriggerCondition | Sequence[TriggerCondition] | Sequence[Sequence[TriggerCondition]]
"""A condition; conditions that have to hold together; or groups of such, of which one is enough."""


def trigger(conditions: Conditions, point: str) -> Any:
    """A trigger that fires when its conditions hold."""
    listed = [conditions] if isinstance(conditions, TriggerCondition) else conditions
    single = [condition for condition in listed if isinstance(condition, TriggerCondition)]
    groups = (
        [single]
        if single
        else [group for group in listed if not isinstance(group, TriggerCondition)]
    )
    if not groups or not all(groups):
        raise UsageError(f"a {point} trigger needs at least one condition")
    built = sg.Trigger(point)
    for group in groups:
        together = sg.ConditionGroup(point)
        for condition in group:
            together.add_condition(condition.build(point))
        built.add_conditiongroup(together)
    return built


def simulation_time(
    value: Number, rule: str = "greaterThan", *, edge: str = "none"
) -> TriggerCondition:
    """`SimulationTimeCondition`: the time since the start, s."""
    return TriggerCondition(
        "simulation time", sg.SimulationTimeCondition(number(value), enum_value("Rule", rule)), edge
    )


def element_state(
    kind: str, name: str, state: str = "endTransition", *, edge: str = "none"
) -> TriggerCondition:
    """`StoryboardElementStateCondition`: an element has a state or passes a transition.

    Args:
        kind: story, act, maneuverGroup, maneuver, event or action.
        name: of the element.
        state: startTransition, runningState, endTransition, completeState, ...
        edge: of the condition.
    """
    element = (
        enum_value("StoryboardElementType", kind),
        name,
        enum_value("StoryboardElementState", state),
    )
    return TriggerCondition(f"{name} {state}", sg.StoryboardElementStateCondition(*element), edge)


def collision(entity: str, other: str, *, edge: str = "none") -> TriggerCondition:
    """`CollisionCondition`: `entity` touches `other`."""
    return TriggerCondition(f"collision with {other}", sg.CollisionCondition(other), edge, entity)


def distance(
    entity: str,
    position: Any,
    value: Number,
    rule: str = "lessThan",
    *,
    kind: str = "euclidianDistance",
    coordinates: str = "entity",
    freespace: bool = True,
    edge: str = "none",
) -> TriggerCondition:
    """`DistanceCondition`: the distance of `entity` to a position, m; see `relative_distance`."""
    condition = sg.DistanceCondition(
        number(value),
        enum_value("Rule", rule),
        position,
        **_measured(kind, coordinates, freespace),
    )
    return TriggerCondition("distance", condition, edge, entity)


def relative_distance(
    entity: str,
    other: str,
    value: Number,
    rule: str = "lessThan",
    *,
    kind: str = "longitudinal",
    coordinates: str = "entity",
    freespace: bool = True,
    edge: str = "none",
) -> TriggerCondition:
    """`RelativeDistanceCondition`: the distance of `entity` to `other`, m.

    Args:
        entity: whose condition it is.
        other: the entity that the distance is measured to.
        value: compared with the distance by `rule`.
        rule: lessThan, greaterThan, ...
        kind: longitudinal, lateral or euclidianDistance.
        coordinates: the system that it is measured in: entity, lane, road, ...
        freespace: between the closest points of the bounding boxes, otherwise between the reference
            points.
        edge: of the condition.
    """
    condition = sg.RelativeDistanceCondition(
        number(value),
        enum_value("Rule", rule),
        enum_value("RelativeDistanceType", kind),
        other,
        freespace=freespace,
        coordinate_system=enum_value("CoordinateSystem", coordinates),
    )
    return TriggerCondition("relative distance", condition, edge, entity)


def traveled_distance(entity: str, value: Number, *, edge: str = "none") -> TriggerCondition:
    """Return a `TraveledDistanceCondition`: `entity` has moved that far (m) since the start."""
    return TriggerCondition(
        "traveled distance", sg.TraveledDistanceCondition(number(value)), edge, entity
    )


def time_headway(
    entity: str,
    other: str,
    value: Number,
    rule: str = "lessThan",
    *,
    kind: str = "euclidianDistance",
    coordinates: str = "entity",
    freespace: bool = True,
    edge: str = "none",
) -> TriggerCondition:
    """`TimeHeadwayCondition`: the distance of `entity` to `other` over the speed of `entity`, s;
    see `relative_distance`."""
    condition = sg.TimeHeadwayCondition(
        other,
        number(value),
        enum_value("Rule", rule),
        **_measured(kind, coordinates, freespace),
    )
    return TriggerCondition("time headway", condition, edge, entity)


def time_to_collision(
    entity: str,
    other: str,
    value: Number,
    rule: str = "lessThan",
    *,
    kind: str = "euclidianDistance",
    coordinates: str = "entity",
    freespace: bool = True,
    edge: str = "none",
) -> TriggerCondition:
    """`TimeToCollisionCondition`: the distance of `entity` to `other` over their closing speed, s;
    see `relative_distance`."""
    condition = sg.TimeToCollisionCondition(
        number(value),
        enum_value("Rule", rule),
        entity=other,
        **_measured(kind, coordinates, freespace),
    )
    return TriggerCondition("time to collision", condition, edge, entity)


def _measured(kind: str, coordinates: str, freespace: bool) -> dict[str, Any]:
    """Return the attributes that define the distance of a condition, see `relative_distance`."""
    return {
        "freespace": freespace,
        "distance_type": enum_value("RelativeDistanceType", kind),
        "coordinate_system": enum_value("CoordinateSystem", coordinates),
    }


class Dynamics(NamedTuple):
    """`TransitionDynamics`: shape and duration of a change.

    Attributes:
        shape: step, linear, sinusoidal or cubic.
        dimension: what `value` is: time (s), distance (m) or rate (the change's unit a second).
        value: see `dimension`.
    """

    shape: str
    dimension: str
    value: Number

    def build(self) -> Any:
        """Return scenariogeneration's object."""
        return sg.TransitionDynamics(
            enum_value("DynamicsShapes", self.shape),
            enum_value("DynamicsDimension", self.dimension),
            number(self.value),
        )


# A step takes no time, but TransitionDynamics requires a dimension and a value.
STEP = Dynamics("step", "time", 0.0)
"""At once."""


def world_position(x: Number, y: Number, z: Number | None = None, h: Number | None = None) -> Any:
    """A position in world coordinates, m and rad."""
    return sg.WorldPosition(*(None if value is None else number(value) for value in (x, y, z, h)))


def lane_position(road: str, lane: str | int, s: Number, offset: Number = 0.0) -> Any:
    """A position on a lane: s along the road and the lateral offset from the lane's centre, m."""
    return sg.LanePosition(number(s), number(offset), str(lane), road)


def relative_lane_position(entity: str, lanes: Number, ds: Number) -> Any:
    """A position so many lanes to the left of an entity's (negative: to the right) and `ds` (m)
    ahead of it, along the road."""
    return sg.RelativeLanePosition(number(lanes), entity, 0.0, number(ds))


def trajectory_position(path: Any, s: Number) -> Any:
    """A position `s` (m) along a `trajectory`, or a catalogue's."""
    return sg.TrajectoryPosition(path, number(s), 0.0)


def teleport(position: Any) -> Any:
    """`TeleportAction`: be somewhere at once."""
    return sg.TeleportAction(position)


def speed(target: Number, dynamics: Dynamics = STEP) -> Any:
    """`SpeedAction` to an absolute speed, m/s."""
    return sg.AbsoluteSpeedAction(number(target), dynamics.build())


class Reaction(NamedTuple):
    """`DynamicConstraints`: greatest acceleration and deceleration (m/s²), and jerk (m/s³)."""

    acceleration: float
    deceleration: float
    jerk: float


def keep_distance(entity: str, distance: Number, limits: Reaction) -> Any:
    """`LongitudinalDistanceAction` that goes on: keep a gap (m) of the boxes behind an entity,
    along the lane, within limits."""
    return sg.LongitudinalDistanceAction(
        entity,
        freespace=True,
        continuous=True,
        max_acceleration=limits.acceleration,
        max_deceleration=limits.deceleration,
        max_acceleration_rate=limits.jerk,
        max_deceleration_rate=limits.jerk,
        distance=number(distance),
        coordinate_system=enum_value("CoordinateSystem", "lane"),
        displacement=enum_value("LongitudinalDisplacement", "trailingReferencedEntity"),
    )


def speed_profile(
    entries: Sequence[tuple[Number, Number]],
    following_mode: str = "position",
    jerk: Number | None = None,
) -> Any:
    """`SpeedProfileAction` (1.2 and later): speeds (m/s), each with the time (s) that it takes from
    the one before.

    Args:
        following_mode: position (exactly) or follow (within the limits of what vehicles do).
        jerk: greatest rate of change of the acceleration, m/s³; None for no limit.
    """
    if not entries:
        raise UsageError("a speed profile needs at least one entry")
    speeds, times = zip(*((number(value), number(time)) for value, time in entries), strict=True)
    rate = None if jerk is None else number(jerk)
    limits = (
        None
        if rate is None
        else sg.DynamicsConstraints(max_acceleration_rate=rate, max_deceleration_rate=rate)
    )
    return sg.SpeedProfileAction(
        list(speeds), enum_value("FollowingMode", following_mode), list(times), limits
    )


def lane_change(
    lane: int | str,
    dynamics: Dynamics,
    *,
    relative_to: str | None = None,
    offset: Number | None = None,
) -> Any:
    """`LaneChangeAction`.

    Args:
        lane: the target lane's id, or the number of lanes to the left of the entity `relative_to`
            (negative: to the right).
        dynamics: how the lateral movement comes about.
        relative_to: the entity that `lane` counts from.
        offset: of the target from the lane's centre, m.
    """
    target_offset = None if offset is None else number(offset)
    if relative_to is None:
        return sg.AbsoluteLaneChangeAction(lane, dynamics.build(), target_offset)
    return sg.RelativeLaneChangeAction(lane, relative_to, dynamics.build(), target_offset)


def trajectory(
    name: str,
    time: Sequence[float],
    x: Sequence[float],
    y: Sequence[float],
    z: Sequence[float] | None = None,
    h: Sequence[float] | None = None,
) -> Any:
    """A polyline `Trajectory` from arrays of the same length: time (s), position of the reference
    point (m), heading (rad).

    Raises:
        UsageError: fewer than two points, arrays of different lengths, or times that go back.
    """
    columns = [column for column in (time, x, y, z, h) if column is not None]
    if len({len(column) for column in columns}) > 1 or len(time) < 2:
        raise UsageError(
            f"the trajectory {name!r} needs arrays of one length, of two points at least"
        )
    if (np.diff(time) < 0.0).any():
        raise UsageError(f"the times of the trajectory {name!r} must not go back")
    return PolylineTrajectory(
        name,
        {
            key: column
            for key, column in zip("txyzh", (time, x, y, z, h), strict=True)
            if column is not None
        },
    )


def follow_trajectory(
    path: Any, following_mode: str = "position", offset: Number = 0.0, domain: str = "relative"
) -> Any:
    """`FollowTrajectoryAction` along a `trajectory` (or a catalogue's) at its times.

    Args:
        path: the trajectory.
        following_mode: position (exactly) or follow (by steering).
        offset: added to the times, s.
        domain: what the times count from: the action's start (relative) or the scenario's
            (absolute).
    """
    timing = enum_value("ReferenceContext", domain), 1.0, number(offset)
    return sg.FollowTrajectoryAction(path, enum_value("FollowingMode", following_mode), *timing)


def follow_path(path: Any, start: Number) -> Any:
    """`FollowTrajectoryAction` without times: along a `trajectory` (or a catalogue's) at the speed
    that other actions give.

    Args:
        path: the trajectory.
        start: how far along it this begins, m.
    """
    return sg.FollowTrajectoryAction(
        path, enum_value("FollowingMode", "position"), initialDistanceOffset=number(start)
    )


def route(name: str, waypoints: Sequence[Any]) -> Any:
    """`Route` by the shortest ways from position to position.

    Raises:
        UsageError: fewer than two positions.
    """
    if len(waypoints) < 2:
        raise UsageError(f"the route {name!r} needs two waypoints at least")
    built = sg.Route(name)
    for position in waypoints:
        built.add_waypoint(position, enum_value("RouteStrategy", "shortest"))
    return built


def assign_route(path: Any) -> Any:
    """`AssignRouteAction`: take a `route`, or a catalogue's."""
    return sg.AssignRouteAction(path)


def add_entity(name: str, position: Any) -> Any:
    """`AddEntityAction`: bring an entity into the scenario."""
    return sg.AddEntityAction(name, position)


def delete_entity(name: str) -> Any:
    """`DeleteEntityAction`: take an entity out of the scenario."""
    return sg.DeleteEntityAction(name)


def event(name: str, actions: Sequence[Any], start: Conditions, priority: str = "override") -> Any:
    """`Event`: actions that begin together when the conditions of `start` hold."""
    built = sg.Event(name, enum_value("Priority", priority))
    for index, action in enumerate(actions):
        built.add_action(f"{name} action {index + 1}", action)
    built.add_trigger(trigger(start, "start"))
    return built


def maneuver(name: str, events: Sequence[Any], parameters: Sequence[Any] = ()) -> Any:
    """`Maneuver`: events of one participant; with `parameter` declarations of its own where it is
    for a catalogue."""
    built = sg.Maneuver(name, declarations(parameters) if parameters else None)
    for event in events:
        built.add_event(event)
    return built
