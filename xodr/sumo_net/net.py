"""SUMO networks of OpenDRIVE files: lane and signal indexes, lane types with their SUMO vehicle classes, usual speed limits."""

from __future__ import annotations

from bisect import bisect_right
from collections import defaultdict
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

_NOT_ON_ROADS = (
    "pedestrian tram rail_urban rail rail_electric rail_fast ship container cable_car subway aircraft wheelchair scooter drone"
)


class Use(NamedTuple):
    """Permitted use of a lane: its kind (lanes connect only to lanes of their kind) and SUMO's attribute for it."""

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
"""Speed limits (m/s) of SUMO's drivers on roads whose file gives none, by road type."""
USUAL_SPEED_LIMIT = 50 / 3.6
"""The same for all other roads: netconvert's own default."""


def use_of(lane_type: str) -> Use:
    """Return the permitted use of a lane type; lanes of unknown types are closed, as type none."""
    return _USES.get(lane_type, CLOSED)


DOCK = "dock"
"""Edge far from all roads that every kind of participant may use: where they are inserted before they are moved."""


class Track(NamedTuple):
    """A SUMO lane in the road network: s at the SUMO lane's beginning and at its end, in the direction of travel."""

    road_id: str
    lane_id: int
    start: float
    end: float


class SignalLink(NamedTuple):
    """A signal in SUMO: traffic light and number of the link in its state string."""

    traffic_light: str
    link: int


class SumoNet:
    """A SUMO network in the coordinates of its OpenDRIVE file.

    Attributes:
        path: the network file; it also has the edge `DOCK`.
        left_hand: whether it is a network of left-hand traffic.
        signals: by OpenDRIVE signal id, what the signal holds in SUMO.
        fallback: None; or why netconvert refused the roads, and then the network has nothing but the dock.
    """

    def __init__(
        self,
        path: Path,
        left_hand: bool,
        tracks: Iterable[tuple[str, Track]],
        signals: Mapping[str, tuple[SignalLink, ...]],
        fallback: str | None = None,
    ) -> None:
        self.path = path
        self.left_hand = left_hand
        self.signals = dict(signals)
        self.fallback = fallback
        self._tracks: dict[str, Track] = {}
        self._lanes: dict[tuple[str, int], list[tuple[float, str]]] = defaultdict(list)
        for sumo_lane, track in tracks:
            self._tracks.setdefault(sumo_lane, track)
            self._lanes[track.road_id, track.lane_id].append((min(track.start, track.end), sumo_lane))
        for places in self._lanes.values():
            places.sort()

    @property
    def sumo_lanes(self) -> Mapping[str, Track]:
        """Every SUMO lane that stands for a lane of the road network. In junctions it may pass several: the longest is named."""
        return self._tracks

    def sumo_lane(self, road_id: str, lane_id: int, s: float) -> str | None:
        """The SUMO lane of a lane at s; None where SUMO has none: closed roads, lanes without width."""
        places = self._lanes.get((road_id, lane_id))
        if not places:
            return None
        return places[max(bisect_right(places, s, key=lambda place: place[0]) - 1, 0)][1]

    def track(self, sumo_lane: str) -> Track | None:
        """Return the road and lane of a SUMO lane; None for SUMO's own, such as the dock."""
        return self._tracks.get(sumo_lane)
