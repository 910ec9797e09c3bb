"""A road network in SUMO's plain XML, from which netconvert builds the network that SUMO runs on.

netconvert also reads OpenDRIVE itself, but it gives every lane one width and a displaced centre
line where widths change, ignores the traffic rule, shortens roads at every lane section and refuses
files for small faults. Here it gets the exact lane centre lines instead:

- A road becomes a chain of edges, cut at lane sections and at traffic lights; for each direction of
  travel one edge.
- A connecting road becomes the shape of SUMO's own lanes inside a junction.
- Lanes are numbered from the kerb inwards: from the right in right-hand traffic, from the left in
  left-hand traffic.
- Traffic lights are the OpenDRIVE signals that hold traffic, at the place where they hold it.
- Elevation is left out: SUMO moves in the plane, heights come from the road itself.

Source: SUMO documentation, "PlainXML" (nodes, edges, connections, custom lane shapes)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple
from urllib.parse import quote

from lxml import etree

from xodr.formats.sumo_net.net import (
    CLOSED,
    DOCK,
    SPEED_LIMITS,
    USUAL_SPEED_LIMIT,
    LaneConnection,
    LaneTrack,
    Nodes,
    Point,
    Use,
    centre_line,
    lane_connections,
    middle,
    mouth,
    outline,
    restricted,
    stretches,
    text,
    use_of,
)
from xodr.graph.links import next_lane
from xodr.graph.network import RoadNetwork
from xodr.model import Lane, LaneLink, LaneSection, Signal, SignalReference
from xodr.model.road import Road

APPROACH = 30.0
"""A light at most this far before a junction holds traffic at the junction, otherwise where it
stands, in m."""

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
        valid = not self.validity or any(
            min(pair) <= lane_id <= max(pair) for pair in self.validity
        )
        return valid and direction == self.direction


def lights(network: RoadNetwork) -> dict[str, list[Light]]:
    """Traffic lights by road, those that signal references add included."""
    # Files in the wild give lights own types; a controller tells that they are lights.
    controlled = frozenset(
        signal for controller in network.controllers.values() for signal in controller.signals
    )
    signals = {signal.id: signal for road in network.roads.values() for signal in road.signals}
    ids = {signal.id for signal in signals.values() if _is_light(signal, controlled)}
    by_road: dict[str, list[Light]] = {}
    for road in network.roads.values():
        own = [
            light
            for signal in road.signals
            if signal.id in ids
            for light in _directions(road, signal.id, signal)
        ]
        others = [
            light
            for other in road.signal_references
            if other.signal_id in ids
            for light in _directions(road, other.signal_id, other)
        ]
        by_road[road.id] = own + others
    return by_road


def _is_light(signal: Signal, controlled: frozenset[str]) -> bool:
    known = signal.type.startswith("10000") or signal.id in controlled
    return signal.dynamic and known and signal.type not in _FOR_OTHERS


def _directions(road: Road, signal_id: str, signal: Signal | SignalReference) -> list[Light]:
    directions = {"+": (1,), "-": (-1,)}.get(signal.orientation, (1, -1))
    return [
        Light(signal_id, direction, _stop(road, signal.s, direction), signal.validity)
        for direction in directions
    ]


def _stop(road: Road, s: float, direction: int) -> float | None:
    """Return the stop position for a traffic light at s; None for a near junction ahead or a light
    past the road."""
    # A light shortly before a junction holds the ways through it; any other needs a place to stop
    # of its own.
    link, left = (road.successor, road.length - s) if direction > 0 else (road.predecessor, s)
    at_junction = link is not None and link.element_type == "junction" and left <= APPROACH
    return None if at_junction or not 0.5 < s < road.length - 0.5 else s


LONGEST_BEND = 200.0
"""Longest edge of a road that is not straight, in m."""
_MOST_BENDS = 1000
NARROW = 0.1
"""A lane that nowhere in its section is wider than this is left out, in m."""
_DOCK_DISTANCE, _DOCK_LENGTH = 2000.0, 1000.0


class SumoLane(NamedTuple):
    """A lane of an edge, counted from 0."""

    edge: str
    lane: int


@dataclass(slots=True)
class PlainNetwork:
    """Input of netconvert, and the meanings of its names.

    lanes: by SUMO lane id. inside: the connecting lanes of each way from place to place. signals:
    ids that hold each way. outlines: of the junctions, by node.
    """

    left_hand: bool
    nodes: etree._Element = field(default_factory=lambda: etree.Element("nodes"))
    edges: etree._Element = field(default_factory=lambda: etree.Element("edges"))
    connections: etree._Element = field(default_factory=lambda: etree.Element("connections"))
    lanes: dict[str, LaneTrack] = field(default_factory=dict)
    inside: dict[tuple[SumoLane, SumoLane], tuple[LaneTrack, ...]] = field(default_factory=dict)
    signals: dict[tuple[SumoLane, SumoLane], tuple[str, ...]] = field(default_factory=dict)
    outlines: dict[str, list[Point]] = field(default_factory=dict)


def plain_network(network: RoadNetwork | None, whole: bool = False) -> PlainNetwork:
    """All roads, and the dock; the dock alone where there is no network.

    Args:
        whole: also directions of roads without a lane for traffic, which are of no use in a run.
    """
    roads = network.roads.values() if network else ()
    poses = [road.pose(s) for road in roads for s in (0.0, road.length)]
    # Ends of roads suffice for all of them, at such a distance.
    x = min((pose.x for pose in poses), default=0.0) - _DOCK_DISTANCE
    y = min((pose.y for pose in poses), default=0.0) - _DOCK_DISTANCE
    plain = (
        _PlainNetworkWriter(network, (x, y), whole).write()
        if network
        else PlainNetwork(left_hand=False)
    )
    for name, end in (("dock/start", x - _DOCK_LENGTH), ("dock/end", x)):
        _element(plain.nodes, "node", id=name, x=f"{end:.4f}", y=f"{y:.4f}")
    ends = {"from": "dock/start", "to": "dock/end"}
    _element(plain.edges, "edge", id=DOCK, **ends, numLanes="1", speed="100", width="4")
    return plain


class _EdgePiece(NamedTuple):
    """A stretch of a road between two nodes, within one lane section."""

    section: LaneSection
    start: float
    end: float

    @property
    def middle(self) -> float:
        """s halfway."""
        return (self.start + self.end) / 2


_Row = dict[int, SumoLane]
"""Positions of a piece's lanes in SUMO."""


