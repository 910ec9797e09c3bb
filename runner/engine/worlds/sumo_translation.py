"""Translation of a scenario's vehicles, traffic signals and routes for SUMO.

Traffic signals: each aspect (`runner.engine.worlds.aspects`) has a letter of SUMO's.

Ways: SUMO's drivers need a route, and leave the network at its end. A participant without a route
of its own takes the straightest way; it is found for some kilometres ahead and again when half of
it is driven.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

from runner.engine.motion.routes import AssignedRoute
from runner.engine.participants.entity import Entity
from runner.engine.worlds.aspects import Aspect, aspect_of
from xodr.formats.sumo_net import SumoNet
from xodr.graph.network import RoadNetwork
from xodr.model import LaneLink, RoadPoint
from xosc.writing.versions import with_recent


class VehicleKind(NamedTuple):
    """SUMO vehicle class, and what SUMO's driver of such a vehicle uses: m/s², m/s², m/s (SUMO's
    own defaults)."""

    vehicle_class: str
    acceleration: float
    deceleration: float
    speed: float


KINDS = with_recent(
    {
        "car": VehicleKind("passenger", 2.6, 4.5, 55.0),
        "van": VehicleKind("delivery", 2.6, 4.5, 55.0),
        "truck": VehicleKind("truck", 1.3, 4.0, 36.0),
        "semitrailer": VehicleKind("trailer", 1.1, 4.0, 36.0),
        "trailer": VehicleKind("trailer", 1.1, 4.0, 36.0),
        "bus": VehicleKind("bus", 1.2, 4.0, 28.0),
        "motorbike": VehicleKind("motorcycle", 6.0, 10.0, 55.0),
        "bicycle": VehicleKind("bicycle", 1.2, 3.0, 5.6),
        "train": VehicleKind("rail", 0.25, 1.3, 44.0),
        "tram": VehicleKind("tram", 1.0, 3.0, 22.0),
        "pedestrian": VehicleKind("pedestrian", 1.5, 2.0, 1.4),
        "wheelchair": VehicleKind("wheelchair", 1.5, 2.0, 1.4),
    }
)
"""By OpenSCENARIO category. Everything else is an obstacle."""
OBSTACLE = VehicleKind("ignoring", 1.0, 1.0, 55.0)


RED, RED_YELLOW, YELLOW, GREEN, YIELD, OFF = "r", "u", "y", "g", "o", ""
"""Link states of SUMO. OFF is not SUMO's: the junction's own right of way holds, for which SUMO has
one or another letter."""

_LETTERS = {
    Aspect.RED: RED, Aspect.RED_YELLOW: RED_YELLOW, Aspect.YELLOW: YELLOW, Aspect.GREEN: GREEN,
    Aspect.CAUTION: YIELD,
    Aspect.OFF: OFF,
}  # fmt: skip


def link_state(state: str) -> str | None:
    """SUMO's link state of a signal's state; None where it is not understood."""
    aspect = aspect_of(state)
    return _LETTERS[aspect] if aspect is not None else None


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
        along = {
            lane.rpartition("_")[0]: track
            for lane, track in net.sumo_lanes.items()
            if not lane.startswith(":")
        }
        for edge, track in sorted(
            along.items(),
            key=lambda item: item[1].start * (1 if item[1].end > item[1].start else -1),
        ):
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
                return (
                    (legs * 2)[legs.index(roads[0]) :]
                    if route.closed
                    else legs[legs.index(roads[0]) :]
                )
        follow = route.choose if route is not None else self.network.straightest

        def choose(
            point: RoadPoint, towards_end: bool, links: Sequence[LaneLink]
        ) -> LaneLink | None:
            link = follow(point, towards_end, links)
            if link is not None:
                roads.append((link.road_id, link.at_start))
            return link

        self.network.travel(here, REACH, forward, choose)
        return roads


def joined(driving: Sequence[str], ahead: Sequence[str]) -> list[str]:
    """Return the rest of SUMO's route up to the last edge ahead, followed by the new way."""
    for index in reversed(range(len(driving))):
        if driving[index] in ahead:
            return [*driving[:index], *ahead[ahead.index(driving[index]) :]]
    return list(driving)
