"""What CARLA makes of a scenario's road network: the map that it is played on.

Source: `get_waypoint_xodr` and the OpenDRIVE parser of CARLA 0.9.16.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from schemas.xml import parse
from xosc.document import Document
from xosc.node import Node
from xosc.roads import RoadFile

_BEFORE_THE_END = 0.01
"""How far (m) before the end of a road CARLA has its last place"""


def need_map(document: Document, network: RoadFile | None) -> None:
    """Refuse, before anything else, a scenario without roads.

    Raises:
        Unsupported: it has none.
    """
    if network is None:
        raise (document.node.find("RoadNetwork") or document.node).unsupported(
            "scenario_runner plays on a map, and this scenario names none: name one in RoadNetwork/LogicFile "
            "(--road auto makes straight roads where positions name roads)"
        )


def settle(document: Document, network: Path | None) -> Iterator[str]:
    """Move positions at the end of a road, or beyond it, to the last place that CARLA has there; remarks on that.

    Raises:
        Unsupported: CARLA can't make a map of the roads.
    """
    where = document.node.find("RoadNetwork") or document.node
    assert network is not None, "need_map has been asked"
    roads = parse(network).getroot()
    if any(junction.get("type") == "direct" for junction in roads.iter("junction")):
        raise where.unsupported("CARLA stops at roads with direct junctions")
    names = [road.get("id", "") for road in roads.iter("road")]
    if not all(name.isdecimal() for name in names):
        raise where.unsupported("CARLA reads ids of roads as numbers, and some here are none")
    lengths = {road.get("id"): float(road.get("length", "0")) for road in roads.iter("road")}
    for position in document.node.iter("LanePosition", "RoadPosition"):
        yield from _within(position, lengths.get(position.get("roadId")))


def _within(position: Node, length: float | None) -> Iterator[str]:
    s = position.float("s")
    if length is not None and s >= length:
        position.element.set("s", repr(max(length - _BEFORE_THE_END, 0.0)))
        yield f"{position.where}: {position.tag}: CARLA's road ends at s={length:g}; {_BEFORE_THE_END:g} m before that is written"
