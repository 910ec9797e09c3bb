"""Conditions, for events to start and for a storyboard to stop."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from scenariogeneration import xosc as sg

from schemas.errors import UsageError
from xosc.maneuvers.base import Number, enum_value, number


@dataclass(frozen=True)
class Condition:
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
        """As scenariogeneration has it, in a trigger to "start" or to "stop"."""
        edge, delay = enum_value("ConditionEdge", self.edge), number(self.delay)
        if self.entity is None:
            return sg.ValueTrigger(self.name, delay, edge, self.condition, point)
        return sg.EntityTrigger(f"{self.name} of {self.entity}", delay, edge, self.condition, self.entity, triggeringpoint=point)


Conditions = Condition | Sequence[Condition] | Sequence[Sequence[Condition]]
"""A condition; conditions that have to hold together; or groups of such, of which one is enough."""


def trigger(conditions: Conditions, point: str) -> Any:
    """A trigger that fires when its conditions hold."""
    listed = [conditions] if isinstance(conditions, Condition) else conditions
    single = [each for each in listed if isinstance(each, Condition)]
    groups = [single] if single else [each for each in listed if not isinstance(each, Condition)]
    if not groups or not all(groups):
        raise UsageError(f"a {point} trigger needs at least one condition")
    built = sg.Trigger(point)
    for group in groups:
        together = sg.ConditionGroup(point)
        for condition in group:
            together.add_condition(condition.build(point))
        built.add_conditiongroup(together)
    return built


def simulation_time(value: Number, rule: str = "greaterThan", *, edge: str = "none") -> Condition:
    """`SimulationTimeCondition`: the time since the start, s."""
    return Condition("simulation time", sg.SimulationTimeCondition(number(value), enum_value("Rule", rule)), edge)


def element_state(kind: str, name: str, state: str = "endTransition", *, edge: str = "none") -> Condition:
    """`StoryboardElementStateCondition`: an element has a state or passes a transition.

    Args:
        kind: story, act, maneuverGroup, maneuver, event or action.
        name: of the element.
        state: startTransition, runningState, endTransition, completeState, ...
        edge: of the condition.
    """
    element = enum_value("StoryboardElementType", kind), name, enum_value("StoryboardElementState", state)
    return Condition(f"{name} {state}", sg.StoryboardElementStateCondition(*element), edge)


def collision(entity: str, other: str, *, edge: str = "none") -> Condition:
    """`CollisionCondition`: `entity` touches `other`."""
    return Condition(f"collision with {other}", sg.CollisionCondition(other), edge, entity)


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
) -> Condition:
    """`DistanceCondition`: the distance of `entity` to a position, m; see `relative_distance`."""
    condition = sg.DistanceCondition(
        number(value),
        enum_value("Rule", rule),
        position,
        **_measured(kind, coordinates, freespace),
    )
    return Condition("distance", condition, edge, entity)


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
) -> Condition:
    """`RelativeDistanceCondition`: the distance of `entity` to `other`, m.

    Args:
        entity: whose condition it is.
        other: the entity that the distance is measured to.
        value: compared with the distance by `rule`.
        rule: lessThan, greaterThan, ...
        kind: longitudinal, lateral or euclidianDistance.
        coordinates: the system that it is measured in: entity, lane, road, ...
        freespace: between the closest points of the bounding boxes, otherwise between the reference points.
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
    return Condition("relative distance", condition, edge, entity)


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
) -> Condition:
    """`TimeHeadwayCondition`: the distance of `entity` to `other` over the speed of `entity`, s; see `relative_distance`."""
    condition = sg.TimeHeadwayCondition(
        other,
        number(value),
        enum_value("Rule", rule),
        **_measured(kind, coordinates, freespace),
    )
    return Condition("time headway", condition, edge, entity)


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
) -> Condition:
    """`TimeToCollisionCondition`: the distance of `entity` to `other` over their closing speed, s; see `relative_distance`."""
    condition = sg.TimeToCollisionCondition(
        number(value),
        enum_value("Rule", rule),
        entity=other,
        **_measured(kind, coordinates, freespace),
    )
    return Condition("time to collision", condition, edge, entity)


def _measured(kind: str, coordinates: str, freespace: bool) -> dict[str, Any]:
    """How a condition measures its distance, see `relative_distance`."""
    return {
        "freespace": freespace,
        "distance_type": enum_value("RelativeDistanceType", kind),
        "coordinate_system": enum_value("CoordinateSystem", coordinates),
    }
