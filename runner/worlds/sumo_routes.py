"""The way of a participant as SUMO needs it: the edges that SUMO's driver is to follow.

SUMO's drivers need a route, and leave the network at its end. A participant without a route of its own takes the
straightest way; the way is found for some kilometres ahead and again when half of it is driven.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence

from runner.motion.routes import AssignedRoute
from runner.participants.entity import Entity
from xodr.model import LaneLink, RoadPoint
from xodr.network import RoadNetwork
from xodr.sumo_net import SumoNet

REACH = 5000.0
"""Length (m) of the way that is found ahead."""


class SumoRoutes:
    """Finds the edges along roads.

    Args:
        network: the roads.
        net: their SUMO network.
    """

    def __init__(self, network: RoadNetwork, net: SumoNet) -> None:
        self.network = network
        self._edges: dict[tuple[str, bool], list[str]] = defaultdict(list)
        along = {lane.rpartition("_")[0]: track for lane, track in net.sumo_lanes.items() if not lane.startswith(":")}
        for edge, track in sorted(along.items(), key=lambda item: item[1].start * (1 if item[1].end > item[1].start else -1)):
            self._edges[track.road_id, track.end > track.start].append(edge)

    def ahead(self, entity: Entity, here: RoadPoint) -> list[str]:
        """The edges that an entity follows from a place on."""
        forward = self.network.road(here.road_id).direction(here.lane_id, here.s) > 0
        return list(self._along(self._roads(entity, here, forward)))

    def _along(self, roads: Iterable[tuple[str, bool]]) -> Iterator[str]:
        """Edges of roads in turn; roads inside junctions have none."""
        for road in roads:
            yield from self._edges.get(road, ())

    def _roads(self, entity: Entity, here: RoadPoint, forward: bool) -> list[tuple[str, bool]]:
        """Roads and directions of travel: those of the entity's route, then the straightest."""
        roads = [(here.road_id, forward)]
        route = entity.controls.route
        if isinstance(route, AssignedRoute):
            legs = [(leg.road_id, leg.forward) for leg in route.path.legs]
            if roads[0] in legs:
                return (legs * 2)[legs.index(roads[0]) :] if route.closed else legs[legs.index(roads[0]) :]
        follow = route.choose if route is not None else self.network.straightest

        def choose(point: RoadPoint, towards_end: bool, links: Sequence[LaneLink]) -> LaneLink | None:
            link = follow(point, towards_end, links)
            if link is not None:
                roads.append((link.road_id, link.at_start))
            return link

        self.network.travel(here, REACH, forward, choose)
        return roads


def joined(driving: Sequence[str], ahead: Sequence[str]) -> list[str]:
    """What is left of the route that SUMO has, up to the last edge that lies ahead, and from there what lies ahead."""
    for index in reversed(range(len(driving))):
        if driving[index] in ahead:
            return [*driving[:index], *ahead[ahead.index(driving[index]) :]]
    return list(driving)
