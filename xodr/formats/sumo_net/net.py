"""SUMO networks of OpenDRIVE files: lanes, signals, nodes, lane types with their SUMO vehicle
classes, speed limits."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple
from urllib.parse import quote

from xodr.graph.links import next_lane
from xodr.graph.network import RoadNetwork
from xodr.model import Lane, LaneLink, LaneSection
from xodr.model.road import Road

_NOT_ON_ROADS = (
    "pedestrian tram rail_urban rail rail_electric rail_fast ship container cable_car subway "
    "aircraft wheelchair scooter drone"
)


class Use(NamedTuple):
    """Permitted use of a lane: its kind (lanes connect only to lanes of their kind) and SUMO's
    attribute for it."""

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
        (
            "driving",
            "entry",
            "exit",
            "onRamp",
            "offRamp",
            "connectingRamp",
            "slipLane",
            "bidirectional",
            "mwyEntry",
            "mwyExit",
        ),
        _TRAFFIC,
    ),
    **dict.fromkeys(("bus", "taxi", "HOV"), _TRAFFIC),
    **dict.fromkeys(("stop", "shoulder"), _EMERGENCY),
    **dict.fromkeys(("sidewalk", "walking"), _WALK),
    "biking": Use("bike", "allow", "bicycle"),
    **dict.fromkeys(("tram", "rail"), _RAIL),
}

_CLASSES = {
    "bicycle": "bicycle",
    "bus": "bus coach",
    "delivery": "delivery",
    "emergency": "emergency authority army",
    "motorcycle": "motorcycle moped",
    "passengerCar": "passenger private evehicle",
    "pedestrian": "pedestrian",
    "taxi": "taxi",
    "truck": "truck trailer",
    "trucks": "truck trailer",
    "HOV": "hov",
}
"""SUMO's vehicle classes of the road users that OpenDRIVE's access restrictions name; it has none
for the others."""

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


def restricted(use: Use, allowed: bool, users: Iterable[str]) -> Use:
    """Return the use of a lane that some road users alone may take (`allowed`), or all others;
    emergency vehicles always may."""
    named = {kind for user in users for kind in _CLASSES.get(user, "").split()}
    # Users that SUMO has no class for restrict nothing, rather than all.
    if not named or use is CLOSED:
        return use
    listed = use.classes.split()
    if allowed:
        # Emergency vehicles take any lane that is open to somebody.
        open_to = named | {"emergency", "authority", "army"}
        kept = (
            [user for user in listed if user in open_to]
            if use.attribute == "allow"
            else sorted(open_to - set(listed))
        )
        return use._replace(attribute="allow", classes=" ".join(kept)) if kept else use
    if use.attribute == "allow":
        kept = [user for user in listed if user not in named]
        return use._replace(classes=" ".join(kept)) if kept else CLOSED._replace(kind=use.kind)
    return use._replace(classes=" ".join([*listed, *sorted(named - set(listed))]))


DOCK = "dock"
"""Edge far from all roads that every kind of participant may use: where they are inserted before
they are moved."""


class LaneTrack(NamedTuple):
    """A SUMO lane in the road network: s at the SUMO lane's beginning and at its end, in the
    direction of travel."""

    road_id: str
    lane_id: int
    start: float
    end: float

    @property
    def length(self) -> float:
        """Length along the road, m."""
        return abs(self.end - self.start)


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
        fallback: None; or why netconvert refused the roads, and then the network has nothing but
            the dock.
    """

    def __init__(
        self,
        path: Path,
        left_hand: bool,
        tracks: Iterable[tuple[str, LaneTrack]],
        signals: Mapping[str, tuple[SignalLink, ...]],
        fallback: str | None = None,
    ) -> None:
        self.path = path
        self.left_hand = left_hand
        self.signals = dict(signals)
        self.fallback = fallback
        self._tracks: dict[str, LaneTrack] = {}
        self._lanes: dict[tuple[str, int], list[tuple[float, str]]] = defaultdict(list)
        for sumo_lane, track in tracks:
            known = self._tracks.get(sumo_lane)
            # Inside junctions a SUMO lane may pass several roads: the longest names it.
            if known is None or track.length > known.length:
                self._tracks[sumo_lane] = track
            self._lanes[track.road_id, track.lane_id].append(
                (min(track.start, track.end), sumo_lane)
            )
        for places in self._lanes.values():
            # By s, to be bisected.
            places.sort()

    @property
    def sumo_lanes(self) -> Mapping[str, LaneTrack]:
        """Every SUMO lane that stands for a lane of the road network. In junctions it may pass
        several: the longest is named."""
        return self._tracks

    def sumo_lane(self, road_id: str, lane_id: int, s: float) -> str | None:
        """The SUMO lane of a lane at s; None where SUMO has none: closed roads, lanes without
        width."""
        places = self._lanes.get((road_id, lane_id))
        if not places:
            return None
        return places[max(bisect_right(places, s, key=lambda place: place[0]) - 1, 0)][1]

    def track(self, sumo_lane: str) -> LaneTrack | None:
        """Return the road and lane of a SUMO lane; None for SUMO's own, such as the dock."""
        return self._tracks.get(sumo_lane)


