"""Building SUMO networks of OpenDRIVE files with netconvert (from the eclipse-sumo package), and
their cache.

An entry of the cache is a network file and an index beside it, named after everything that they
depend on. Both are written whole, and the bytes depend on the entry alone, so parallel processes
may write the same one. The index carries a digest of the network: a damaged entry counts as absent
and is built again."""

from __future__ import annotations

import hashlib
import importlib.util
import json
import logging
import math
import os
import sys
import warnings
from collections import defaultdict
from collections.abc import Mapping
from functools import cache, lru_cache
from itertools import accumulate, pairwise
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree

from schemas.common.array_types import BoolArray, FloatArray
from schemas.common.errors import ToolchainError, Unsupported, UsageError
from schemas.common.policy import scratch
from schemas.common.storage import Stamp, cache_folder, is_own, keep, read_bytes, stamp
from schemas.common.xml import parse
from xodr.formats.sumo_net.net import LaneTrack, SignalLink, SumoNet, text
from xodr.formats.sumo_net.plain import PlainNetwork, SumoLane, plain_network
from xodr.graph.network import RoadNetwork
from xodr.lookup.geo import GeoReference
from xodr.model.road import Road
from xodr.reader import load

_log = logging.getLogger(__name__)

TIMEOUT = 120.0
"""Longest time that netconvert may take, in s; a city of some thousand roads takes a few."""

OPTIONS = (
    "--offset.disable-normalization",  # keep the coordinates of the road network
    "--no-turnarounds",  # only the connections of the road network
    "--output.original-names",
    "--precision=4",
    "--seed=42",
)


class NetconvertFailed(Unsupported):
    """netconvert refused its input; the message is netconvert's first complaint."""


@cache
def sumo_home() -> Path:
    """Folder of the eclipse-sumo package.

    Raises:
        ToolchainError: the package is not installed.
    """
    found = importlib.util.find_spec("sumo")
    if found is None or not found.submodule_search_locations:
        raise ToolchainError("SUMO's netconvert is needed: pip install eclipse-sumo")
    return Path(found.submodule_search_locations[0])


def program() -> Path:
    """The netconvert program.

    Raises:
        ToolchainError: it is not there.
    """
    found = sumo_home() / "bin" / ("netconvert.exe" if sys.platform == "win32" else "netconvert")
    if not found.is_file():
        raise ToolchainError("SUMO's netconvert is missing; install eclipse-sumo anew", path=found)
    return found


