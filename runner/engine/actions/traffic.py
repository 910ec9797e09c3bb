"""TrafficSourceAction, TrafficSinkAction, TrafficSwarmAction, TrafficAreaAction and
TrafficStopAction.

They bring in traffic that SUMO's drivers drive (`runner.engine.worlds.traffic`), and take out only
such traffic, never what the scenario declares. None of them ends by itself: a TrafficStopAction of
the same trafficName ends it (without a name: all of them); what is on the road then stays until it
leaves the road network.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

from runner.engine.compile import registry
from runner.engine.compile.element import GlobalAction
from runner.engine.compile.protocols import Running
from runner.engine.participants.boxes import Spot, gap
from runner.engine.worlds.traffic import (
    Ellipse,
    Mix,
    Place,
    PlaneRegion,
    Polygon,
    RoadRanges,
    Spawner,
    categories,
    place_on,
    places_of,
)

if TYPE_CHECKING:
    from runner.engine.compile.element import Position
    from runner.engine.compile.protocols import Run
    from runner.engine.compile.registry import Context
    from runner.engine.participants.entity import Entity
    from xosc.document.node import Node

_REFILL = 1.0
"""Time (s) between two looks at whether swarm or area are complete."""
_EPSILON = 1e-9


def _name(node: Node) -> str:
    """trafficName, or else what the action is."""
    above = node.parent
    given = above.get("trafficName", "") if above is not None else ""
    return given or node.tag.removesuffix("Action")


def _amount(node: Node, attribute: str) -> float:
    """A finite attribute that must not be negative."""
    value = float(node.finite(attribute))
    if value < 0.0:
        raise node.invalid(f"{attribute}={value:g} must not be negative")
    return value


def _count(node: Node, attribute: str) -> int:
    """A whole number that must not be negative."""
    value = int(node.int(attribute))
    if value < 0:
        raise node.invalid(f"{attribute}={value} must not be negative")
    return value


def _rate(node: Node) -> float:
    """Return the rate (1/s); infinite if the attribute is absent."""
    return math.inf if node.float("rate", math.inf) == math.inf else _amount(node, "rate")


def _due(rate: float, elapsed: float) -> float:
    """Return the number of entities due a time (s) after the first one."""
    return rate if rate == math.inf else rate * elapsed + _EPSILON


def _optional(node: Node, *attributes: str) -> float | None:
    """The first of some attributes that is there."""
    return next((_amount(node, name) for name in attributes if node.has(name)), None)


class _Running(Running, ABC):
    """Shared part of running traffic actions; TrafficStopAction ends them."""

    def __init__(self, name: str, run: Run) -> None:
        self.name, self.run = name, run
        self.stopped = False

    def step(self, dt: float) -> bool:
        """Act, unless stopped."""
        if not self.stopped:
            self.act(dt)
        return self.stopped

    @abstractmethod
    def act(self, dt: float) -> None:
        """Bring in and take out."""


@registry.action("TrafficSourceAction")
class TrafficSourceAction(GlobalAction):
    """Brings in traffic around a position: the first at once, then `rate` a second, while there is
    room.

    It appears on any lane within `radius`, with `speed` (1.0: `velocity`), or else as fast as is
    allowed there.
    """

    def __init__(self, node: Node, name: str, mix: Mix, position: Position) -> None:
        self.node, self.name, self.mix, self.position = node, name, mix, position
        self.radius, self.rate = _amount(node, "radius"), _amount(node, "rate")
        self.speed = _optional(node, "speed", "velocity")

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> TrafficSourceAction:
        """Read position and traffic."""
        context.need_network(node)
        return cls(node, _name(node), Mix.from_xml(node), context.position(node.need("Position")))

    def start(self, run: Run) -> _Source:
        """Begin."""
        return _Source(self, run)


class _Source(_Running):
    """A source at work."""

    def __init__(self, action: TrafficSourceAction, run: Run) -> None:
        super().__init__(action.name, run)
        self.action, self.spawner = action, Spawner(action.name, action.mix)
        self.elapsed, self.made = 0.0, 0
        self.places = self._places()

    def _places(self) -> list[Place]:
        """Places within the radius; the one nearest to the position where no other is that near."""
        run, action = self.run, self.action
        assert run.roads.network is not None
        centre = action.position.resolve(run)
        near = Ellipse(centre.x, centre.y, 0.0, action.radius, action.radius)
        places = [
            place for place in places_of(run.roads.network) if near.contains(place.x, place.y)
        ]
        if places:
            return places
        point = centre.point or run.roads.network.locate(centre.x, centre.y, centre.z, centre.h)
        if not run.roads.network.on_road(point):
            raise action.node.invalid("there is no lane within the radius of the position")
        return [place_on(run.roads.network, point.road_id, point.lane_id, point.s)]

    def act(self, dt: float) -> None:
        """Bring in due vehicles."""
        given = self.action.speed
        while self.made <= _due(self.action.rate, self.elapsed):
            if not self.spawner.spawn(
                self.run, self.places, lambda place: place.speed if given is None else given
            ):
                break
            self.made += 1
        self.elapsed += dt


@registry.action("TrafficSinkAction")
class TrafficSinkAction(GlobalAction):
    """Takes out traffic whose boxes come within `radius` of a position, `rate` a second at most.

    With a TrafficDefinition it takes only vehicles of the categories in it.
    """

    def __init__(self, node: Node, position: Position) -> None:
        self.name, self.position = _name(node), position
        self.radius, self.rate = _amount(node, "radius"), _rate(node)
        definition = node.find("TrafficDefinition")
        self.categories = categories(definition) if definition is not None else None

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> TrafficSinkAction:
        """Read position and traffic."""
        return cls(node, context.position(node.need("Position")))

    def start(self, run: Run) -> _Sink:
        """Begin."""
        return _Sink(self, run)


class _Sink(_Running):
    """A sink at work."""

    def __init__(self, action: TrafficSinkAction, run: Run) -> None:
        super().__init__(action.name, run)
        self.action, self.place = action, action.position.resolve(run)
        self.elapsed, self.taken = 0.0, 0

    def act(self, dt: float) -> None:
        """Take out participants that are due."""
        for entity in [entity for entity in self.run.entities.values() if entity.spawned]:
            if self.taken > _due(self.action.rate, self.elapsed):
                break
            if self._takes(entity):
                self.run.note("sink", entity.name, f"taken out by {self.name}")
                self.run.despawn(entity)
                self.taken += 1
        self.elapsed += dt

    def _takes(self, entity: Entity) -> bool:
        categories = self.action.categories
        if categories is not None and entity.declared.category not in categories:
            return False
        return gap(entity, Spot(self.place.x, self.place.y, entity.z, 0.0)) <= self.action.radius


class _Population(_Running):
    """Keeps a number of participants in a region; those that leave it are taken out."""

    def __init__(self, name: str, run: Run, mix: Mix, number: int) -> None:
        super().__init__(name, run)
        self.spawner, self.number = Spawner(name, mix), number
        self._wait = 0.0

    @abstractmethod
    def region(self) -> PlaneRegion:
        """Current region of the traffic."""

    def places(self) -> list[Place]:
        """Current places of appearance."""
        assert self.run.roads.network is not None
        region = self.region()
        return [
            place
            for place in places_of(self.run.roads.network)
            if region.contains(place.x, place.y)
        ]

    def candidates(self, places: list[Place]) -> list[Place]:
        """Return the places where the next entity may appear."""
        return places

    def speed(self, place: Place) -> float:
        """Return the initial speed (m/s) at a place."""
        return place.speed

    def act(self, dt: float) -> None:
        """Take out those that have left, and from time to time fill up."""
        region = self.region()
        for entity in self.spawner.present():
            if not region.contains(entity.x, entity.y):
                self.run.note("left", entity.name, f"has left {self.name}")
                self.run.despawn(entity)
        self._wait -= dt
        if self._wait <= _EPSILON:
            self._wait = _REFILL
            self.fill()

    def fill(self) -> None:
        """Add the missing participants while there is room."""
        missing = self.number - len(self.spawner.present())
        places = self.places() if missing > 0 else []
        while missing > 0 and self.spawner.spawn(self.run, self.candidates(places), self.speed):
            missing -= 1


@registry.action("TrafficSwarmAction")
class TrafficSwarmAction(GlobalAction):
    """Keeps traffic around an entity: in an ellipse that moves with it, appearing outside a circle
    around it.

    The ellipse's centre lies `offset` ahead of the entity, its major axis along the entity's.
    """

    def __init__(self, node: Node, context: Context) -> None:
        self.name, self.mix = _name(node), Mix.from_xml(node)
        self.central = context.entity(node.need("CentralObject"))
        self.major, self.minor = _amount(node, "semiMajorAxis"), _amount(node, "semiMinorAxis")
        self.inner, self.offset = _amount(node, "innerRadius"), node.finite("offset")
        self.number = _count(node, "numberOfVehicles")
        self.speeds = _speeds(node)
        travel = node.find("DirectionOfTravelDistribution")
        self.same = _share(travel) if travel is not None else None

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> TrafficSwarmAction:
        """Read what the swarm is."""
        context.need_network(node)
        return cls(node, context)

    def start(self, run: Run) -> _Swarm:
        """Begin."""
        return _Swarm(self, run)


def _speeds(node: Node) -> tuple[float, float] | None:
    """Lowest and highest speed (m/s) at the beginning: InitialSpeedRange, or 1.0's velocity."""
    limits = node.find("InitialSpeedRange")
    if limits is None:
        velocity = _optional(node, "velocity")
        return None if velocity is None else (velocity, velocity)
    low, high = _amount(limits, "lowerLimit"), _amount(limits, "upperLimit")
    if low > high:
        raise limits.invalid("lowerLimit exceeds upperLimit")
    return low, high


