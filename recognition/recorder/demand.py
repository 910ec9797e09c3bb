"""Who drives when from where to where: the traffic of a recording as SUMO's route file."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from lxml import etree

from recognition.recorder.fleet import Fleet, Vehicle, vehicle
from schemas.errors import ToolchainError
from xodr.sumo_net import SumoNet

Lane = tuple[str, int]
"""Road id and lane id."""


class Flow(NamedTuple):
    """Vehicles that drive from one lane's carriageway to another one's, in any lane of it; vehicles per hour."""

    start: Lane
    end: Lane
    rate: float


class Departure(NamedTuple):
    """A vehicle that sets out at a time, s."""

    time: float
    flow: Flow
    vehicle: Vehicle


def departures(flows: Sequence[Flow], fleet: Fleet, end: float, rng: np.random.Generator) -> list[Departure]:
    """Random traffic until the time `end` (s): a Poisson process for each flow, in the order of time."""
    found = []
    for flow in flows:
        times = np.sort(rng.uniform(0.0, end, rng.poisson(flow.rate * end / 3600.0)))
        found += [Departure(float(time), flow, vehicle(fleet, rng)) for time in times]
    return sorted(found, key=lambda departure: departure.time)


def write_routes(departing: Sequence[Departure], net: SumoNet, path: Path) -> None:
    """Write a SUMO route file; vehicles are named by their number in the sequence."""
    root = etree.Element("routes")
    for number, departure in enumerate(departing):
        etree.SubElement(root, "vType", departure.vehicle.type, id=f"type.{number}")
    for number, departure in enumerate(departing):
        slow = departure.vehicle.kind.agent == "truck"
        etree.SubElement(
            root, "trip",
            {"from": _edge(net, departure.flow.start, first=True), "to": _edge(net, departure.flow.end, first=False)},
            id=str(number), type=f"type.{number}", depart=f"{departure.time:.2f}",
            departLane="first" if slow else "best", departSpeed="max", departPos="base",
        )  # fmt: skip
    path.write_bytes(etree.tostring(root))


def _edge(net: SumoNet, lane: Lane, first: bool) -> str:
    """The SUMO edge of a lane's carriageway where traffic comes to the road (`first`) or leaves it.

    Raises:
        ToolchainError: SUMO has no such lane.
    """
    road_id, lane_id = lane
    found = net.sumo_lane(road_id, lane_id, 0.0 if first == (lane_id < 0) else math.inf)
    if found is None:
        raise ToolchainError(f"SUMO has no lane {lane_id} of road {road_id}: {net.fallback or 'the map has none'}")
    return found.rpartition("_")[0]