def netconvert(plain: PlainNetwork, folder: Path) -> etree._Element:
    """Build a SUMO network, with `folder` for the files between; netconvert's warnings go to the
    log.

    Raises:
        NetconvertFailed: netconvert refuses or takes too long.
    """
    import subprocess

    arguments = [
        str(program()),
        *OPTIONS,
        "--output-file=net.xml",
        # SUMO knows one rule for a whole network.
        *(["--lefthand"] if plain.left_hand else []),
    ]
    for kind in ("nodes", "edges", "connections"):
        (folder / f"{kind}.xml").write_bytes(etree.tostring(getattr(plain, kind)))
        arguments.append(f"--{kind[:-1]}-files={kind}.xml")
    try:
        done = subprocess.run(
            arguments, cwd=folder, env={**os.environ, "SUMO_HOME": str(sumo_home())},
            stdin=subprocess.DEVNULL,
            capture_output=True, timeout=TIMEOUT, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        raise NetconvertFailed(
            f"SUMO's netconvert has not finished after {TIMEOUT:.0f} s"
        ) from None
    lines = done.stderr.decode(errors="replace").splitlines()
    target = folder / "net.xml"
    if done.returncode != 0 or not target.is_file():
        reason = next(
            (line for line in lines if line.startswith("Error")), f"exit code {done.returncode}"
        )
        raise NetconvertFailed(
            f"SUMO's netconvert cannot build a network: {reason.removeprefix('Error: ')}"
        )
    for line in lines:
        _log.debug("netconvert: %s", line)
    return parse(target).getroot()


def osm_network(osm: Path, folder: Path) -> Path:
    """The SUMO network that netconvert makes of an OpenStreetMap file, written into a folder.

    Raises:
        NetconvertFailed: netconvert refuses or takes too long.
    """
    import subprocess

    target = folder / "osm.net.xml"
    types = sumo_home() / "data" / "typemap" / "osmNetconvert.typ.xml"
    arguments = [
        str(program()),
        "--osm-files",
        str(osm.resolve()),
        "--output-file",
        str(target),
        *_OSM_OPTIONS,
    ]
    # Optional: netconvert has types of its own.
    if types.is_file():
        arguments += ["--type-files", str(types)]
    try:
        done = subprocess.run(
            arguments, cwd=folder, env={**os.environ, "SUMO_HOME": str(sumo_home())},
            stdin=subprocess.DEVNULL,
            capture_output=True, timeout=TIMEOUT, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        raise NetconvertFailed(
            f"SUMO's netconvert has not finished after {TIMEOUT:.0f} s"
        ) from None
    if done.returncode != 0 or not target.is_file():
        lines = done.stderr.decode(errors="replace").splitlines()
        reason = next(
            (line for line in lines if line.startswith("Error")), f"exit code {done.returncode}"
        )
        raise NetconvertFailed(
            f"SUMO's netconvert cannot read this map: {reason.removeprefix('Error: ')}", path=osm
        )
    return target


_OSM_OPTIONS = (
    "--geometry.remove", "--ramps.guess", "--junctions.join", "--tls.guess-signals",
    "--tls.discard-simple", "--no-turnarounds",
    "--output.street-names", "--seed=42",
)  # fmt: skip

CACHE_FORMAT = 4
"""To be counted up when the same road network shall give another SUMO network or index."""


class CacheEntry:
    """One entry: the files of the network that is built from the given OpenDRIVE content."""

    def __init__(self, content: bytes) -> None:
        # Another netconvert may build another network: its size and time stand for its version.
        built_by = program().stat()
        salt = repr((CACHE_FORMAT, OPTIONS, built_by.st_size, built_by.st_mtime_ns)).encode()
        key = hashlib.blake2b(
            content, digest_size=20, key=hashlib.blake2b(salt).digest()
        ).hexdigest()
        self.network = cache_folder("sumo") / f"{key}.net.xml"
        self.index = self.network.with_name(f"{key}.json")

    def read(self) -> dict[str, Any] | None:
        """The index, None where the entry is absent, damaged, or of files that another user may
        change."""
        if not (is_own(self.index) and is_own(self.network)):
            return None
        try:
            index = json.loads(self.index.read_bytes())
            intact = index["digest"] == _digest(self.network.read_bytes())
        except (OSError, ValueError, KeyError, TypeError):
            return None
        return index if intact else None

    def write(self, network: bytes, index: dict[str, Any]) -> None:
        """Store the entry.

        Raises:
            UsageError: the cache folder cannot be written.
        """
        try:
            # The index last: it has the digest of the network, so that a run cut short leaves no
            # valid entry.
            keep(network, self.network)
            keep(json.dumps({"digest": _digest(network), **index}).encode(), self.index)
        except OSError as error:
            message = (
                f"the cache folder cannot be written ({error.strerror or error}); set "
                "XOSC_CACHE_DIR to another one"
            )
            raise UsageError(message, path=self.network.parent) from None


def _digest(data: bytes) -> str:
    return hashlib.blake2b(data, digest_size=20).hexdigest()


WIDEST = 1000.0
"""m of width that lanes of SUMO's networks have at most: wider than any apron."""
_Connections = dict[tuple[SumoLane, SumoLane], etree._Element]


def convert(roads: RoadNetwork | None, whole: bool = False) -> tuple[bytes, dict[str, Any]]:
    """Convert roads into a network file and its index, which relates lanes and signals of both.

    Args:
        whole: as in `plain_network`.
    """
    plain = plain_network(roads, whole)
    with scratch("xosc-netconvert-") as folder:
        fallback = None
        try:
            _check_widths(plain)
            network = netconvert(plain, folder)
        except NetconvertFailed as error:
            # The dock alone, so that runs go on where netconvert refuses the roads.
            plain, fallback = plain_network(None), error.message
            network = netconvert(plain, folder)
    # Shapes were kept out of netconvert, which would cut lanes back to them (see plain).
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


def georeference(network: etree._Element, roads: RoadNetwork) -> str | None:
    """Give a SUMO network the projection and the offset of its roads, or return the reason against.

    SUMO adds `netOffset` to projected coordinates; it can't turn them.
    """
    location = network.find("location")
    if roads.geo_reference is None or location is None:
        return None
    x, y, _, heading = roads.header.offset
    if heading:
        return (
            "the projection is left out: SUMO can't turn coordinates, and the header's offset "
            f"turns them by {heading:g} rad"
        )
    try:
        projection = proj_text(roads)
    except ToolchainError as error:
        return f"the projection is left out: {error.message}"
    location.set("projParameter", projection)
    location.set("netOffset", f"{-x:.4f},{-y:.4f}")
    return None


def proj_text(roads: RoadNetwork) -> str:
    """The projection of roads as a PROJ string of coordinates.

    Raises:
        Unsupported, InvalidFile: see `xodr.lookup.geo.GeoReference`.
    """
    crs = GeoReference(roads).crs
    given = str(roads.geo_reference).strip()
    if not given.startswith("+proj="):
        # PROJ strings lose the names of datums, which pyproj warns of.
        with warnings.catch_warnings(action="ignore", category=UserWarning):
            given = crs.to_proj4()
    return given.replace("+type=crs", "").strip()


def lift(network: etree._Element, tracks: Mapping[str, LaneTrack], roads: RoadNetwork) -> None:
    """Give the lanes of a SUMO network the heights of its roads.

    Args:
        tracks: what each SUMO lane is on the roads.
    """
    if all(road.flat for road in roads.roads.values()):
        return
    for lane in network.iter("lane"):
        track = tracks.get(lane.get("id", ""))
        if track is None:
            continue
        points = [
            (float(x), float(y))
            for x, y, *_ in (point.split(",") for point in lane.get("shape", "").split())
        ]
        gone = np.array([0.0, *accumulate(math.dist(a, b) for a, b in pairwise(points))])
        whole = max(gone[-1], _SHORTEST)
        # Corners of the shape are seen from above only: hills lie between them.
        between = np.arange(_HEIGHTS_APART, whole, _HEIGHTS_APART)
        places = np.unique(np.concatenate([gone, between]))
        heights = _heights(roads.roads[track.road_id], track, places / whole)
        kept = _bends(places, heights, np.isin(places, gone))
        x, y = (np.interp(places[kept], gone, column) for column in np.array(points).T)
        shape = [
            f"{x:.4f},{y:.4f},{z:.4f}"
            for x, y, z in zip(x.tolist(), y.tolist(), heights[kept].tolist(), strict=True)
        ]
        lane.set("shape", " ".join(shape))


def _bends(places: FloatArray, heights: FloatArray, kept: BoolArray) -> BoolArray:
    """Places of a shape, and further ones where heights (m) leave the straight lines between."""
    while True:
        away = np.abs(np.interp(places, places[kept], heights[kept]) - heights)
        piece = np.cumsum(kept)  # number of the line that a place is on
        # The last one in order of distance stays: the worst of each line.
        worst = {int(piece[at]): int(at) for at in np.argsort(away) if away[at] > _STRAIGHT}
        if not worst:
            return kept
        kept = kept.copy()
        kept[list(worst.values())] = True


_SHORTEST, _HEIGHTS_APART, _STRAIGHT = 1e-9, 2.0, 0.01


def _heights(road: Road, track: LaneTrack, shares: FloatArray) -> FloatArray:
    """Heights (m) of a lane's centre line at shares of its length as seen from above."""
    count = math.ceil(abs(track.end - track.start) / _HEIGHTS_APART) + 1
    places = []
    for s in np.linspace(track.start, track.end, max(count, 2)).tolist():
        # At the end of a track, a section may begin that lacks the lane.
        lane_id = track.lane_id if track.lane_id in road.section(s).lanes else road.lane_at(s, 0.0)
        places.append(road.pose(s, road.lane_t(s, lane_id))[:3])
    line = np.array(places)
    gone = np.append(0.0, np.cumsum(np.hypot(*np.diff(line[:, :2], axis=0).T)))
    return np.interp(shares * gone[-1], gone, line[:, 2])


def _check_widths(plain: PlainNetwork) -> None:
    """Refuse lanes of many kilometres of width, on which netconvert spends minutes.

    Raises:
        NetconvertFailed: a lane is too wide.
    """
    widest = max((float(lane.get("width", "0")) for lane in plain.edges.iter("lane")), default=0.0)
    if widest > WIDEST:
        raise NetconvertFailed(
            f"a lane is {widest:g} m wide, SUMO's networks have lanes up to {WIDEST:g} m"
        )


def _connections(network: etree._Element) -> _Connections:
    """netconvert's connections from lane to lane, those inside junctions included."""
    return {
        (
            SumoLane(c.get("from", ""), int(c.get("fromLane", 0))),
            SumoLane(c.get("to", ""), int(c.get("toLane", 0))),
        ): c
        for c in network.iter("connection")
    }


def _tracks(plain: PlainNetwork, connections: _Connections) -> list[tuple[str, LaneTrack]]:
    """Tracks of all SUMO lanes on the roads.

    A lane inside a junction has one for each lane that it passes, in order.
    """
    found = list(plain.lanes.items())
    onward = {
        f"{source.edge}_{source.lane}": element.get("via")
        for (source, _), element in connections.items()
        if source.edge[0] == ":"
    }
    for way, tracks in plain.inside.items():
        # netconvert cuts long ways through junctions into chains of inner lanes: the track is that
        # of all.
        inner = connections[way].get("via") if way in connections else None
        while inner:
            found += [(inner, track) for track in tracks]
            inner = onward.get(inner)
    return found


def _signals(plain: PlainNetwork, connections: _Connections) -> dict[str, list[SignalLink]]:
    signals: dict[str, list[SignalLink]] = defaultdict(list)
    for way, held in plain.signals.items():
        light = connections[way].get("tl") if way in connections else None
        if light:
            link = SignalLink(light, int(connections[way].get("linkIndex", 0)))
            # Several connecting roads of one way may have the same signal.
            for signal_id in dict.fromkeys(held):
                signals[signal_id].append(link)
    return signals


_REMEMBERED = 64
_NO_FILE: Stamp = (0, 0)


def build(path: str | PathLike[str] | None) -> SumoNet:
    """The SUMO network of an OpenDRIVE file.

    Args:
        path: the OpenDRIVE file; None for a plain without roads, on which there is only the dock.

    Raises:
        InvalidFile, Unsupported: the OpenDRIVE file cannot be read.
        UsageError: the cache folder cannot be written.
    """
    folder = cache_folder("sumo")
    return (
        _build(None, _NO_FILE, folder) if path is None else _build(Path(path), stamp(path), folder)
    )


@lru_cache(maxsize=_REMEMBERED)
def _build(path: Path | None, _stamp: Stamp, _folder: Path) -> SumoNet:
    # The folder is a parameter, for lru_cache to tell caches apart when it is changed.
    entry = CacheEntry(read_bytes(path) if path else b"")
    index = entry.read()
    if index is None:
        network, index = convert(load(path) if path else None)
        entry.write(network, index)
    return SumoNet(
        entry.network,
        index["left_hand"],
        [(sumo_lane, LaneTrack(*track)) for sumo_lane, *track in index["tracks"]],
        {
            signal: tuple(SignalLink(*link) for link in links)
            for signal, links in index["signals"].items()
        },
        index["fallback"],
    )
