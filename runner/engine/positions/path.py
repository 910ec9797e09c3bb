"""Positions on routes and trajectories."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

from runner.engine.compile import registry
from runner.engine.compile.element import Position
from runner.engine.motion import routes
from runner.engine.motion.paths import tangent
from runner.engine.motion.placement import Placement, in_world
from runner.engine.motion.trajectories import Trajectory
from runner.engine.positions.lane import misplaced
from runner.engine.positions.world import Orientation, on_road
from xodr.model import RoadError, WorldPose
from xosc.rules.positions import ROAD_LENGTH_UID

if TYPE_CHECKING:
    from runner.engine.compile.protocols import Surroundings
    from runner.engine.compile.registry import Context
    from runner.engine.participants.entity import Entity
    from xodr.graph.routes import RoadPath
    from xodr.model import RoadPoint
    from xosc.document.node import Node

_TOLERANCE = 1e-3
"""Tolerance (m) of positions beyond the end of a route or trajectory: files are rounded."""


@registry.position("RoutePosition")
class RoutePosition(Position):
    """A distance along a route, with a t or a lane of the road there; or where an entity is on the
    route.

    pathS counts in s from the first waypoint. t, laneId and laneOffset are those of the route's
    first road, whose reference line is thought to go on along the route: on roads that run the
    other way they are mirrored. Relative orientations count
    from the route's direction of travel.
    """

    def __init__(self, node: Node, context: Context) -> None:
        super().__init__(node)
        self.network = context.need_network(node)
        self.route = routes.Route.from_xml(node.need("RouteRef", "Route"), context)
        self.orientation = Orientation.from_xml(node, context)
        self.where = node.need("InRoutePosition").only()
        self.entity = context.entity(self.where) if self.where.tag == "FromCurrentEntity" else None
        if self.route.fixed and self.entity is None:
            self.fixed = self._on(self.route.path(None), context.repair)

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> RoutePosition:
        """Read the route and the place on it."""
        return cls(node, context)

    def references(self) -> tuple[Entity, ...]:
        """The entities that the route or the place refer to."""
        return (*self.route.references(), *([self.entity] if self.entity is not None else []))

    def resolve(self, run: Surroundings | None, actor: Entity | None = None) -> Placement:
        """Return the current place."""
        if self.fixed is not None:
            return self.fixed
        path = self.route.path(run, actor)
        if self.entity is not None:
            return self._at_entity(path, self.current(self.entity), run)
        assert run is not None
        remarks = run.remarks
        return self._on(
            path, lambda node, rule, text, cause: remarks.add(node.remark(rule, text, cause))
        )

    def _at_entity(self, path: RoadPath, entity: Entity, run: Surroundings | None) -> Placement:
        point = run.roads.road_point(entity) if run is not None else None
        distance = path.position(point) if point is not None else None
        if point is None or distance is None:
            raise self.node.invalid(f"{entity.name!r} is not on the route {self.route.name!r}")
        return self._placement(point, path.at(distance)[2])

    def _on(self, path: RoadPath, repair: Callable[[Node, str, str, str], None]) -> Placement:
        where = self.where
        distance = where.finite("pathS")
        if not -_TOLERANCE <= distance <= path.length + _TOLERANCE:
            what = (
                f"pathS={distance:g} is not on the route {self.route.name!r}, which is "
                f"{path.length:.2f} m long"
            )
            end = "beginning" if distance < 0.0 else "end"
            repair(
                where,
                ROAD_LENGTH_UID,
                f"{what}; its {end} is assumed",
                misplaced(max(-distance, distance - path.length)),
            )
        road_id, s, forward = path.at(distance)
        road = self.network.road(road_id)
        side = 1 if forward == path.legs[0].forward else -1
        if where.tag == "FromRoadCoordinates":
            return self._placement(road.point(s, side * where.finite("t")), forward)
        try:
            point = road.lane_point(
                s, side * int(where.int("laneId")), side * where.finite("laneOffset", 0.0)
            )
            return self._placement(point, forward)
        except RoadError as error:
            raise where.invalid(error.message) from None

    def _placement(self, point: RoadPoint, forward: bool) -> Placement:
        heading = self.network.road(point.road_id).heading(point.s)
        return on_road(
            self.network, point, heading if forward else heading + math.pi, self.orientation
        )


@registry.position("TrajectoryPosition")
class TrajectoryPosition(Position):
    """s along a trajectory and t to its left; relative orientations count from its tangent."""

    def __init__(self, node: Node, context: Context) -> None:
        super().__init__(node)
        self.context = context
        self.trajectory = Trajectory.from_xml(node.need("TrajectoryRef", "Trajectory"), context)
        self.s, self.t = node.finite("s"), node.finite("t", 0.0)
        self.orientation = Orientation.from_xml(node, context)
        if self.trajectory.fixed is not None:
            self.fixed = self.resolve(None)

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> TrajectoryPosition:
        """Read the trajectory and the place on it."""
        return cls(node, context)

    def references(self) -> tuple[Entity, ...]:
        """The entities that the trajectory refers to."""
        return self.trajectory.references()

    def resolve(self, run: Surroundings | None, actor: Entity | None = None) -> Placement:
        """Return the current place."""
        if self.fixed is not None:
            return self.fixed
        track = self.trajectory.track(run, actor)
        path = track.path
        if not -_TOLERANCE <= self.s <= path.length + _TOLERANCE:
            raise self.node.invalid(
                f"s={self.s:g} is not on the trajectory {self.trajectory.name!r}, which is "
                f"{path.length:.2f} m long"
            )
        pose, h = path.at(self.s), tangent(path, self.s)
        x, y = pose.x - self.t * math.sin(h), pose.y + self.t * math.cos(h)
        orientation = self.orientation
        pose = WorldPose(
            x,
            y,
            pose.z,
            orientation.heading(h),
            pose.pitch + orientation.pitch,
            pose.roll + orientation.roll,
        )
        return in_world(self.context.network, pose, z_known=not track.grounded)