class _PlainNetworkWriter:
    """Writes the roads.

    Attributes:
        mouths: the SUMO lanes at the ends of roads, by the lane that ends there.
        end_nodes: the node that each edge leads to.
        shapes: every connection, with its shape inside the junction.
        nowhere: outline of a place that no lane comes near.
    """

    def __init__(self, network: RoadNetwork, nowhere: Point, whole: bool) -> None:
        self.network = network
        self.whole = whole
        rules = [road.rule for road in network.roads.values()]
        # SUMO has one rule for a network: that of most roads.
        self.plain = PlainNetwork(rules.count("LHT") > len(rules) / 2)
        self.connections = lane_connections(network)
        # Roads passed inside junctions are shapes of connections, no edges.
        inner = {link.road_id for connection in self.connections for link in connection.via}
        self.roads = [road for road in network.roads.values() if road.id not in inner]
        self.nodes = Nodes(self.roads, self.connections)
        self.lights = lights(network)
        self.mouths: dict[LaneLink, SumoLane] = {}
        self.end_nodes: dict[str, str] = {}
        self.shapes: dict[tuple[SumoLane, SumoLane], list[Point]] = {}
        x, y = nowhere
        self.nowhere = text([(x, y), (x + 1.0, y), (x + 1.0, y + 1.0)])

    def write(self) -> PlainNetwork:
        """The network as nodes, edges and connections: all roads first, then the connections
        through junctions."""
        for road in self.roads:
            self._road(road)
        for connection in self.connections:
            self._connect(connection)
        self._connections()
        return self.plain

    # roads ----------------------------------------------------------------------------------

    def _road(self, road: Road) -> None:
        """Write the edges of one road and the ways between them; remember the lanes at its ends."""
        pieces = self._pieces(road)
        prefix = quote(road.id, safe="")
        inner = [self.nodes.inner_name(road, number) for number in range(1, len(pieces))]
        names = [self.nodes.name(road, True), *inner, self.nodes.name(road, False)]
        rows: list[_Row] = []
        for number, piece in enumerate(pieces):
            begin, end = names[number], names[number + 1]
            forward = self._edge(road, piece, f"{prefix}/{number}+", 1, (begin, end))
            rows.append(forward | self._edge(road, piece, f"{prefix}/{number}-", -1, (end, begin)))
        for number, (before, after) in enumerate(pairwise(pieces)):
            self._seam(road, (before, after), (rows[number], rows[number + 1]))
            self.nodes.corners[inner[number]] += mouth(road, after.start)
        for at_start, row in ((True, rows[0]), (False, rows[-1])):
            self.mouths |= {
                LaneLink(road.id, lane_id, at_start): place for lane_id, place in row.items()
            }

    def _pieces(self, road: Road) -> list[_EdgePiece]:
        """The road cut at lane sections, access restrictions and traffic lights, and where an edge
        would lead to its own node.

        Bends are cut into stretches as well: moveToXY looks through all points of the edges near a
        participant.
        """
        cuts = {light.s for light in self.lights[road.id] if light.s is not None}
        cuts |= {
            access.s
            for section in road.sections
            for lane in section.lanes.values()
            for access in lane.accesses
        }
        if not road.line.straight:
            count = min(math.ceil(road.length / LONGEST_BEND), _MOST_BENDS)
            cuts |= {road.length * number / count for number in range(1, count)}
        # A ring would be one edge from a node to itself.
        if len(road.sections) == 1 and self.nodes.name(road, True) == self.nodes.name(road, False):
            cuts.add(road.length / 2)
        pieces = []
        for section in road.sections:
            borders = [
                section.s,
                *sorted(s for s in cuts if section.s < s < section.end),
                section.end,
            ]
            pieces += [_EdgePiece(section, start, end) for start, end in pairwise(borders)]
        return pieces

    def _edge(
        self, road: Road, piece: _EdgePiece, edge: str, direction: int, nodes: tuple[str, str]
    ) -> _Row:
        """Return the edge with all lanes of one direction, none if all are closed, and the position
        of each lane in SUMO."""
        lanes = self._from_the_kerb(road, piece, direction)
        if not lanes or (not self.whole and all(_use(lane) is CLOSED for lane in lanes)):
            return {}
        start, end = (piece.start, piece.end) if direction > 0 else (piece.end, piece.start)
        attributes = {
            "id": edge,
            "from": nodes[0],
            "to": nodes[1],
            "numLanes": str(len(lanes)),
            "spreadType": "center",
        }
        shape = text(centre_line(road, piece.section.lanes[0], start, end))
        element = _element(self.plain.edges, "edge", **attributes, shape=shape)
        for index, lane in enumerate(lanes):
            _add_lane(element, index, road, lane, piece, text(centre_line(road, lane, start, end)))
            self.plain.lanes[f"{edge}_{index}"] = LaneTrack(road.id, lane.id, start, end)
        self.end_nodes[edge] = nodes[1]
        return {lane.id: SumoLane(edge, index) for index, lane in enumerate(lanes)}

    def _from_the_kerb(self, road: Road, piece: _EdgePiece, direction: int) -> list[Lane]:
        """The lanes of one direction, in SUMO's order."""
        # From right to left, as traffic along s sees them; SUMO counts from the kerb.
        ids = (*reversed(piece.section.right), *piece.section.left)
        lanes = [
            piece.section.lanes[lane_id]
            for lane_id in ids
            if road.direction(lane_id, piece.middle) == direction
        ]
        if (direction < 0) != self.plain.left_hand:
            lanes.reverse()
        return [lane for lane in lanes if _width(road, lane, piece) > 0.0]

    def _seam(
        self, road: Road, pieces: tuple[_EdgePiece, _EdgePiece], rows: tuple[_Row, _Row]
    ) -> None:
        """The ways between two pieces of a road that follow each other towards +s."""
        before, after = pieces
        for lane_id, place in rows[0].items():
            lane = before.section.lanes[lane_id]
            following = (
                lane_id if before.section is after.section else next_lane(lane, after.section, True)
            )
            if (
                following not in rows[1]
                or _use(lane).kind != _use(after.section.lanes[following]).kind
            ):
                continue
            direction = road.direction(lane_id, before.middle)
            if direction != road.direction(following, after.middle):
                continue
            if direction > 0:
                # Against s the way leads from the later piece to the earlier one.
                way, entered = (place, rows[1][following]), lane_id
            else:
                way, entered = (rows[1][following], place), following
            self.shapes[way] = []
            standing = [
                light
                for light in self.lights[road.id]
                if light.s == after.start and light.holds(entered, direction)
            ]
            self.plain.signals[way] = tuple(light.signal_id for light in standing)

    # junctions ------------------------------------------------------------------------------

    def _connect(self, connection: LaneConnection) -> None:
        """One connection from road to road. SUMO has only one from a lane to a lane: the first
        shapes it."""
        source, target = self.mouths.get(connection.source), self.mouths.get(connection.target)
        if source is None or target is None:
            return
        tracks: list[LaneTrack] = []
        shape: list[Point] = []
        for link in connection.via:
            road = self.network.roads[link.road_id]
            for section, lane_id in stretches(road, link):
                start, end = (section.s, section.end) if link.at_start else (section.end, section.s)
                tracks.append(LaneTrack(road.id, lane_id, start, end))
                shape += centre_line(road, section.lanes[lane_id], start, end)
        self.shapes.setdefault((source, target), shape)
        # Others add their tracks and signals: all these lanes are the one in SUMO.
        self.plain.inside[source, target] = (*self.plain.inside.get((source, target), ()), *tracks)
        self.plain.signals[source, target] = (
            *self.plain.signals.get((source, target), ()),
            *self._held(connection),
        )

    def _held(self, connection: LaneConnection) -> Iterator[str]:
        """The lights at the end of the road that the connection comes from, and those on the
        connecting roads."""
        direction = -1 if connection.source.at_start else 1
        for light in self.lights[connection.source.road_id]:
            # Lights with an s of their own hold at a seam, not at the junction.
            if light.s is None and light.holds(connection.source.lane_id, direction):
                yield light.signal_id
        for link in connection.via:
            direction = 1 if link.at_start else -1
            yield from (
                light.signal_id
                for light in self.lights[link.road_id]
                if light.holds(link.lane_id, direction)
            )

    # the rest -------------------------------------------------------------------------------

    def _connections(self) -> None:
        """Write connections and nodes; at nodes with a light, mark those without one as free."""
        # netconvert switches whole nodes.
        lit = {
            self.end_nodes[source.edge] for (source, _), held in self.plain.signals.items() if held
        }
        for name, corners in self.nodes.corners.items():
            self._node(name, corners, "traffic_light" if name in lit else "priority")
        for edge in sorted(self.end_nodes.keys() - {source.edge for source, _ in self.shapes}):
            # netconvert guesses connections for an edge that has none: this says that none leads on
            _element(self.plain.connections, "connection", **{"from": edge})
        for (source, target), shape in self.shapes.items():
            ends = {
                "from": source.edge,
                "to": target.edge,
                "fromLane": str(source.lane),
                "toLane": str(target.lane),
            }
            element = _element(self.plain.connections, "connection", **ends)
            if len(shape) > 1:
                element.set("shape", text(shape))
            # Else netconvert's own program for the node would stop them.
            if self.end_nodes[source.edge] in lit and not self.plain.signals[source, target]:
                element.set("uncontrolled", "true")

    def _node(self, name: str, corners: list[Point], kind: str) -> None:
        """Write a node whose outline lies nowhere.

        netconvert would cut lanes back, or draw them on, to meet an outline at its place.
        """
        x, y = middle(corners)
        _element(
            self.plain.nodes,
            "node",
            id=name,
            x=f"{x:.4f}",
            y=f"{y:.4f}",
            type=kind,
            shape=self.nowhere,
        )
        self.plain.outlines[name] = outline(corners)


