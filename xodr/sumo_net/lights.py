"""Traffic lights: which OpenDRIVE signals hold traffic, and where they make it wait in SUMO."""

from __future__ import annotations

from typing import NamedTuple

from xodr.model import Signal, SignalReference
from xodr.network import RoadNetwork
from xodr.road import Road

APPROACH = 30.0
"""A light at most this far before a junction holds traffic at the junction, otherwise where it stands, in m."""

_FOR_OTHERS = ("1000002", "1000007", "1000013")
"""Signal types of country OpenDRIVE: lights for pedestrians and cyclists only."""


class Light(NamedTuple):
    """One light for one direction of travel on one road.

    direction: +1 for traffic towards +s, -1 for traffic towards -s.
    s: where traffic waits; None at the end of the road, before the junction.
    """

    signal_id: str
    direction: int
    s: float | None
    validity: tuple[tuple[int, int], ...]

    def holds(self, lane_id: int, direction: int) -> bool:
        """Whether traffic in that lane and direction has to obey."""
        valid = not self.validity or any(min(pair) <= lane_id <= max(pair) for pair in self.validity)
        return valid and direction == self.direction


def lights(network: RoadNetwork) -> dict[str, list[Light]]:
    """All traffic lights by the road for whose traffic they are, signal references included."""
    controlled = frozenset(signal for controller in network.controllers.values() for signal in controller.signals)
    signals = {signal.id: signal for road in network.roads.values() for signal in road.signals}
    ids = {signal.id for signal in signals.values() if _is_light(signal, controlled)}
    found: dict[str, list[Light]] = {}
    for road in network.roads.values():
        own = [light for signal in road.signals if signal.id in ids for light in _directions(road, signal.id, signal)]
        others = [
            light
            for other in road.signal_references
            if other.signal_id in ids
            for light in _directions(road, other.signal_id, other)
        ]
        found[road.id] = own + others
    return found


def _is_light(signal: Signal, controlled: frozenset[str]) -> bool:
    known = signal.type.startswith("10000") or signal.id in controlled
    return signal.dynamic and known and signal.type not in _FOR_OTHERS


def _directions(road: Road, signal_id: str, signal: Signal | SignalReference) -> list[Light]:
    directions = {"+": (1,), "-": (-1,)}.get(signal.orientation, (1, -1))
    return [Light(signal_id, direction, _stop(road, signal.s, direction), signal.validity) for direction in directions]


def _stop(road: Road, s: float, direction: int) -> float | None:
    """Where traffic waits for a light at s: None for the junction ahead, where it is near or the light stands behind the road."""
    link, left = (road.successor, road.length - s) if direction > 0 else (road.predecessor, s)
    at_junction = link is not None and link.element_type == "junction" and left <= APPROACH
    return None if at_junction or not 0.5 < s < road.length - 0.5 else s
