"""Tables between OpenDRIVE and SUMO: who may use a lane of which type, and usual speed limits."""

from __future__ import annotations

from typing import NamedTuple

_NOT_ON_ROADS = (
    "pedestrian tram rail_urban rail rail_electric rail_fast ship container cable_car subway aircraft wheelchair scooter drone"
)


class Use(NamedTuple):
    """Who may use a lane: its kind (traffic goes from a lane only to lanes of its kind) and SUMO's attribute for it."""

    kind: str
    attribute: str
    classes: str


CLOSED = Use("closed", "disallow", "all")
_TRAFFIC = Use("traffic", "disallow", _NOT_ON_ROADS)
_EMERGENCY = Use("emergency", "allow", "emergency authority army")
_RAIL = Use("rail", "allow", "tram rail_urban rail rail_electric rail_fast subway")
_WALK = Use("walk", "allow", "pedestrian wheelchair")

_USES = {
    **dict.fromkeys(
        ("driving", "entry", "exit", "onRamp", "offRamp", "connectingRamp", "slipLane", "bidirectional", "mwyEntry", "mwyExit"),
        _TRAFFIC,
    ),
    **dict.fromkeys(("bus", "taxi", "HOV"), _TRAFFIC),
    **dict.fromkeys(("stop", "shoulder"), _EMERGENCY),
    **dict.fromkeys(("sidewalk", "walking"), _WALK),
    "biking": Use("bike", "allow", "bicycle"),
    **dict.fromkeys(("tram", "rail"), _RAIL),
}

SPEED_LIMITS = {
    "motorway": 130 / 3.6,
    "rural": 100 / 3.6,
    "townExpressway": 70 / 3.6,
    "lowSpeed": 30 / 3.6,
    "pedestrian": 10 / 3.6,
    "bicycle": 30 / 3.6,
}
"""What SUMO's own drivers keep to on roads whose file gives no limit, by road type, in m/s."""
USUAL_SPEED_LIMIT = 50 / 3.6
"""The same for all other roads: netconvert's own default."""


def use_of(lane_type: str) -> Use:
    """Who may use a lane of that type; lanes of unknown types are closed, as those of type none."""
    return _USES.get(lane_type, CLOSED)
