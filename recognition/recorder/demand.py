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


class Parking(NamedTuple):
    """Vehicles that stand in a lane, in a row with even spacing, and drive off one by one.

    Attributes:
        first, last: where they stand, from and to, s in m. spacing: m.
        end: a lane on the road that they go to.
    """

    lane: Lane
    first: float
    last: float
    spacing: float
    end: Lane


class Stand(NamedTuple):
    """A place in a lane, s in m, that is left at a time, s."""

    lane: Lane
    s: float
    until: float


class Departure(NamedTuple):
    """A vehicle that sets out at a time (s), from the road's beginning or from where it stands."""

    time: float
    vehicle: Vehicle
    start: Lane
    end: Lane
    stand: Stand | None = None


def departures(flows: Sequence[Flow], fleet: Fleet, end: float, rng: np.random.Generator) -> list[Departure]:
    """Random traffic until the time `end` (s): a Poisson process for each flow, in the order of time."""
    found = []
    for flow in flows:
        times = np.sort(rng.uniform(0.0, end, rng.poisson(flow.rate * end / 3600.0)))
        found += [Departure(float(time), vehicle(fleet, rng), flow.start, flow.end) for time in times]
    return sorted(found, key=lambda departure: departure.time)


def parked(rows: Sequence[Parking], fleet: Fleet, begin: float, end: float, rng: np.random.Generator) -> list[Departure]:
    """Vehicles that stand in rows from the time 0 on and drive off between `begin` and `end`, s."""
    found = []
    for row in rows:
        for s in np.arange(row.first, row.last, row.spacing).tolist():
            stand = Stand(row.lane, s, float(rng.uniform(begin, end)))
            found.append(Departure(0.0, vehicle(fleet, rng), row.lane, row.end, stand))
    return found


def write_routes(departing: Sequence[Departure], net: SumoNet, path: Path) -> None:
    """Write a SUMO route file; vehicles are named by their number in the sequence."""
    root = etree.Element("routes")
    for number, departure in enumerate(departing):
        etree.SubElement(root, "vType", departure.vehicle.type, id=f"type.{number}")
    for number, departure in enumerate(departing):
        trip = etree.SubElement(
            root, "trip", {"from": _edge(net, departure.start, first=True), "to": _edge(net, departure.end, first=False)},
            id=str(number), type=f"type.{number}", depart=f"{departure.time:.2f}",
            departLane="first" if departure.vehicle.kind.agent == "truck" else "best", departSpeed="max", departPos="base",
        )  # fmt: skip
        if departure.stand:
            _stand(trip, net, departure.stand)
    path.write_bytes(etree.tostring(root))


def _stand(trip: etree._Element, net: SumoNet, stand: Stand) -> None:
    """Let a trip begin where its vehicle stands."""
    name = _sumo_lane(net, stand.lane, stand.s)
    edge, _, index = name.rpartition("_")
    place = f"{abs(stand.s - net.sumo_lanes[name].start):.2f}"
    trip.attrib.update({"from": edge, "departLane": index, "departPos": place, "departSpeed": "0"})
    etree.SubElement(trip, "stop", lane=name, endPos=place, until=f"{stand.until:.2f}")


def _edge(net: SumoNet, lane: Lane, first: bool) -> str:
    """The SUMO edge of a lane's carriageway where traffic comes to the road (`first`) or leaves it."""
    return _sumo_lane(net, lane, 0.0 if first == (lane[1] < 0) else math.inf).rpartition("_")[0]


def _sumo_lane(net: SumoNet, lane: Lane, s: float) -> str:
    """The SUMO lane of a lane at s.

    Raises:
        ToolchainError: SUMO has no such lane.
    """
    found = net.sumo_lane(*lane, s)
    if found is None:
        raise ToolchainError(f"SUMO has no lane {lane[1]} of road {lane[0]}: {net.fallback or 'the map has none'}")
    return found
