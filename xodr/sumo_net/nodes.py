"""SUMO's nodes: which ends of roads meet in one place."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from urllib.parse import quote

from xodr.road import Road
from xodr.sumo_net.connections import LaneConnection
from xodr.sumo_net.shapes import Point, mouth

_End = tuple[str, ...]
"""("road", its id, "start" or "end"), or ("junction", its id)."""


class Nodes:
    """Names of the nodes at the ends of roads: those at one junction are one, and so are two that a connection joins.

    Attributes:
        corners: by node, the right and left edges of the roads that end there.
    """

    def __init__(self, roads: Iterable[Road], connections: Iterable[LaneConnection]) -> None:
        self._parents: dict[_End, _End] = {}
        roads = list(roads)
        for road in roads:
            for end, link in (("start", road.predecessor), ("end", road.successor)):
                if link and link.element_type == "junction":
                    self._join(("junction", link.element_id), ("road", road.id, end))
        for connection in connections:
            source, target = connection.source, connection.target
            self._join(_end(source.road_id, source.at_start), _end(target.road_id, target.at_start))
        self.corners: dict[str, list[Point]] = defaultdict(list)
        for road in roads:
            self.corners[self.name(road, True)] += mouth(road, 0.0)
            self.corners[self.name(road, False)] += mouth(road, road.length)

    def name(self, road: Road, at_start: bool) -> str:
        """Id of the node at one end of a road."""
        return _name(self._root(_end(road.id, at_start)))

    @staticmethod
    def inner_name(road: Road, number: int) -> str:
        """Id of a node inside a road, where its piece of that number begins."""
        return _name(("road", road.id, str(number)))

    def _join(self, one: _End, other: _End) -> None:
        first, second = sorted((self._root(one), self._root(other)))  # a junction before a road
        if first != second:
            self._parents[second] = first

    def _root(self, end: _End) -> _End:
        while end in self._parents:
            end = self._parents[end]
        return end


def _end(road_id: str, at_start: bool) -> _End:
    return "road", road_id, "start" if at_start else "end"


def _name(end: _End) -> str:
    return "/".join(quote(part, safe="") for part in end)
