"""Sites: places of recordings with their roads, the fit of a map to a recording, and the role of
each lane.

Modules:

- `cut`: scenes cut out of recordings: participants
- `lanes`: the lanes of a road network as a graph in the direction of their traffic
- `ramps`: ramps by the shapes of lanes, and by observed traffic
- `roles`: roles of lanes by their shapes

Example::

    site = site_of(source, recording, roads)  # roads, and the role of each lane
    place(recording, site.network)  # road coordinates of all rows
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from recognition.recordings import Check, SiteRoad, Source
from recognition.recordings.intake import REFUSED
from recognition.scenes.lanes import LaneGraph, Strip, graph
from recognition.scenes.ramps import LaneGuess, ramp_roles
from recognition.scenes.roles import (
    LaneRole,
    RoleRange,
    Roles,
    crosses_or_turns,
    ring_strips,
    roles_of,
)
from runner.recording import Recording, Track
from schemas.common.array_types import FloatArray, IntArray
from schemas.common.errors import InvalidFile, UsageError
from schemas.common.storage import writing
from xodr.graph.network import RoadNetwork
from xodr.graph.ways import DRIVABLE
from xodr.lookup import placing
from xodr.model import RoadPoint
from xodr.reader import load


def map_of(source: Source, recording: Recording, folder: Path) -> SiteRoad:
    """The road of a recording, made in `folder` where OpenDRIVE is missing.

    Raises:
        InvalidFile: a file is malformed, or a run's road is not where it was.
        UsageError: the source has no information about its roads, or the folder can't be written.
    """
    # From the surest to the least sure: the user's word, the recording's own road, a file, a made
    # one.
    beside = source.path.parent / f"{source.site}.xodr"
    if source.given is not None:
        return SiteRoad(source.given, notes=(f"the road is {source.given.name}, as --road says",))
    if recording.network is not None:
        return SiteRoad(Path(recording.network.path))
    if beside.is_file():
        return SiteRoad(beside)
    if source.road is not None:
        with writing("the road", folder):
            return source.road(recording, folder)
    what = (
        f"{source.name} has no map: neither {beside.name} beside it nor a Lanelet2 map "
        f"{source.site}.osm. A road: --road FILE or its name, as --road highway_straight (lanes "
        "along x, 0 to 2,000 m, at y = -1.9, -5.6 and -9.4 m); scenarios without classes on a "
        "plane: "
        f"xosc-recognize replay {source.path.name} --out FILE.xosc"
    )
    raise UsageError(what, path=source.path)


LIT = "turns, crossings and merging at junctions with traffic lights count with --signalised only"
"""Remark on recordings of such junctions"""
_LEAST_ON_ROAD = 1.0 / 3.0
"""Least share of the vehicles' places that are on a road: on its own map it is 65 % in the worst of
the real recordings."""
_MOST_ON_ROAD = 0.98
"""Share from which nothing is said"""
_SHOWN = 0.01
"""Least share that is printed in percent"""
_MOST_ASTRAY = 1.0 / 3.0
"""Greatest share of places where vehicles go astray: on its own map it is 3 % in the worst of the
real recordings, on that of another junction, or turned or mirrored, mostly 45 % and more where five
move. Of four, two may have ways that it lacks."""
_ASTRAY = math.radians(45.0)
"""Vehicles whose motion is more than this away from the traffic of their lane (rad) go across it or
against it."""
_MOVING = 2.0
"""Least speed of vehicles whose direction of motion counts, m/s."""
_SAMPLED = 500
"""Rows of a recording that are looked at."""


def fit(recording: Recording, network: RoadNetwork, name: str) -> list[Check]:
    """Compare a map, by its `name`, with a recording: it may be that of another place, or lack
    lanes."""
    on_road, astray = share_on_road(recording, network), share_astray(recording, network)
    needed = "a map of this place is needed, in the same coordinates"
    found = []
    if on_road < _LEAST_ON_ROAD:
        found.append(
            Check(
                "map",
                REFUSED,
                1.0 - on_road,
                f"only {on_road:.0%} of the vehicles' places are on a road of {name}: {needed}",
            )
        )
    elif on_road < _MOST_ON_ROAD:
        found.append(
            Check(
                "map",
                None,
                1.0 - on_road,
                f"{on_road:.0%} of the vehicles' places are on a road of {name}; what happens off "
                "it is not found",
            )
        )
    share = f"{astray:.0%}" if astray >= _SHOWN else f"less than {_SHOWN:.0%}"
    across = (
        f"at {share} of their places vehicles go across the lanes of {name} or against the "
        "traffic there"
    )
    if astray > _MOST_ASTRAY:
        found.append(Check("flow", REFUSED, astray, f"{across}: {needed}"))
    elif astray > 0.0:
        found.append(Check("flow", None, astray, across))
    return found


def share_on_road(recording: Recording, network: RoadNetwork) -> float:
    """Share of the places of vehicles that are on a lane, by some of all; 1 where there is no
    vehicle.

    Vehicles that never move may be parked beside the road: they count only where no other is.
    """
    vehicles = [track for track in recording.tracks.values() if track.kind == "vehicle"]
    movers = [track for track in vehicles if (np.abs(track.columns["speed"]) >= _MOVING).any()]
    points = _on_lanes(_sampled(movers or vehicles), network)
    return float(np.mean([point is not None for point in points])) if points else 1.0


def share_astray(recording: Recording, network: RoadNetwork) -> float:
    """Share of the places on lanes where moving vehicles go across the lane or against its traffic,
    by some of all.

    Cyclists don't count, nor does the vehicle that goes astray most: a single one may turn where
    the map has no lane. 0 where there is no other.
    """
    motor = [
        track
        for track in recording.tracks.values()
        if track.kind == "vehicle" and track.category != "bicycle"
    ]
    sample = _sampled(motor, _MOVING)
    points = _on_lanes(sample, network)
    on = np.array([point is not None for point in points], bool)
    ways = np.array([_way(network, point) for point in points if point is not None])
    astray = np.abs(np.remainder(sample.h[on] - ways + math.pi, math.tau) - math.pi) > _ASTRAY
    track = sample.track[on]
    # The worst vehicle apart: one turn that the map lacks must not refuse a whole map.
    others = track != np.bincount(track, astray, minlength=1).argmax()
    return float(astray[others].mean()) if others.any() else 0.0


class _Sample(NamedTuple):
    """Sample of the rows of tracks: number of the track, place (m), direction of motion (rad)."""

    track: IntArray
    x: FloatArray
    y: FloatArray
    z: FloatArray
    h: FloatArray


def _sampled(tracks: Sequence[Track], slowest: float = 0.0) -> _Sample:
    """Rows spread evenly over those that are no slower (m/s)."""
    columns = [track.columns for track in tracks]
    x, y, z, h, speed = (
        np.concatenate([np.zeros(0), *(one[name] for one in columns)])
        for name in ("x", "y", "z", "h", "speed")
    )
    track = np.repeat(np.arange(len(columns)), np.array([len(one["x"]) for one in columns], int))
    # Over rows, not tracks: a vehicle that was recorded for long says more about the map.
    fast = np.flatnonzero(np.abs(speed) >= slowest)
    rows = fast[np.linspace(0, len(fast) - 1, _SAMPLED).astype(int)] if len(fast) else fast
    # A vehicle in reverse moves against its heading.
    return _Sample(
        track[rows], x[rows], y[rows], z[rows], np.where(speed < 0.0, h + math.pi, h)[rows]
    )


def _on_lanes(sample: _Sample, network: RoadNetwork) -> list[RoadPoint | None]:
    """The road point of each row, None where that is on no lane."""
    places = placing.place(network, sample.x, sample.y, sample.z, sample.h)
    columns = (places.road_id, places.s, places.t, places.lane_id, places.offset)
    points = (RoadPoint(*row) for row in zip(*(column.tolist() for column in columns), strict=True))
    return [point if network.on_road(point) else None for point in points]


def _way(network: RoadNetwork, point: RoadPoint) -> float:
    """Heading of the traffic of a point's lane, rad."""
    road = network.roads[point.road_id]
    return road.heading(point.s) + (math.pi if road.direction(point.lane_id, point.s) < 0 else 0.0)


