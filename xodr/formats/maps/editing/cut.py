"""Parts of an OpenDRIVE file: whole roads within an area, or by id, with links closed where roads
are left out."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import product
from pathlib import Path

from lxml import etree
from shapely import LineString, Polygon

from schemas.common.errors import UsageError
from xodr.formats.maps.editing.tree import EditedRoads, remove
from xodr.graph.network import RoadNetwork
from xodr.graph.ways import DRIVABLE
from xodr.lookup.arrays import sample, stations
from xodr.model import RoadPoint
from xodr.model.road import Road


def within(network: RoadNetwork, corners: Sequence[tuple[float, float]]) -> set[str]:
    """Ids of the roads whose reference line touches a polygon, and of all roads of their junctions.

    Args:
        corners: of the polygon, m.

    Raises:
        UsageError: it has fewer than three corners.
    """
    if len(corners) < 3:
        raise UsageError("a polygon has three corners or more")
    area = Polygon(corners)
    lines = {
        road.id: LineString(sample(road, stations(road, 10.0))[:, :2])
        for road in network.roads.values()
    }
    return with_junctions(network, {name for name, line in lines.items() if line.intersects(area)})


def with_junctions(network: RoadNetwork, roads: set[str]) -> set[str]:
    """Roads, and all connecting roads of the junctions that one of them is part of, or that lie
    between them."""
    found = set(roads)
    for junction in network.junctions.values():
        inner = {road.id for road in network.roads.values() if road.junction_id == junction.id}
        if inner & roads:
            found |= inner
            continue
        for connection in junction.connections:
            ends = _ends(network, connection.connecting_road)
            if ends and ends <= roads:
                found.add(connection.connecting_road)
    return found


def _ends(network: RoadNetwork, name: str) -> set[str]:
    """Ids of the roads that a connecting road links."""
    road = network.roads.get(name)
    links = (road.predecessor, road.successor) if road is not None else ()
    return {link.element_id for link in links if link is not None and link.element_type == "road"}


def along(network: RoadNetwork, roads: Iterable[str]) -> set[str]:
    """Ids of roads that are named, and of the connecting roads between them.

    Raises:
        UsageError: there is no such road.
    """
    named = set(roads)
    _check_known(network, named)
    return with_junctions(network, named)


def _check_known(network: RoadNetwork, roads: Iterable[str]) -> None:
    unknown = sorted(set(roads) - network.roads.keys())
    if unknown:
        raise UsageError(f"there is no road {unknown[0]!r}", path=network.path)


def on_way(network: RoadNetwork, roads: Sequence[str]) -> set[str]:
    """Ids of the roads of the shortest way of traffic over some roads, in their order.

    Raises:
        UsageError: fewer than two are named, there is no such road, or no way leads over them.
    """
    if len(roads) < 2:
        raise UsageError("a route has two roads or more: the first, and those that it leads over")
    _check_known(network, roads)
    points = [_on_lanes(network.road(name)) for name in roads]
    ways = [way for way in map(network.route, product(*points)) if way is not None]
    if not ways:
        raise UsageError(f"no way of traffic leads over {', '.join(roads)}", path=network.path)
    return {leg.road_id for leg in min(ways, key=lambda way: way.length).legs}


def _on_lanes(road: Road) -> list[RoadPoint]:
    """A point in the middle of a road for each direction of its traffic."""
    s = road.length / 2.0
    lanes = {
        road.direction(lane, s): road.lane_point(s, lane)
        for lane in road.lane_ids(s)
        if road.lane_type(s, lane) in DRIVABLE
    }
    return list(lanes.values())


def cut(path: Path, chosen: set[str]) -> tuple[bytes, list[str]]:
    """An OpenDRIVE file with some of its roads, and what became of what led beyond them, one
    sentence each.

    Links to roads that are left out are taken away, as are junctions without connections, controls
    of signals that are gone, and references to them.

    Args:
        chosen: ids of the roads that stay.

    Raises:
        UsageError: none stays.
    """
    file = EditedRoads(path)
    root = file.root
    roads = root.findall("road")
    if not any(road.get("id") in chosen for road in roads):
        raise UsageError("no road of this map is there", path=path)
    gone = [road for road in roads if road.get("id") not in chosen]
    for road in gone:
        root.remove(road)
    notes = list(file.remarks)
    notes += [f"{len(gone)} of {len(roads)} roads are left out"] if gone else []
    left = {road.get("id") for road in root.findall("road")}
    junctions, closed = _junctions(root, left)
    links = 0
    for road in root.findall("road"):
        for link in road.findall("link/*"):
            there = left if link.get("elementType") == "road" else junctions
            if link.tag in ("predecessor", "successor") and link.get("elementId") not in there:
                remove(link)
                links += 1
        if road.get("junction", "-1") not in ("-1", "") and road.get("junction") not in junctions:
            road.set("junction", "-1")
            notes.append(
                f"road {road.get('id')} is no connecting road any more: its junction "
                "has no way through it"
            )
    notes += [f"{links} links to what is left out are taken away: roads end there"] if links else []
    notes += closed
    notes += _signals(root)
    return file.content(), notes


def _junctions(root: etree._Element, roads: set[str | None]) -> tuple[set[str | None], list[str]]:
    """Take away ways through junctions that lead from or to roads that are gone; ids of the
    junctions that are left."""
    ways, empty = 0, 0
    for junction in root.findall("junction"):
        for connection in junction.findall("connection"):
            named = {
                connection.get(name) for name in ("incomingRoad", "connectingRoad", "linkedRoad")
            } - {None}
            if not named <= roads:
                junction.remove(connection)
                ways += 1
        for element in [*junction.findall("priority"), *junction.findall("crossPath")]:
            named = {
                element.get(name)
                for name in ("high", "low", "crossingRoad", "roadAtStart", "roadAtEnd")
            } - {None}
            if not named <= roads:
                junction.remove(element)
        if not junction.findall("connection"):
            root.remove(junction)
            empty += 1
    notes = [f"{ways} ways through junctions are left out"] if ways else []
    notes += [f"{empty} junctions without a way through them are left out"] if empty else []
    return {junction.get("id") for junction in root.findall("junction")}, notes


def _signals(root: etree._Element) -> list[str]:
    """Take away controls and references of signals that are gone."""
    signals = {signal.get("id") for signal in root.iterfind("road/signals/signal")}
    count = 0
    for reference in root.findall("road/signals/signalReference"):
        if reference.get("id") not in signals:
            remove(reference)
            count += 1
    for controller in root.findall("controller"):
        for control in controller.findall("control"):
            if control.get("signalId") not in signals:
                controller.remove(control)
                count += 1
        if not controller.findall("control"):
            root.remove(controller)
    left = {controller.get("id") for controller in root.findall("controller")}
    for use in root.findall("junction/controller"):
        if use.get("id") not in left:
            remove(use)
    return [f"{count} references to signals that are left out are taken away"] if count else []