# nodes ------------------------------------------------------------------------------------------


Point = tuple[float, float]

CHORD_ERROR = 0.005
"""Largest distance between a lane's centre line and its polyline, in m."""
_LONGEST = 100.0
"""Longest stretch that is judged by five of its points, in m."""
_DEEPEST, _MOST_STRETCHES, _MOST_POINTS = 14, 1_000, 20_000
"""Limits that keep absurd roads from filling the memory; beyond them the polyline is coarser."""


def centre_line(road: Road, lane: Lane, start: float, end: float) -> list[Point]:
    """The lane's centre line from s = start to s = end (either way round) as a polyline."""

    def at(s: float) -> Point:
        pose = road.pose(s, lane.center(s))
        return pose.x, pose.y

    low, high = min(start, end), max(start, end)
    # Curves are smooth only between starts of geometries and widths, and so are halved there.
    breaks = sorted(
        {low, high, *(s for s in (*road.line.starts, *lane.center.starts) if low < s < high)},
        reverse=start > end,
    )
    points = [at(start)]
    for here, there in pairwise(breaks):
        pieces = min(max(1, math.ceil(abs(there - here) / _LONGEST)), _MOST_STRETCHES)
        for number in range(pieces):
            first, last = (here + (there - here) * share / pieces for share in (number, number + 1))
            _refine(at, first, points[-1], last, at(last), points)
    return _without_straight(points)


def _refine(
    at: Callable[[float], Point],
    start: float,
    first: Point,
    end: float,
    last: Point,
    points: list[Point],
    depth: int = 0,
) -> None:
    """Append the points after `start` up to `end`, close enough together."""
    # Three points, since an S-shaped curve crosses its chord in the middle.
    quarters = [start + (end - start) * share for share in (0.25, 0.5, 0.75)]
    inner = [at(s) for s in quarters]
    enough = depth >= _DEEPEST or len(points) >= _MOST_POINTS
    if enough or all(_aside(point, first, last) <= CHORD_ERROR for point in inner):
        points.append(last)
        return
    _refine(at, start, first, quarters[1], inner[1], points, depth + 1)
    _refine(at, quarters[1], inner[1], end, last, points, depth + 1)


def _without_straight(points: list[Point]) -> list[Point]:
    """Leave out points between two others on one straight line."""
    kept = points[:1]
    for index in range(1, len(points) - 1):
        if _aside(points[index], kept[-1], points[index + 1]) > 1e-6:
            kept.append(points[index])
    kept.append(points[-1])
    return kept


def _aside(point: Point, first: Point, last: Point) -> float:
    """Distance of a point from the segment between two others."""
    dx, dy = last[0] - first[0], last[1] - first[1]
    length = math.hypot(dx, dy)
    # A closed curve has no chord: its distance counts from the point.
    if length < 1e-9:
        return math.dist(point, first)
    return abs((point[0] - first[0]) * dy - (point[1] - first[1]) * dx) / length


def mouth(road: Road, s: float) -> tuple[Point, Point]:
    """The road's right and left edge at s."""
    right, left = (road.pose(s, t) for t in road.edges(s))
    return (right.x, right.y), (left.x, left.y)


def middle(points: Sequence[Point]) -> Point:
    """The mean of some points."""
    return sum(point[0] for point in points) / len(points), sum(point[1] for point in points) / len(
        points
    )


def outline(corners: Sequence[Point]) -> list[Point]:
    """A polygon through the corners in counterclockwise order around their middle."""
    x, y = middle(corners)
    return sorted(corners, key=lambda point: math.atan2(point[1] - y, point[0] - x))


def text(points: Iterable[Point]) -> str:
    """A polyline as SUMO writes it, to the tenth of a millimetre."""
    return " ".join(f"{x:.4f},{y:.4f}" for x, y in points)


LONGEST_CHAIN = 8
"""Most connecting roads in a row that are followed through a junction."""


class LaneConnection(NamedTuple):
    """Connection from a lane that ends at a road's end, over connecting lanes, to a lane that
    begins at a road's end.

    All three name lanes by the end that the connection touches: source its end of departure, via
    and target their entries.
    """

    source: LaneLink
    via: tuple[LaneLink, ...]
    target: LaneLink