FAST = 70.0 / 3.6 + 0.01
"""Roads with a limit above this (m/s) are no urban ones: METHOD says at most 70 km/h, and files
round."""
_ENTERING = ("onRamp", "entry", "mwyEntry")
_LEAVING = ("offRamp", "exit", "mwyExit")
_LIGHT = "1000001"
"""Type of a traffic light in OpenDRIVE's own catalogue of signals."""


def propose(
    network: RoadNetwork,
    graph: LaneGraph,
    lights: frozenset[str] = frozenset(),
    driven: float = math.inf,
) -> list[RoleRange]:
    """A role for every driving lane, by road, lane and s.

    Args:
        lights: roads that traffic lights are for, besides those with signals.
        driven: speed (m/s) that free vehicles have there, infinite where it is not known.
    """
    roles = _Proposal(network, graph, lights, driven).roles
    entries = [_entry(graph.strips[number], guess) for number, guess in roles.items()]
    return _joined(
        sorted(
            entries,
            key=lambda entry: (list(network.roads).index(entry.road), entry.lane, entry.start),
        )
    )


class _Proposal:
    def __init__(
        self, network: RoadNetwork, graph: LaneGraph, lights: frozenset[str], driven: float
    ) -> None:
        self._network, self._graph, self._lights, self._driven = network, graph, lights, driven
        self._rings = ring_strips(graph)
        self._crossings = {
            name: lit for name in network.junctions if (lit := self._crossing(name)) is not None
        }
        driving = [number for number, strip in enumerate(graph.strips) if strip.kind in DRIVABLE]
        first = {number: self._first(number) for number in driving}
        self.roles = {number: LaneGuess(role) for number, role in first.items()}
        # After the others: an approach is told by the role of the lane that follows.
        self._add_approaches()
        own = {number: guess.role for number, guess in self.roles.items()}
        self.roles |= ramp_roles(network, graph, own)

    def _first(self, number: int) -> LaneRole:
        """The role that a strip has by itself."""
        strip = self._graph.strips[number]
        junction = self._network.roads[strip.road].junction_id
        # From the surest sign to the weakest: the first one that fits decides.
        if number in self._rings:
            return LaneRole.RING
        if any(after in self._rings for after in self._graph.following[number]):
            return LaneRole.ENTRY
        if any(before in self._rings for before in self._graph.preceding[number]):
            return LaneRole.EXIT
        if strip.kind in _ENTERING:
            return LaneRole.ON_RAMP
        if strip.kind in _LEAVING:
            return LaneRole.OFF_RAMP
        if self._fast(strip):
            return LaneRole.MAIN
        if junction in self._crossings:
            return LaneRole.SIGNALISED if self._crossings[junction] else LaneRole.INSIDE
        return LaneRole.URBAN

    def _fast(self, strip: Strip) -> bool:
        """Whether a strip is no urban one. Where the map has neither kind nor limit, crossings and
        slow traffic make it urban."""
        road = self._network.roads[strip.road]
        kind = road.road_type(0.5 * (strip.start + strip.end))
        if kind != "unknown" or math.isfinite(strip.speed_limit):
            return kind.startswith("motorway") or (
                strip.speed_limit > FAST and not kind.startswith("town")
            )
        return self._driven > FAST and not self._crossings and not self._rings

    def _crossing(self, junction_id: str) -> bool | None:
        """Whether a junction has traffic lights; None where it is no junction: no way crosses or
        turns, or it is on a ring."""
        junction = self._network.junctions[junction_id]
        # Direct junctions join and split ramps, where no way crosses another one.
        inside = (
            {connection.connecting_road for connection in junction.connections}
            if junction.type != "direct"
            else set()
        )
        ways = [
            number
            for number, strip in enumerate(self._graph.strips)
            if strip.road in inside and strip.kind in DRIVABLE
        ]
        if self._rings.intersection(ways) or not crosses_or_turns(self._network, self._graph, ways):
            return None
        incoming = {
            self._graph.strips[before].road
            for number in ways
            for before in self._graph.preceding[number]
        }
        signals = [
            signal for road in incoming | inside for signal in self._network.roads[road].signals
        ]
        lit = any(signal.dynamic or signal.type == _LIGHT for signal in signals)
        return lit or bool(junction.controllers) or not self._lights.isdisjoint(incoming | inside)

    def _add_approaches(self) -> None:
        crossings = (LaneRole.INSIDE, LaneRole.SIGNALISED, LaneRole.ENTRY)
        own = {number: guess.role for number, guess in self.roles.items()}
        for number, role in own.items():
            if role is LaneRole.URBAN and any(
                own.get(after) in crossings for after in self._graph.following[number]
            ):
                self.roles[number] = LaneGuess(LaneRole.APPROACH)