def _element(parent: etree._Element, tag: str, **attributes: str) -> etree._Element:
    return etree.SubElement(parent, tag, attributes)


def _add_lane(
    edge: etree._Element, index: int, road: Road, lane: Lane, piece: _EdgePiece, shape: str
) -> None:
    usual = SPEED_LIMITS.get(road.road_type(piece.middle), USUAL_SPEED_LIMIT)
    speed = road.speed_limit(piece.middle, lane.id) or usual
    use = _use(lane)
    # The last record that has begun; pieces are cut at records, so it holds for all of the piece.
    access = next((access for access in reversed(lane.accesses) if access.s <= piece.middle), None)
    if access is not None:
        use = restricted(use, access.allowed, access.users)
    element = _element(
        edge,
        "lane",
        index=str(index),
        type=lane.type or "none",
        speed=f"{speed:.4f}",
        width=f"{_width(road, lane, piece):.4f}",
        shape=shape,
    )
    element.set(use.attribute, use.classes)
    _element(element, "param", key="origId", value=f"{road.id}_{lane.id}")


def _use(lane: Lane) -> Use:
    return CLOSED if lane.road_works else use_of(lane.type)


def _width(road: Road, lane: Lane, piece: _EdgePiece) -> float:
    """Mean width of a lane on a piece as seen from above, at least NARROW; 0 where it is nowhere
    wider."""
    places = [
        piece.start + (piece.end - piece.start) * share for share in (0.0, 0.25, 0.5, 0.75, 1.0)
    ]
    # A width may have its peak at a record between the even places.
    inside = [s for s in lane.width.starts if piece.start < s < piece.end]
    widths = [
        max(lane.width(s), 0.0) * math.cos(road.superelevation(s)) for s in (*places, *inside)
    ]
    mean = sum(widths[: len(places)]) / len(places)
    return max(mean, NARROW) if max(widths) > NARROW else 0.0
