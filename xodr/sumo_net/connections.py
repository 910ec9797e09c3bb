"""Connections of lanes from road to road, with the connecting roads between them taken together."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from xodr.graph.links import next_lane
from xodr.model import LaneLink, LaneSection
from xodr.network import RoadNetwork
from xodr.road import Road
from xodr.sumo_net.uses import use_of

LONGEST_CHAIN = 8
"""Most connecting roads in a row that are followed through a junction."""


class LaneConnection(NamedTuple):
    """From a lane that ends at a road's end, over connecting lanes, to a lane that begins at a road's end.

    All three name lanes by the end that the connection touches: source its end of departure, via and target their entries.
    """

    source: LaneLink
    via: tuple[LaneLink, ...]
    target: LaneLink


def lane_connections(network: RoadNetwork) -> list[LaneConnection]:
    """Every connection that some kind of traffic may take from one road that is not a connecting road to the next."""
    found = []
    for road in network.roads.values():
        if _connects(network, road):
            continue
        for at_start, section, s in ((True, road.sections[0], 0.0), (False, road.sections[-1], road.length)):
            for lane in section.lanes.values():
                if lane.id and (road.direction(lane.id, s) < 0) == at_start:
                    source = LaneLink(road.id, lane.id, at_start)
                    onward = _onward(network, source, use_of(lane.type).kind, LONGEST_CHAIN)
                    found += [LaneConnection(source, via, target) for via, target in onward]
    return found


def stretches(road: Road, entry: LaneLink) -> list[tuple[LaneSection, int]]:
    """The lane's sections and ids from its entry to the other end of the road; cut short where the lane ends before."""
    sections = road.sections if entry.at_start else road.sections[::-1]
    lane_id: int | None = entry.lane_id
    found = []
    for number, section in enumerate(sections):
        if lane_id not in section.lanes:
            break
        found.append((section, lane_id))
        if number + 1 < len(sections):
            lane_id = next_lane(section.lanes[lane_id], sections[number + 1], entry.at_start)
    return found


def _connects(network: RoadNetwork, road: Road) -> bool:
    return road.junction_id in network.junctions


def _onward(network: RoadNetwork, leaving: LaneLink, kind: str, chain: int) -> Iterator[tuple[tuple[LaneLink, ...], LaneLink]]:
    """The connecting lanes passed and the lane reached, on each way on from a lane's end."""
    for link in network.links(leaving.road_id, leaving.lane_id, not leaving.at_start):
        road = network.roads[link.road_id]
        s = 0.0 if link.at_start else road.length
        lane = road.lane(s, link.lane_id)
        if use_of(lane.type).kind != kind or (road.direction(lane.id, s) > 0) != link.at_start:
            continue
        if not _connects(network, road):
            yield (), link
            continue
        passed = stretches(road, link)
        if chain and len(passed) == len(road.sections):
            far_end = LaneLink(road.id, passed[-1][1], not link.at_start)
            for via, target in _onward(network, far_end, kind, chain - 1):
                yield (link, *via), target