def _entry(strip: Strip, guess: LaneGuess) -> RoleRange:
    return RoleRange(strip.road, strip.lane, strip.start, strip.end, *guess)


def _joined(entries: list[RoleRange]) -> list[RoleRange]:
    """Neighbouring stretches of one lane and role as one."""
    joined: list[RoleRange] = []
    for entry in entries:
        last = joined[-1] if joined else None
        if last is not None and entry == last._replace(start=last.end, end=entry.end):
            joined[-1] = last._replace(end=entry.end)
        else:
            joined.append(entry)
    return joined


_FREE = 0.95
"""Quantile of the speeds of motor vehicles at which one drives freely, if any does"""

__all__ = ["LaneRole", "RoleRange", "Roles", "Site", "place", "site_at", "site_of"]


@dataclass(frozen=True, eq=False)
class Site:
    """A place of recordings.

    Attributes:
        path: its OpenDRIVE file.
        network: the roads in it.
        roles: what its lanes are for.
    """

    path: Path
    network: RoadNetwork
    roles: Roles

    @property
    def lanes(self) -> LaneGraph:
        """The lanes of its roads."""
        return graph(self.network)


def site_at(
    path: Path,
    network: RoadNetwork | None = None,
    lights: frozenset[str] = frozenset(),
    folder: Path | None = None,
    driven: float = math.inf,
) -> Site:
    """The site with this OpenDRIVE file; its roles are those in an edited file, else proposed ones.

    Args:
        network: what the file describes, where it is loaded already.
        lights: roads that traffic lights are for, besides those with signals.
        folder: where proposals are written, to be edited; by default beside the map.
        driven: speed (m/s) that free vehicles have there; it decides about roads of which the map
            gives neither kind nor limit.

    Raises:
        InvalidFile: the map or the roles are malformed, or don't fit each other.
    """
    network = network or load(path)
    return Site(
        path,
        network,
        roles_of(network, propose(network, graph(network), lights, driven), folder or path.parent),
    )