def lane_connections(network: RoadNetwork) -> list[LaneConnection]:
    """Every connection that some kind of traffic may take from one road that is not a connecting
    road to the next."""
    connections = []
    for road in network.roads.values():
        if _connects(network, road):
            continue
        for at_start, section, s in (
            (True, road.sections[0], 0.0),
            (False, road.sections[-1], road.length),
        ):
            for lane in section.lanes.values():
                # Only lanes with traffic that drives to this end.
                if lane.id and (road.direction(lane.id, s) < 0) == at_start:
                    source = LaneLink(road.id, lane.id, at_start)
                    onward = _onward(network, source, use_of(lane.type).kind, LONGEST_CHAIN)
                    connections += [LaneConnection(source, via, target) for via, target in onward]
    return connections


def stretches(road: Road, entry: LaneLink) -> list[tuple[LaneSection, int]]:
    """The lane's sections and ids from its entry to the other end of the road; cut short where the
    lane ends before."""
    sections = road.sections if entry.at_start else road.sections[::-1]
    lane_id: int | None = entry.lane_id
    found = []
    for number, section in enumerate(sections):
        if lane_id not in section.lanes:
            break
        found.append((section, lane_id))
        if number + 1 < len(sections):
            lane_id = next_lane(section.lanes[lane_id], sections[number + 1], entry.at_start)
    return found


def _connects(network: RoadNetwork, road: Road) -> bool:
    return road.junction_id in network.junctions


def _onward(
    network: RoadNetwork, leaving: LaneLink, kind: str, chain: int
) -> Iterator[tuple[tuple[LaneLink, ...], LaneLink]]:
    """The connecting lanes passed and the lane reached, on each way on from a lane's end."""
    for link in network.links(leaving.road_id, leaving.lane_id, not leaving.at_start):
        road = network.roads[link.road_id]
        s = 0.0 if link.at_start else road.length
        lane = road.lane(s, link.lane_id)
        if use_of(lane.type).kind != kind or (road.direction(lane.id, s) > 0) != link.at_start:
            continue
        if not _connects(network, road):
            yield (), link
            continue
        passed = stretches(road, link)
        # A ring of connecting roads would go on forever.
        if chain and len(passed) == len(road.sections):
            far_end = LaneLink(road.id, passed[-1][1], not link.at_start)
            for via, target in _onward(network, far_end, kind, chain - 1):
                yield (link, *via), target
            if not network.links(road.id, passed[-1][1], link.at_start):
                yield (), link  # it leads nowhere: traffic ends on it, as on a road


_End = tuple[str, ...]
"""("road", its id, "start" or "end"), or ("junction", its id)."""


class Nodes:
    """Names of the nodes at the ends of roads: those at one junction are one, and so are two that a
    connection joins.

    Attributes:
        corners: by node, the right and left edges of the roads that end there.
    """

    def __init__(self, roads: Iterable[Road], connections: Iterable[LaneConnection]) -> None:
        self._parents: dict[_End, _End] = {}
        roads = list(roads)
        for road in roads:
            for end, link in (("start", road.predecessor), ("end", road.successor)):
                if link and link.element_type == "junction":
                    self._join(("junction", link.element_id), ("road", road.id, end))
        for connection in connections:
            source, target = connection.source, connection.target
            self._join(_end(source.road_id, source.at_start), _end(target.road_id, target.at_start))
        self.corners: dict[str, list[Point]] = defaultdict(list)
        for road in roads:
            self.corners[self.name(road, True)] += mouth(road, 0.0)
            self.corners[self.name(road, False)] += mouth(road, road.length)

    def name(self, road: Road, at_start: bool) -> str:
        """Id of the node at one end of a road."""
        return _name(self._root(_end(road.id, at_start)))

    @staticmethod
    def inner_name(road: Road, number: int) -> str:
        """Id of a node inside a road, where its piece of that number begins."""
        return _name(("road", road.id, str(number)))

    def _join(self, one: _End, other: _End) -> None:
        # Sorted: a junction before a road, and names that do not depend on the order of the links.
        first, second = sorted((self._root(one), self._root(other)))
        if first != second:
            self._parents[second] = first

    def _root(self, end: _End) -> _End:
        while end in self._parents:
            end = self._parents[end]
        return end


def _end(road_id: str, at_start: bool) -> _End:
    return "road", road_id, "start" if at_start else "end"


def _name(end: _End) -> str:
    return "/".join(quote(part, safe="") for part in end)
