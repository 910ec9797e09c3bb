"""Proposes the roles of a map's lanes from junctions, rings, lane types, speed limits, and lanes that begin or end."""

from __future__ import annotations

import math

from recognition.sites.lanes import LaneGraph, Strip
from recognition.sites.ramps import ramp_roles
from recognition.sites.roles import Entry, Role
from recognition.sites.shapes import crosses_or_turns, ring_strips
from xodr.graph.ways import DRIVABLE
from xodr.network import RoadNetwork

FAST = 70.0 / 3.6 + 0.01
"""Roads with a limit above this (m/s) are no urban ones: METHOD says at most 70 km/h, and files round."""
_ENTERING = ("onRamp", "entry", "mwyEntry")
_LEAVING = ("offRamp", "exit", "mwyExit")
_LIGHT = "1000001"
"""Type of a traffic light in OpenDRIVE's own catalogue of signals."""


def propose(
    network: RoadNetwork, graph: LaneGraph, lights: frozenset[str] = frozenset(), driven: float = math.inf
) -> list[Entry]:
    """A role for every driving lane, by road, lane and s.

    Args:
        lights: roads that traffic lights are for, besides those with signals.
        driven: speed (m/s) that free vehicles have there, infinite where it is not known.
    """
    roles = _Proposal(network, graph, lights, driven).roles
    entries = [_entry(graph.strips[number], role) for number, role in roles.items()]
    return _joined(sorted(entries, key=lambda entry: (list(network.roads).index(entry.road), entry.lane, entry.start)))


class _Proposal:
    def __init__(self, network: RoadNetwork, graph: LaneGraph, lights: frozenset[str], driven: float) -> None:
        self._network, self._graph, self._lights, self._driven = network, graph, lights, driven
        self._rings = ring_strips(network, graph)
        self._crossings = {name: lit for name in network.junctions if (lit := self._crossing(name)) is not None}
        driving = [number for number, strip in enumerate(graph.strips) if strip.kind in DRIVABLE]
        self.roles = {number: self._first(number) for number in driving}
        self.roles |= ramp_roles(graph, {number for number, role in self.roles.items() if role is Role.MAIN})
        self._add_approaches()

    def _first(self, number: int) -> Role:
        """The role that a strip has by itself."""
        strip = self._graph.strips[number]
        junction = self._network.roads[strip.road].junction_id
        if number in self._rings:
            return Role.RING
        if any(after in self._rings for after in self._graph.following[number]):
            return Role.ENTRY
        if any(before in self._rings for before in self._graph.preceding[number]):
            return Role.EXIT
        if strip.kind in _ENTERING:
            return Role.ON_RAMP
        if strip.kind in _LEAVING:
            return Role.OFF_RAMP
        if self._fast(strip):
            return Role.MAIN
        if junction in self._crossings:
            return Role.SIGNALISED if self._crossings[junction] else Role.INSIDE
        return Role.URBAN

    def _fast(self, strip: Strip) -> bool:
        """Whether a strip is no urban one. Where the map has neither kind nor limit, crossings and slow traffic make it urban."""
        road = self._network.roads[strip.road]
        kind = road.road_type(0.5 * (strip.start + strip.end))
        if kind != "unknown" or math.isfinite(strip.speed_limit):
            return kind.startswith("motorway") or (strip.speed_limit > FAST and not kind.startswith("town"))
        return self._driven > FAST and not self._crossings and not self._rings

    def _crossing(self, junction_id: str) -> bool | None:
        """Whether a junction has traffic lights; None where it is no junction: no way crosses or turns, or it is on a ring."""
        junction = self._network.junctions[junction_id]
        inside = {connection.connecting_road for connection in junction.connections} if junction.type != "direct" else set()
        ways = [number for number, strip in enumerate(self._graph.strips) if strip.road in inside and strip.kind in DRIVABLE]
        if self._rings.intersection(ways) or not crosses_or_turns(self._network, self._graph, ways):
            return None
        incoming = {self._graph.strips[before].road for number in ways for before in self._graph.preceding[number]}
        signals = [signal for road in incoming | inside for signal in self._network.roads[road].signals]
        lit = any(signal.dynamic or signal.type == _LIGHT for signal in signals)
        return lit or bool(junction.controllers) or not self._lights.isdisjoint(incoming | inside)

    def _add_approaches(self) -> None:
        crossings = (Role.INSIDE, Role.SIGNALISED, Role.ENTRY)
        for number, role in self.roles.items():
            if role is Role.URBAN and any(self.roles.get(after) in crossings for after in self._graph.following[number]):
                self.roles[number] = Role.APPROACH


def _entry(strip: Strip, role: Role) -> Entry:
    return Entry(strip.road, strip.lane, strip.start, strip.end, role)


def _joined(entries: list[Entry]) -> list[Entry]:
    """Neighbouring stretches of one lane and role as one."""
    joined: list[Entry] = []
    for entry in entries:
        last = joined[-1] if joined else None
        if last and (last.road, last.lane, last.end, last.role) == (entry.road, entry.lane, entry.start, entry.role):
            joined[-1] = last._replace(end=entry.end)
        else:
            joined.append(entry)
    return joined
