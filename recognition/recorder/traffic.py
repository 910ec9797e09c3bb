"""Recorded traffic: the fleet's vehicles and drivers, and the demand on each route."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from lxml import etree

from schemas.common.errors import ToolchainError
from xodr.formats.sumo_net import SumoNet

_SPREAD = 2.5
"""Normal values farther than this from their mean, in standard deviations, are cut off."""


class Normal(NamedTuple):
    """A normal distribution."""

    mean: float
    sd: float

    def draw(self, rng: np.random.Generator) -> float:
        """One value."""
        return self.mean + self.sd * float(np.clip(rng.standard_normal(), -_SPREAD, _SPREAD))


class Uniform(NamedTuple):
    """A uniform distribution."""

    low: float
    high: float

    def draw(self, rng: np.random.Generator) -> float:
        """One value."""
        return float(rng.uniform(self.low, self.high))


class Kind(NamedTuple):
    """A kind of vehicle with its drivers.

    Attributes:
        vehicle_class: SUMO's name. agent: INTERACTION's name.
        length, width: m.
        speed_factor: desired speed over speed limit. top: speed that is never exceeded, m/s.
        acceleration, braking: the greatest, m/s².
    """

    vehicle_class: str
    agent: str
    length: Normal
    width: Normal
    speed_factor: Normal
    top: Normal
    acceleration: Uniform
    braking: Uniform


Driver = dict[str, Normal | Uniform]
"""Distributions of SUMO's parameters of a driver: `tau` is the desired headway (s), `minGap` the
gap in a queue (m), `lcAssertive` the factor by which smaller gaps are taken in lane changes,
`lcSpeedGain` and `lcKeepRight` the eagerness to overtake and to return, `lcSpeedGainLookahead` how
far ahead slow vehicles are avoided (s)."""


class Fleet(NamedTuple):
    """Shares of kinds of vehicles, 1 in sum, and their drivers."""

    kinds: dict[Kind, float]
    driver: Driver


CAR = Kind(
    "passenger", "car", Normal(4.45, 0.3), Normal(1.83, 0.06), Normal(1.0, 0.12), Normal(55, 5),
    Uniform(1.5, 2.8), Uniform(2.5, 4.5),
)  # fmt: skip
VAN = Kind(
    "delivery", "van", Normal(5.9, 0.4), Normal(2.02, 0.05), Normal(0.92, 0.1), Normal(42, 3),
    Uniform(1.2, 2.0), Uniform(2.5, 4.0),
)  # fmt: skip
LORRY = Kind(
    "truck", "truck", Normal(8.5, 1.0), Normal(2.48, 0.04), Normal(0.9, 0.06), Normal(25, 1.2),
    Uniform(0.8, 1.3), Uniform(2.0, 3.5),
)  # fmt: skip
TRAILER = Kind(
    "trailer", "truck", Normal(15.5, 0.7), Normal(2.52, 0.02), Normal(0.9, 0.05), Normal(24, 0.8),
    Uniform(0.6, 1.0), Uniform(2.0, 3.0),
)  # fmt: skip
MOTORBIKE = Kind(
    "motorcycle", "motorcycle", Normal(2.15, 0.08), Normal(0.85, 0.04), Normal(1.05, 0.12),
    Normal(55, 5),
    Uniform(2.0, 3.5), Uniform(3.0, 5.0),
)  # fmt: skip

_DRIVER: Driver = {
    "impatience": Uniform(0.6, 0.9),  # at junctions: 1 makes others brake
    "jmTimegapMinor": Uniform(0.3, 0.8),  # to others at junctions, s
    "lcKeepRight": Uniform(1.0, 5.0),
    "lcCooperative": Uniform(0.4, 1.0),
    "lcSigma": Uniform(0.0, 0.1),  # unrest within the lane, m
    "latAlignment": Normal(0.0, 0.12),  # from the middle of the lane, m
    "maxSpeedLat": Uniform(0.8, 1.5),  # m/s
    "lcAccelLat": Uniform(0.5, 1.1),  # m/s²
    "lcMaxSpeedLatStanding": Uniform(0.2, 0.2),  # m/s
    "lcMaxSpeedLatFactor": Uniform(0.15, 0.3),  # lateral speed beyond that, over the speed
    "minGapLat": Uniform(0.3, 0.6),  # m
}

MOTORWAY = Fleet(
    {CAR: 0.78, VAN: 0.08, LORRY: 0.05, TRAILER: 0.09},
    _DRIVER
    | {
        "tau": Uniform(0.8, 1.7),
        "minGap": Uniform(1.5, 3.0),
        "lcAssertive": Uniform(1.2, 2.5),
        "lcSpeedGain": Uniform(2.0, 8.0),
    },
)
TOWN = Fleet(
    {CAR: 0.86, VAN: 0.08, LORRY: 0.03, MOTORBIKE: 0.03},
    _DRIVER
    | {
        "tau": Uniform(0.4, 1.0),
        "minGap": Uniform(1.0, 2.0),
        "lcAssertive": Uniform(2.0, 20.0),
        "lcSpeedGain": Uniform(0.2, 8.0),
        "lcSpeedGainLookahead": Uniform(0.0, 2.0),
    },
)
"""Fleet with less patient drivers and smaller gaps."""


class Vehicle(NamedTuple):
    """One vehicle with its driver; m. `type` holds the attributes of its SUMO vehicle type."""

    kind: Kind
    length: float
    width: float
    type: dict[str, str]


def vehicle(fleet: Fleet, rng: np.random.Generator) -> Vehicle:
    """Draw a vehicle."""
    kind = list(fleet.kinds)[int(rng.choice(len(fleet.kinds), p=list(fleet.kinds.values())))]
    length, width = (round(size.draw(rng), 2) for size in (kind.length, kind.width))
    drawn = {name: distribution.draw(rng) for name, distribution in fleet.driver.items()}
    drawn |= {
        "length": length, "width": width, "speedFactor": max(kind.speed_factor.draw(rng), 0.5),
        "maxSpeed": kind.top.draw(rng),
        "accel": kind.acceleration.draw(rng), "decel": kind.braking.draw(rng),
    }  # fmt: skip
    # The speed factor has been drawn: SUMO must not vary it once more.
    fixed = {"vClass": kind.vehicle_class, "carFollowModel": "EIDM", "speedDev": "0"}
    return Vehicle(
        kind, length, width, fixed | {name: f"{value:.3f}" for name, value in drawn.items()}
    )


Lane = tuple[str, int]
"""Road id and lane id."""


class Flow(NamedTuple):
    """Vehicles that drive from one lane's carriageway to another one's, in any lane of it; vehicles
    per hour."""

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


def departures(
    flows: Sequence[Flow], fleet: Fleet, end: float, rng: np.random.Generator
) -> list[Departure]:
    """Random traffic until the time `end` (s): a Poisson process for each flow, in the order of
    time."""
    found = []
    for flow in flows:
        # Given their number, the times of a Poisson process are uniform.
        times = np.sort(rng.uniform(0.0, end, rng.poisson(flow.rate * end / 3600.0)))
        found += [
            Departure(float(time), vehicle(fleet, rng), flow.start, flow.end) for time in times
        ]
    return sorted(found, key=lambda departure: departure.time)


def parked(
    rows: Sequence[Parking], fleet: Fleet, begin: float, end: float, rng: np.random.Generator
) -> list[Departure]:
    """Vehicles that stand in rows from the time 0 on and drive off between `begin` and `end`, s."""
    departures = []
    for row in rows:
        for s in np.arange(row.first, row.last, row.spacing).tolist():
            stand = Stand(row.lane, s, float(rng.uniform(begin, end)))
            departures.append(Departure(0.0, vehicle(fleet, rng), row.lane, row.end, stand))
    return departures


def write_routes(departing: Sequence[Departure], net: SumoNet, path: Path) -> None:
    """Write a SUMO route file; vehicles are named by their number in the sequence."""
    root = etree.Element("routes")
    for number, departure in enumerate(departing):
        etree.SubElement(root, "vType", departure.vehicle.type, id=f"type.{number}")
    for number, departure in enumerate(departing):
        # Lorries begin in the rightmost lane that they may use, SUMO's first.
        trip = etree.SubElement(
            root, "trip", {"from": _edge(net, departure.start, first=True),
                "to": _edge(net, departure.end, first=False)},
            id=str(number), type=f"type.{number}", depart=f"{departure.time:.2f}",
            departLane="first" if departure.vehicle.kind.agent == "truck" else "best",
            departSpeed="max", departPos="base",
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
    """SUMO edge of a lane's carriageway where traffic enters the road (`first`) or leaves it."""
    # Lanes with negative ids lead along +s, those with positive ids against it.
    return _sumo_lane(net, lane, 0.0 if first == (lane[1] < 0) else math.inf).rpartition("_")[0]


def _sumo_lane(net: SumoNet, lane: Lane, s: float) -> str:
    """The SUMO lane of a lane at s.

    Raises:
        ToolchainError: SUMO has no such lane.
    """
    found = net.sumo_lane(*lane, s)
    if found is None:
        raise ToolchainError(
            f"SUMO has no lane {lane[1]} of road {lane[0]}: {net.fallback or 'the map has none'}"
        )
    return found
