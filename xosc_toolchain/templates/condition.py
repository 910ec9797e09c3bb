"""AcmeLaneCondition: an entity is in a lane."""

from __future__ import annotations

from typing import TYPE_CHECKING

from runner.engine.compile.element import EntityCondition
from runner.engine.compile.registry import condition

if TYPE_CHECKING:
    from runner.engine.compile.protocols import Instant
    from runner.engine.compile.registry import Context
    from runner.engine.participants.entity import Entity
    from xodr.graph.network import RoadNetwork
    from xosc.document.node import Node


@condition("AcmeLaneCondition")
class AcmeLaneCondition(EntityCondition):
    """True while the entity's reference point is in a lane.

    Args:
        lane: OpenDRIVE lane id.
        network: the roads.
    """

    def __init__(self, lane: int, network: RoadNetwork) -> None:
        self.lane = lane
        self.network = network

    @classmethod
    def from_xml(cls, node: Node, context: Context) -> AcmeLaneCondition:
        """Read laneId; there has to be a road network."""
        return cls(int(node.int("laneId")), context.need_network(node))

    def holds(self, entity: Entity, run: Instant) -> bool:
        """Whether it is in that lane now."""
        return self._lane(entity, run) == self.lane

    def describe(self, entity: Entity, run: Instant) -> str:
        """Its lane now, for the event log and reports."""
        return f"lane of {entity.name} = {self._lane(entity, run)}, {self.lane} is asked for"

    def _lane(self, entity: Entity, run: Instant) -> int | None:
        point = run.roads.road_point(entity)
        # `point.lane_id` is the lane that it follows, in a lane change already the new one.
        return (
            self.network.road(point.road_id).lane_at(point.s, point.t)
            if point is not None
            else None
        )
