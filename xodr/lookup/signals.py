"""Signals of the roads: their places, meanings and lamps, and the lanes on which they hold."""

from __future__ import annotations

import math
from typing import NamedTuple

from xodr.graph.network import RoadNetwork
from xodr.lookup.lanelets import Key
from xodr.model import RoadObject, Signal, SignalReference
from xodr.model.road import Road

_WALKERS = "1000002"
_TWO_LAMPS = {_WALKERS, "1000007", "1000013"}
"""Types of country OpenDRIVE: lights without a yellow lamp."""
_ARROWS = {"1000011": {"10": "left", "20": "right", "30": "straight"}}
_SPEEDS = {"km/h": 1 / 3.6, "mph": 0.44704, "m/s": 1.0, "": 1 / 3.6}
"""m/s by the unit of a signal's value; without one km/h."""


class SignalPlace(NamedTuple):
    """A signal in the world.

    Attributes:
        signal: as the roads have it.
        x, y, z: middle of its face, m.
        h: direction in which the face looks, rad.
        lanes: lanes on which it holds, at its own place and where other roads refer to it.
    """

    signal: Signal
    x: float
    y: float
    z: float
    h: float
    lanes: tuple[Key, ...]


def signal_places(network: RoadNetwork) -> list[SignalPlace]:
    """All signals of the roads, in their order."""
    lanes: dict[str, list[Key]] = {}
    for road in network.roads.values():
        for signal in road.signals:
            # Before any place is made: roads may refer to signals of roads that follow.
            lanes.setdefault(signal.id, []).extend(lanes_at(road, signal))
        for reference in road.signal_references:
            lanes.setdefault(reference.signal_id, []).extend(lanes_at(road, reference))
    return [
        _placed(road, signal, tuple(dict.fromkeys(lanes[signal.id])))
        for road in network.roads.values()
        for signal in road.signals
    ]


def _placed(road: Road, signal: Signal, lanes: tuple[Key, ...]) -> SignalPlace:
    pose = road.pose(signal.s, signal.t)
    # A signal for traffic along +s looks against it (OpenDRIVE 1.9, 14.1).
    facing = pose.h + signal.h_offset + (0.0 if signal.orientation == "-" else math.pi)
    middle = pose.z + signal.z_offset + 0.5 * (signal.height or 0.0)
    return SignalPlace(signal, pose.x, pose.y, middle, math.remainder(facing, math.tau), lanes)


def is_stop_line(signal: Signal) -> bool:
    """Whether a signal is a line at which traffic stops: by its semantics, or sign 294 of German
    law, which editors write under any country."""
    return signal.priority == "stopLine" or (signal.type == "294" and not signal.dynamic)


def lanes_at(road: Road, signal: Signal | SignalReference | RoadObject) -> list[Key]:
    """Lanes for which a signal or object holds at its place."""
    number = road.section_index(min(max(signal.s, 0.0), road.length))
    section = road.sections[number]
    lanes = []
    for lane_id in (*section.right, *section.left):
        towards_s = road.direction(lane_id, section.s) > 0
        # Lanes that are named count, whatever the orientation.
        if signal.validity:
            holds = any(min(ends) <= lane_id <= max(ends) for ends in signal.validity)
        else:
            holds = signal.orientation not in ("+", "-") or (signal.orientation == "+") == towards_s
        if holds:
            lanes.append((road.id, number, lane_id))
    return lanes


def lamps(signal: Signal) -> tuple[str, ...]:
    """Colours of the lamps of a light, from top to bottom."""
    return ("red", "green") if signal.type in _TWO_LAMPS else ("red", "yellow", "green")


def arrow(signal: Signal) -> str:
    """Direction of the arrow on the lamps of a light: left, right, straight; empty without one."""
    return _ARROWS.get(signal.type, {}).get(signal.subtype, "")


def for_walkers(signal: Signal) -> bool:
    """Whether a light is for pedestrians."""
    return signal.type == _WALKERS


def speed_of(signal: Signal) -> float | None:
    """Value of a signal as a speed in m/s; None where it has none."""
    factor = _SPEEDS.get(signal.unit)
    return signal.value * factor if signal.value is not None and factor is not None else None
