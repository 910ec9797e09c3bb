"""From an OpenDRIVE file to its SUMO network: convert it once, find it in the cache ever after."""

from __future__ import annotations

import tempfile
from collections import defaultdict
from functools import lru_cache
from os import PathLike
from pathlib import Path
from typing import Any

from lxml import etree

from schemas.errors import InvalidFile
from xodr.network import RoadNetwork
from xodr.reader import load
from xodr.sumo_net.cache import Entry
from xodr.sumo_net.net import SignalLink, SumoNet, Track
from xodr.sumo_net.netconvert import NetconvertFailed, netconvert
from xodr.sumo_net.plain import Place, PlainNetwork, plain_network

_REMEMBERED = 64


def build(path: str | PathLike[str] | None) -> SumoNet:
    """The SUMO network of an OpenDRIVE file, from the cache where it has been built before.

    Args:
        path: the OpenDRIVE file; None for a plain without roads, on which there is only the dock.

    Raises:
        InvalidFile, Unsupported: the OpenDRIVE file cannot be read.
        UsageError: the cache folder cannot be written.
    """
    if path is None:
        return _build(None, 0, 0)
    path = Path(path)
    try:
        status = path.stat()
        return _build(path, status.st_mtime_ns, status.st_size)
    except OSError as error:
        raise InvalidFile(f"the file cannot be read: {error.strerror or error}", path=path) from None


@lru_cache(maxsize=_REMEMBERED)
def _build(path: Path | None, _time: int, _size: int) -> SumoNet:
    entry = Entry(path.read_bytes() if path else b"")
    index = entry.read()
    if index is None:
        network, index = _convert(load(path) if path else None)
        entry.write(network, index)
    return SumoNet(
        entry.network,
        index["left_hand"],
        [(sumo_lane, Track(*track)) for sumo_lane, *track in index["tracks"]],
        {signal: tuple(SignalLink(*link) for link in links) for signal, links in index["signals"].items()},
        index["fallback"],
    )


def _convert(roads: RoadNetwork | None) -> tuple[bytes, dict[str, Any]]:
    """The network file and its index."""
    plain = plain_network(roads)
    with tempfile.TemporaryDirectory(prefix="xosc-netconvert-") as folder:
        fallback = None
        try:
            network = netconvert(plain, Path(folder))
        except NetconvertFailed as error:
            plain, fallback = plain_network(None), error.message
            network = netconvert(plain, Path(folder))
    connections = _connections(network)
    index = {
        "left_hand": plain.left_hand,
        "tracks": [(sumo_lane, *track) for sumo_lane, track in _tracks(plain, connections)],
        "signals": _signals(plain, connections),
        "fallback": fallback,
    }
    return etree.tostring(network, xml_declaration=True, encoding="UTF-8"), index


_Connections = dict[tuple[Place, Place], etree._Element]


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