def _share(node: Node) -> float:
    """Share of those that travel as the central object does."""
    same, opposite = _amount(node, "same"), _amount(node, "opposite")
    if same + opposite <= 0.0:
        raise node.invalid("same and opposite must not both be 0")
    return same / (same + opposite)


class _Swarm(_Population):
    """A swarm at work."""

    def __init__(self, action: TrafficSwarmAction, run: Run) -> None:
        super().__init__(action.name, run, action.mix, action.number)
        self.action = action

    def act(self, dt: float) -> None:
        """Keep the number while the central object exists."""
        if self.action.central.active and self.action.central.placed:
            super().act(dt)

    def region(self) -> PlaneRegion:
        """The ellipse."""
        action, centre = self.action, self.action.central
        x, y = (
            centre.x + action.offset * math.cos(centre.h),
            centre.y + action.offset * math.sin(centre.h),
        )
        return Ellipse(x, y, centre.h, action.major, action.minor)

    def places(self) -> list[Place]:
        """Places in the ellipse, outside the circle."""
        action, centre = self.action, self.action.central
        inner = Ellipse(centre.x, centre.y, 0.0, action.inner, action.inner)
        return [place for place in super().places() if not inner.contains(place.x, place.y)]

    def candidates(self, places: list[Place]) -> list[Place]:
        """Places in one direction of travel, drawn by the shares where they are given."""
        if self.action.same is None:
            return places
        same = self.run.random.random() < self.action.same
        return [
            place for place in places if (math.cos(place.h - self.action.central.h) > 0.0) == same
        ]

    def speed(self, place: Place) -> float:
        """Speed drawn from the given range."""
        limits = self.action.speeds
        return place.speed if limits is None else self.run.random.uniform(*limits)


