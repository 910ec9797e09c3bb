"""From a road network to the SUMO network file and the index of its lanes and signals."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from lxml import etree

from xodr.network import RoadNetwork
from xodr.sumo_net.net import SignalLink, Track
from xodr.sumo_net.netconvert import NetconvertFailed, netconvert
from xodr.sumo_net.plain import Place, PlainNetwork, plain_network
from xodr.sumo_net.shapes import text

WIDEST = 1000.0
"""m of width that lanes of SUMO's networks have at most: wider than any apron."""
_Connections = dict[tuple[Place, Place], etree._Element]


def convert(roads: RoadNetwork | None) -> tuple[bytes, dict[str, Any]]:
    """The network file, and the index that says what is what in it."""
    plain = plain_network(roads)
    with TemporaryDirectory(prefix="xosc-netconvert-") as folder:
        fallback = None
        try:
            _check_widths(plain)
            network = netconvert(plain, Path(folder))
        except NetconvertFailed as error:
            plain, fallback = plain_network(None), error.message
            network = netconvert(plain, Path(folder))
    for junction in network.iter("junction"):
        outline = plain.outlines.get(junction.get("id", ""))
        if outline:
            junction.set("shape", text(outline))
    connections = _connections(network)
    index = {
        "left_hand": plain.left_hand,
        "tracks": [(sumo_lane, *track) for sumo_lane, track in _tracks(plain, connections)],
        "signals": _signals(plain, connections),
        "fallback": fallback,
    }
    return etree.tostring(network, xml_declaration=True, encoding="UTF-8"), index


def _check_widths(plain: PlainNetwork) -> None:
    """netconvert goes on for minutes with lanes of many kilometres.

    Raises:
        NetconvertFailed: a lane is too wide.
    """
    widest = max((float(lane.get("width", "0")) for lane in plain.edges.iter("lane")), default=0.0)
    if widest > WIDEST:
        raise NetconvertFailed(f"a lane is {widest:g} m wide, SUMO's networks have lanes up to {WIDEST:g} m")


def _connections(network: etree._Element) -> _Connections:
    """netconvert's connections from lane to lane, those inside junctions included."""
    return {
        (Place(c.get("from", ""), int(c.get("fromLane", 0))), Place(c.get("to", ""), int(c.get("toLane", 0)))): c
        for c in network.iter("connection")
    }


def _tracks(plain: PlainNetwork, connections: _Connections) -> list[tuple[str, Track]]:
    """Every SUMO lane with what it is in the road network; lanes inside junctions with all that they pass, longest first."""
    found = list(plain.lanes.items())
    onward = {
        f"{source.edge}_{source.lane}": element.get("via")
        for (source, _), element in connections.items()
        if source.edge[0] == ":"
    }
    for way, tracks in plain.inside.items():
        inner = connections[way].get("via") if way in connections else None
        while inner:
            found += [(inner, track) for track in sorted(tracks, key=lambda track: -abs(track.end - track.start))]
            inner = onward.get(inner)
    return found


def _signals(plain: PlainNetwork, connections: _Connections) -> dict[str, list[SignalLink]]:
    found: dict[str, list[SignalLink]] = defaultdict(list)
    for way, held in plain.signals.items():
        light = connections[way].get("tl") if way in connections else None
        if light:
            link = SignalLink(light, int(connections[way].get("linkIndex", 0)))
            for signal_id in dict.fromkeys(held):
                found[signal_id].append(link)
    return found