def site_of(source: Source, recording: Recording, roads: Path) -> Site:
    """Site of a recording; assumptions about its road join the remarks of the source's report.

    The road that the user names (`--road`) counts first. highD: the road that the recording brings
    along. Own runs: theirs. Others: `<site>.xodr` beside the tracks, else a road made of the site's
    Lanelet2 map, of the scenario's lanelets (CommonRoad), of the map or lanes of a trace (OSI), or
    of the lateral positions (NGSIM tables).

    Args:
        source: where the recording is from.
        roads: folder for roads that have to be made, and for proposed roles.

    Raises:
        InvalidFile: a map or its roles are malformed, or don't fit each other, or the map is that
            of another place.
        UsageError: the source has no information about its roads.
    """
    road = map_of(source, recording, roads)
    if source.report is not None:
        source.report.remarks += (note for note in road.notes if note not in source.report.remarks)
    brought = recording.network if source.given is None else None
    # A network that was read with the recording is not read twice: maps take seconds.
    network = brought or load(road.path)
    # Recorded phases do not say which roads they are for: all junctions have lights then.
    lights = frozenset(network.roads) if road.signalised else road.lights
    site = site_at(road.path, network, lights, roads, _driven(recording))
    if source.report is not None:
        doubts = [f"no ramp and no lane change is labelled on {one}" for one in site.roles.doubts]
        lit = any(entry.role is LaneRole.SIGNALISED for entry in site.roles.entries)
        doubts += [LIT] if lit else []
        source.report.remarks += (one for one in doubts if one not in source.report.remarks)
    # A road that the recording brings along is of its place; any other one may not be.
    if brought is None:
        checks = fit(recording, site.network, (source.map or road.path).name)
        if source.report is not None:
            source.report.checks += checks
        refused = [check.reason for check in checks if check.verdict == REFUSED]
        if refused:
            raise InvalidFile("; ".join(refused), path=source.path)
    return site


def place(recording: Recording, network: RoadNetwork) -> None:
    """Complete the road coordinates of every row that lacks them, of all tracks at once.

    Rows that have them keep them: a run knows the lanes that its vehicles followed.
    """
    columns = [track.columns for track in recording.tracks.values()]
    missing = [np.flatnonzero(one["road_id"] == None) for one in columns]  # noqa: E711 - of each element
    ends = np.cumsum([len(rows) for rows in missing])
    if not len(ends) or not ends[-1]:
        return
    x, y, z, h = (
        np.concatenate([one[name][rows] for one, rows in zip(columns, missing, strict=True)])
        for name in ("x", "y", "z", "h")
    )
    places = placing.place(network, x, y, z, h)
    names = {
        "road_id": "road_id",
        "lane_id": "lane_id",
        "s": "s",
        "t": "t",
        "lane_offset": "offset",
    }
    for one, rows, end in zip(columns, missing, ends.tolist(), strict=True):
        for column, name in names.items():
            one[column][rows] = getattr(places, name)[end - len(rows) : end]


def _driven(recording: Recording) -> float:
    """Speed (m/s) of the free motor vehicles of a recording; infinite without any."""
    motor = [
        track
        for track in recording.tracks.values()
        if track.kind == "vehicle" and track.category != "bicycle"
    ]
    speeds = [np.abs(track.columns["speed"]) for track in motor]
    return float(np.quantile(np.concatenate(speeds), _FREE)) if speeds else math.inf