@registry.action("TrafficAreaAction")
class TrafficAreaAction(GlobalAction):
    """Fills an area with traffic: once, which ends the action, or (`continuous`) keeping it filled.

    The area is a polygon, or stretches of road with some of their lanes or all.
    """

    def __init__(self, node: Node, context: Context) -> None:
        self.network = context.need_network(node)
        self.name, self.mix = _name(node), Mix.from_xml(node)
        self.number, self.continuous = _count(node, "numberOfEntities"), node.bool("continuous")
        area = node.need("TrafficArea")
        polygon, ranges = area.find("Polygon"), area.children("RoadRange")
        self.corners: list[Position] = []
        self.region: PlaneRegion | None = (
            RoadRanges.from_xml(ranges, self.network) if ranges else None
        )
        if polygon is not None:
            self.corners = [context.position(corner) for corner in polygon.children("Position")]
        if len(self.corners) < 3 and not ranges:
            raise area.invalid(
                "a Polygon of three positions or more, or a RoadRange, is expected inside"
            )

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> TrafficAreaAction:
        """Read area and traffic."""
        return cls(node, context)

    def start(self, run: Run) -> _Area:
        """Begin; the corners of a polygon are where they are now."""
        corners = [corner.resolve(run) for corner in self.corners]
        return _Area(
            self, run, self.region or Polygon([(corner.x, corner.y) for corner in corners])
        )


class _Area(_Population):
    """An area at work."""

    def __init__(self, action: TrafficAreaAction, run: Run, region: PlaneRegion) -> None:
        super().__init__(action.name, run, action.mix, action.number)
        self._continuous, self._region = action.continuous, region
        self._places: list[Place] | None = None

    def region(self) -> PlaneRegion:
        """The area."""
        return self._region

    def places(self) -> list[Place]:
        """Places, which stay the same."""
        if self._places is None:
            self._places = super().places()
        return self._places

    def step(self, dt: float) -> bool:
        """Complete at once unless continuous."""
        return super().step(dt) or not self._continuous


@registry.action("TrafficStopAction")
class TrafficStopAction(GlobalAction):
    """Ends the traffic actions of its trafficName, or all without one; present vehicles stay."""

    def __init__(self, name: str | None) -> None:
        self.name = name

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> TrafficStopAction:
        """Read the name, and find the entity it refers to."""
        above = node.parent
        name = above.get("trafficName", None) if above is not None else None
        others = [
            other
            for other in context.document.node.iter("TrafficAction")
            if other.find("TrafficStopAction") is None
        ]
        if name is not None and name not in {other.get("trafficName", None) for other in others}:
            raise node.invalid(f"no traffic action of this scenario has the trafficName {name!r}")
        return cls(name)

    def start(self, run: Run) -> None:
        """Stop at once."""
        for running in run.running:
            if isinstance(running, _Running) and self.name in (None, running.name):
                running.stopped = True
