"""Routes for lane following (OpenSCENARIO XML 1.4, class RoutingAction).

A route (`Entity.route`) decides at junctions; it holds until another one is assigned.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

from runner.engine.compile import registry
from runner.engine.compile.element import PrivateAction
from runner.engine.compile.protocols import Rest, Running
from runner.engine.motion.lane_gaps import blocker
from runner.engine.motion.routes import AssignedRoute, RandomRoute, Route
from runner.engine.positions.lane import LAYERS

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from runner.engine.compile.element import Position
    from runner.engine.compile.protocols import Run
    from runner.engine.compile.registry import Context
    from runner.engine.motion.placement import Placement
    from runner.engine.participants.entity import Entity
    from xodr.graph.network import RoadNetwork
    from xodr.model import RoadPoint
    from xosc.document.node import Node

_REACHED = 1e-6
_ALMOST = 0.1
"""Way (m) that counts as none where the run stops before the end of a route, beside that of a step
"""
_SLOWEST = 0.1
"""Speed (m/s) below which a lane change takes as long as with it"""
LANES_UID = "xosc.toolchain:xosc:1.0.0:routing.lanes_of_waypoints_are_reached"


@registry.action("AssignRouteAction")
class AssignRouteAction(PrivateAction):
    """Gives the actor a route to follow; complete at once.

    A waypoint asks for its lane as well. The actor takes the connecting roads that lead there, and
    changes lanes where it has to and the road allows it, until an action moves it sideways.
    Waypoints that it can't pass in their lanes are remarks.
    """

    run_by_run = True

    def __init__(self, route: Route) -> None:
        self.route = route

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> AssignRouteAction:
        """Read the route."""
        return cls(Route.from_xml(node.need("Route"), context))

    def references(self) -> Iterable[Entity]:
        """Entities that the waypoints are relative to."""
        return self.route.references()

    def start(self, actor: Entity, run: Run) -> None:
        """Assign."""
        path = self.route.path(run, actor)
        node, closed = self.route.node, self.route.closed
        route = AssignedRoute(
            path, closed, self.route.network, _voice(node, actor, run), _Gaps(run)
        )
        actor.controls.route = route
        nodes = [waypoint.node for waypoint in self.route.waypoints]
        tell_missed(route, actor, run, [*nodes, nodes[0]])


class _Gaps:
    """Waiting for gaps beside the participants of a run."""

    def __init__(self, run: Run) -> None:
        self._run = run
        self._blocker: Entity | None = None

    def __call__(self, entity: Entity, lane: int, way: float) -> bool:
        """Whether one is in the way of a change to a lane along a way (m); a new one is logged."""
        run = self._run
        present = (entity for entity in run.entities.values() if entity.active and entity.placed)
        duration = way / max(abs(entity.speed), _SLOWEST)
        found = blocker(entity, lane, duration, present, run.roads)
        if found is not None and found is not self._blocker:
            text = f"waits for a gap at {found.name} to change to lane {lane}"
            run.note("route", entity.name, text)
        self._blocker = found
        return found is not None


def _voice(node: Node, actor: Entity, run: Run) -> Callable[[str], object]:
    """Function that remarks on a route of an actor, by a sentence without its subject."""
    return lambda text: run.remarks.note(node.remark(LANES_UID, f"{actor.name} {text}"))


def tell_missed(route: AssignedRoute, actor: Entity, run: Run, nodes: Sequence[Node]) -> None:
    """Remark on a route that leads where the actor does not drive, and on waypoints that it can't
    pass in their lanes.

    Args:
        nodes: elements of the waypoints in order, the first included.
    """
    here, legs = run.roads.road_point(actor), route.path.legs
    if route.path.lanes is None and actor.declared.kind == "vehicle":
        text = f"traffic leads {actor.name} no way along this route: it follows roads, not lanes"
        run.remarks.note(nodes[0].remark(LANES_UID, text))
    leg = next((leg for leg in legs if here is not None and leg.road_id == here.road_id), None)
    if leg is not None and here is not None and actor.on_lane:
        ahead = (actor.direction > 0) == (actor.speed >= 0.0)
        if ahead != leg.forward and leg.length > _REACHED:
            text = (
                f"{actor.name} drives away from its route at s = {here.s:.1f} m of road "
                f"{here.road_id}"
            )
            run.remarks.note(nodes[0].remark(LANES_UID, f"{text}; it does not turn round"))
    for checkpoint in route.missed(here) if here is not None else ():
        road = route.path.legs[checkpoint.leg].road_id
        text = (
            f"no lane leads {actor.name} to lane {checkpoint.lane} of road {road} at s = "
            f"{checkpoint.s:.1f} m"
        )
        run.remarks.note(
            nodes[checkpoint.number].remark(LANES_UID, f"{text}; it passes there in another lane")
        )


@registry.action("RandomRouteAction")
class RandomRouteAction(PrivateAction):
    """Lets the actor choose its way at random at every junction; complete at once."""

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> RandomRouteAction:
        """Build the action; its element has no attributes."""
        context.need_network(node)
        return cls()

    def start(self, actor: Entity, run: Run) -> None:
        """Assign."""
        actor.controls.route = RandomRoute(run.random)


@registry.action("PreferredLaneLayerAction")
class PreferredLaneLayerAction(PrivateAction):
    """Has the actor keep to a layer of lanes wherever none is named; complete at once.

    Where its lane is of the other layer, it keeps to that until the layers are one again.
    """

    def __init__(self, layer: str) -> None:
        self.layer = layer

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> PreferredLaneLayerAction:
        """Read the layer."""
        context.need_network(node)
        return cls(node.choice("layer", LAYERS))

    def start(self, actor: Entity, run: Run) -> None:
        """Prefer the layer from now on."""
        run.roads.prefer(actor, self.layer)
        run.note("preferredLaneLayer", actor.name, self.layer)


@registry.action("AcquirePositionAction")
class AcquirePositionAction(PrivateAction):
    """Leads the actor to a position by the shortest way; complete when it is there, or has got
    another route.

    The lane is that of the position, as with the waypoints of a route.
    """

    run_by_run = True

    def __init__(self, node: Node, position: Position, network: RoadNetwork) -> None:
        self.node, self.position, self.network = node, position, network

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> AcquirePositionAction:
        """Read the position."""
        return cls(node, context.position(node.need("Position")), context.need_network(node))

    def references(self) -> Iterable[Entity]:
        """Entities that the position is relative to."""
        return self.position.references()

    def check(self, actor: Entity, starts: Sequence[Placement] | None) -> None:
        """A way must lead to the position from a place where the actor can be put."""
        if self.position.fixed is None or not starts:
            return
        there = self._point(self.position.fixed)
        if not any(self.network.route([self._point(start), there]) for start in starts):
            raise self._unreachable(actor)

    def start(self, actor: Entity, run: Run) -> Running | None:
        """Find the way and assign it."""
        here = run.roads.road_point(actor)
        there = self._point(self.position.resolve(run, actor))
        path = self.network.route([here, there]) if here is not None else None
        if path is None:
            raise self._unreachable(actor)
        say = _voice(self.node, actor, run)
        route = actor.controls.route = AssignedRoute(path, say=say, obstructed=_Gaps(run))
        tell_missed(route, actor, run, [self.node, self.node])
        return _Acquiring(actor, run, route, there)

    def _point(self, place: Placement) -> RoadPoint:
        return place.point or self.network.locate(place.x, place.y, place.z)

    def _unreachable(self, actor: Entity) -> Exception:
        return self.node.invalid(f"no way leads {actor.name!r} to the position")


class _Acquiring(Running):
    """Drive to a position along a route to it."""

    def __init__(self, actor: Entity, run: Run, route: AssignedRoute, there: RoadPoint) -> None:
        self.actor, self.run, self.route, self._there = actor, run, route, there
        self.length = route.path.length

    def step(self, dt: float) -> bool:
        """Return whether this step leads to the end of the route."""
        if self.actor.controls.route is not self.route:
            return True
        point = self.run.roads.road_point(self.actor)
        gone = self.route.path.position(point, self.length) if point is not None else None
        if gone is None:
            return False
        step = abs(self.actor.controls.target_speed) * dt
        self.route.reached = gone + step >= self.length - _REACHED
        return self.route.reached

    def rest(self) -> Rest | None:
        """The position and its lane; what is left is the width (m) of the lanes between, or the way
        (m). None with another route."""
        there, asked = self._there, self.route.destination
        point = self.run.roads.road_point(self.actor)
        if point is None or self.actor.controls.route is not self.route:
            return None
        goal = f"s = {there.s:.1f} m of road {there.road_id}"
        if not self.route.reached:
            gone = self.route.path.position(point, self.length)
            left = math.inf if gone is None else max(self.length - gone, 0.0)
            before = "no place of its route" if gone is None else f"{left:.1f} m before it"
            return Rest(goal, before, left, _ALMOST + abs(self.actor.speed) * self.run.dt)
        if asked is None:
            return Rest(goal, goal, 0.0, _REACHED)
        left = 0.0 if point.lane_id == asked else abs(point.t - there.t)
        return Rest(f"lane {asked} at {goal}", f"it in lane {point.lane_id}", left, _REACHED)
