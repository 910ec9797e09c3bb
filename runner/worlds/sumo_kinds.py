"""What SUMO's drivers use of vehicles, by OpenSCENARIO category."""

from __future__ import annotations

from typing import NamedTuple


class Kind(NamedTuple):
    """SUMO vehicle class, and what SUMO's driver of such a vehicle uses: m/s², m/s², m/s (SUMO's own defaults)."""

    vehicle_class: str
    acceleration: float
    deceleration: float
    speed: float


KINDS = {
    "car": Kind("passenger", 2.6, 4.5, 55.0),
    "van": Kind("delivery", 2.6, 4.5, 55.0),
    "truck": Kind("truck", 1.3, 4.0, 36.0),
    "semitrailer": Kind("trailer", 1.1, 4.0, 36.0),
    "trailer": Kind("trailer", 1.1, 4.0, 36.0),
    "bus": Kind("bus", 1.2, 4.0, 28.0),
    "motorbike": Kind("motorcycle", 6.0, 10.0, 55.0),
    "bicycle": Kind("bicycle", 1.2, 3.0, 5.6),
    "train": Kind("rail", 0.25, 1.3, 44.0),
    "tram": Kind("tram", 1.0, 3.0, 22.0),
    "pedestrian": Kind("pedestrian", 1.5, 2.0, 1.4),
    "wheelchair": Kind("wheelchair", 1.5, 2.0, 1.4),
}
"""By OpenSCENARIO category. Everything else is an obstacle."""
OBSTACLE = Kind("ignoring", 1.0, 1.0, 55.0)
