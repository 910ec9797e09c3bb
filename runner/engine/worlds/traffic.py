"""Unnamed traffic of a scenario: composition, places of appearance, and departures.

SUMO's drivers drive it. The controllers of a TrafficDefinition or template are programs that are
not at hand: they are written to the entity, as AssignControllerAction does, and SUMO's drivers take
their place.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import accumulate, pairwise, product
from random import Random
from typing import TYPE_CHECKING, NamedTuple, Protocol

from runner.engine.motion.placement import Placement
from runner.engine.participants.boxes import Spot, overlap
from runner.engine.participants.declaration import BoundingBox, Declaration
from runner.engine.participants.entity import Entity
from runner.engine.participants.scenario_objects import read_object
from xodr.formats.sumo_net.net import use_of
from xodr.graph.ways import DRIVABLE
from xosc.document.node import Node
from xosc.writing.versions import with_recent

if TYPE_CHECKING:
    from runner.engine.compile.protocols import Run
    from xodr.graph.network import RoadNetwork
    from xodr.graph.routes import RoadPath
    from xodr.model import RoadPoint


_SPACING = 5.0
"""Distance (m) of places on a lane where traffic can appear."""
_HEADWAY, _STANDING_GAP = 1.0, 2.0
"""Free way that a new participant needs before and behind it: seconds at its speed, and metres on
top."""
_ATTEMPTS = 20
"""Places that are tried for one new participant at a time."""
USUAL_SPEED = 50.0 / 3.6
"""Speed (m/s) at which traffic appears where the file gives none and the road has no limit."""

_BOXES = with_recent(
    {
        "bicycle": BoundingBox(0.6, 0.0, 0.9, 1.8, 0.6, 1.8),
        "bus": BoundingBox(3.0, 0.0, 1.5, 12.0, 2.5, 3.0),
        "car": BoundingBox(1.4, 0.0, 0.75, 4.5, 1.8, 1.5),
        "motorbike": BoundingBox(0.7, 0.0, 0.75, 2.2, 0.9, 1.5),
        "truck": BoundingBox(2.9, 0.0, 1.5, 8.0, 2.4, 3.0),
        "van": BoundingBox(1.9, 0.0, 1.3, 6.0, 2.1, 2.6),
    }
)
"""Usual boxes of the vehicle categories, about the middle of the rear axle."""


class Mix:
    """Composition of traffic: factories of entities, drawn by weight."""

    def __init__(self, makers: Sequence[tuple[float, Callable[[str, Random], Entity]]]) -> None:
        self.makers = [maker for _, maker in makers]
        self.weights = list(accumulate(weight for weight, _ in makers))

    @classmethod
    def from_xml(cls, node: Node) -> Mix:
        """Read the TrafficDistribution or TrafficDefinition inside an element; cars where there is
        neither."""
        distribution = node.find("TrafficDistribution")
        if distribution is not None:
            return cls(_templates(distribution))
        definition = node.find("TrafficDefinition")
        return cls(
            _categories(definition)
            if definition is not None
            else [(1.0, _Usual(node, "car", (), ()).make)]
        )

    def make(self, name: str, rng: Random) -> Entity:
        """A new entity of that name."""
        return rng.choices(self.makers, cum_weights=self.weights)[0](name, rng)


Weighted = tuple[tuple[float, Node], ...]


@dataclass(frozen=True)
class _Usual:
    """A usual vehicle of a category, with one of several roles and controllers, that an element
    asks for."""

    node: Node
    category: str
    roles: Weighted
    controllers: Weighted

    def make(self, name: str, rng: Random) -> Entity:
        """A new one."""
        role, controller = _draw(self.roles, rng), _draw(self.controllers, rng)
        declared = Declaration(
            name,
            "vehicle",
            self.category,
            _BOXES[self.category],
            model=self.category,
            role=role.get("role") if role is not None else "",
            properties={"role": role.get("role")} if role is not None else {},
            controllers={controller.get("name"): _properties(controller)}
            if controller is not None
            else {},
            node=self.node,
        )
        return Entity(declared, spawned=True)


def _properties(controller: Node) -> dict[str, str]:
    return {p.get("name"): p.get("value") for p in controller.iter("Property")}


def _draw(entries: Weighted, rng: Random) -> Node | None:
    return (
        rng.choices([node for _, node in entries], [weight for weight, _ in entries])[0]
        if entries
        else None
    )


def _weighted(holder: Node | None, tag: str) -> Weighted:
    """Entries of a distribution that have a weight, with it."""
    if holder is None:
        return ()
    entries = [(float(entry.finite("weight")), entry) for entry in holder.children(tag)]
    for weight, entry in entries:
        if weight < 0.0:
            raise entry.invalid(f"weight={weight:g} must not be negative")
    found = tuple((weight, entry) for weight, entry in entries if weight > 0.0)
    if not found:
        raise holder.invalid(f"no {tag} has a weight above 0")
    if not math.isfinite(sum(weight for weight, _ in found)):
        raise holder.invalid("the weights are too large")
    return found


def categories(definition: Node) -> dict[str, float]:
    """Vehicle categories of a TrafficDefinition with their weights."""
    entries = _weighted(
        definition.need("VehicleCategoryDistribution"), "VehicleCategoryDistributionEntry"
    )
    for _, entry in entries:
        if entry.get("category") not in _BOXES:
            raise entry.unsupported(
                f"SUMO's drivers drive {', '.join(_BOXES)} on their own, but no "
                f"{entry.get('category')}"
            )
    return {entry.get("category"): weight for weight, entry in entries}


def _categories(definition: Node) -> list[tuple[float, Callable[[str, Random], Entity]]]:
    roles = _weighted(definition.find("VehicleRoleDistribution"), "VehicleRoleDistributionEntry")
    entries = _weighted(definition.find("ControllerDistribution"), "ControllerDistributionEntry")
    controllers = tuple((weight, entry.only()) for weight, entry in entries)
    return [
        (weight, _Usual(definition, name, roles, controllers).make)
        for name, weight in categories(definition).items()
    ]


def _templates(distribution: Node) -> list[tuple[float, Callable[[str, Random], Entity]]]:
    makers: list[tuple[float, Callable[[str, Random], Entity]]] = []
    for share, entry in _weighted(distribution, "TrafficDistributionEntry"):
        kinds = _weighted(entry.need("EntityDistribution"), "EntityDistributionEntry")
        total = sum(weight for weight, _ in kinds)
        makers += [
            (share * (weight / total), _template(kind.need("ScenarioObjectTemplate")))
            for weight, kind in kinds
        ]
    return makers


def _template(node: Node) -> Callable[[str, Random], Entity]:
    """A maker of entities like the one described; what SUMO's drivers can't drive is refused."""
    described = read_object(node, "")
    if described.kind != "vehicle":
        raise node.unsupported(f"SUMO's drivers drive vehicles, not a {described.kind} object")
    if described.category not in _BOXES:
        raise node.unsupported(
            f"SUMO's drivers drive {', '.join(_BOXES)} on their own, but no {described.category}"
        )
    trailer = node.find("Vehicle", "Trailer")
    if trailer is not None:
        raise trailer.unsupported("SUMO's drivers drive vehicles without trailers")
    return lambda name, _: Entity(read_object(node, name), spawned=True)


# places -------------------------------------------------------------------------------------


class Place(NamedTuple):
    """A place on a lane, facing with the traffic there: world pose, road coordinates, usual speed
    (m/s)."""

    x: float
    y: float
    h: float
    road_id: str
    lane_id: int
    s: float
    speed: float


@lru_cache(maxsize=8)
def places_of(network: RoadNetwork) -> tuple[Place, ...]:
    """All places of a road network where traffic can appear, found once."""
    return tuple(place for road_id in network.roads for place in _along(network, road_id))


def _along(network: RoadNetwork, road_id: str) -> list[Place]:
    """Places along one road; none inside junctions, where others cross."""
    road = network.roads[road_id]
    if road.junction_id is not None:
        return []
    count = max(int(road.length / _SPACING), 1)
    stations = [(index + 0.5) * road.length / count for index in range(count)]
    return [
        place_on(network, road_id, lane_id, s)
        for s in stations
        for lane_id in road.lane_ids(s)
        if use_of(road.lane_type(s, lane_id)).kind == "traffic"
        and road.lane_width(s, lane_id) > 2.0
    ]


def place_on(network: RoadNetwork, road_id: str, lane_id: int, s: float) -> Place:
    """The place in the middle of a lane."""
    road = network.road(road_id)
    pose = road.pose(s, road.lane_t(s, lane_id))
    h = pose.h if road.direction(lane_id, s) > 0 else pose.h + math.pi
    return Place(
        pose.x, pose.y, h, road_id, lane_id, s, road.speed_limit(s, lane_id) or USUAL_SPEED
    )


# bringing it in -----------------------------------------------------------------------------


@dataclass
class Spawner:
    """Brings traffic of one action into a run, and knows which of it is still there.

    Args:
        name: of the traffic; its members are called `<name>_1` and so on.
        mix: what it consists of.
    """

    name: str
    mix: Mix
    members: list[Entity] = field(default_factory=list)
    _count: int = 0

    def present(self) -> list[Entity]:
        """Return the entities that have not left."""
        self.members = [entity for entity in self.members if entity.active]
        return self.members

    def spawn(self, run: Run, places: Sequence[Place], speed: Callable[[Place], float]) -> bool:
        """Bring in one more at one of some places, drawn at random; false where none that was tried
        is free."""
        if not places:
            return False
        entity = self.mix.make(self._next_name(run), run.random)
        for place in run.random.sample(places, min(_ATTEMPTS, len(places))):
            fast = min(speed(place), entity.declared.performance.max_speed)
            if _free(run, entity, place, fast) and run.spawn(entity, _placement(run, place), fast):
                self.members.append(entity)
                self._count += 1
                return True
        return False

    def _next_name(self, run: Run) -> str:
        while f"{self.name}_{self._count + 1}" in run.entities:
            self._count += 1
        return f"{self.name}_{self._count + 1}"


def _placement(run: Run, place: Place) -> Placement:
    assert run.roads.network is not None
    point = run.roads.network.lane_point(place.road_id, place.lane_id, place.s)
    pose = run.roads.network.pose(point)
    direction = 1 if math.cos(place.h - pose.h) >= 0.0 else -1
    return Placement(
        pose.x,
        pose.y,
        pose.z,
        place.h,
        direction * pose.pitch,
        direction * pose.roll,
        point,
        direction,
    )


def _free(run: Run, entity: Entity, place: Place, speed: float) -> bool:
    """Whether the way that a new participant needs is free."""
    box, gap = entity.box, _STANDING_GAP + _HEADWAY * speed
    needed = Spot(
        place.x, place.y, 0.0, place.h, box._replace(length=box.length + 2.0 * gap, height=math.inf)
    )
    return not any(
        other.active and other.placed and overlap(needed, other) for other in run.entities.values()
    )


class PlaneRegion(Protocol):
    """A part of the plane."""

    def contains(self, x: float, y: float) -> bool:
        """Whether a point (m) lies in it."""
        ...


@dataclass(frozen=True, slots=True)
class Ellipse:
    """An ellipse about a point (m); `major` is its half axis along the heading h (rad), `minor` the
    other (m)."""

    x: float
    y: float
    h: float
    major: float
    minor: float

    def contains(self, x: float, y: float) -> bool:
        """Whether a point lies in it."""
        dx, dy = x - self.x, y - self.y
        cos, sin = math.cos(self.h), math.sin(self.h)
        ahead, aside = dx * cos + dy * sin, dy * cos - dx * sin
        if not (self.major and self.minor):
            return ahead == aside == 0.0
        return math.hypot(ahead / self.major, aside / self.minor) <= 1.0


@dataclass(frozen=True, slots=True)
class Polygon:
    """A polygon by its corners (m), in either order."""

    corners: Sequence[tuple[float, float]]

    def contains(self, x: float, y: float) -> bool:
        """Whether a ray from the point crosses its outline an odd number of times."""
        inside = False
        for (ax, ay), (bx, by) in pairwise([*self.corners, self.corners[0]]):
            if (ay > y) != (by > y) and x < ax + (y - ay) * (bx - ax) / (by - ay):
                inside = not inside
        return inside


class Stretch(NamedTuple):
    """A road between two s (m), and the lanes meant; None for all."""

    road_id: str
    low: float
    high: float
    lanes: frozenset[int] | None


@dataclass(frozen=True, slots=True)
class RoadRanges:
    """Stretches of roads."""

    network: RoadNetwork
    stretches: Sequence[Stretch]

    @classmethod
    def from_xml(cls, nodes: Sequence[Node], network: RoadNetwork) -> RoadRanges:
        """Read RoadRange elements."""
        return cls(network, [stretch for node in nodes for stretch in _limited(node, network)])

    def contains(self, x: float, y: float) -> bool:
        """Whether a point lies on one of them."""
        point = self.network.locate(x, y)
        return self.network.on_road(point) and any(
            _holds(stretch, point) for stretch in self.stretches
        )


def _holds(stretch: Stretch, point: RoadPoint) -> bool:
    there = stretch.road_id == point.road_id and stretch.low <= point.s <= stretch.high
    return there and (stretch.lanes is None or point.lane_id in stretch.lanes)


class _Cursor:
    """A RoadCursor: a road, a place on it where one is given, and the lanes meant from there on."""

    def __init__(self, node: Node, network: RoadNetwork) -> None:
        self.node, self.network = node, network
        self.road = network.roads.get(node.get("roadId"))
        if self.road is None:
            raise node.invalid(f"there is no road {node.get('roadId')!r}")
        self.s: float | None = node.finite("s", None)
        if self.s is not None and not 0.0 <= self.s <= self.road.length:
            raise node.invalid(
                f"s={self.s:g} lies outside the road, which is {self.road.length:g} m long"
            )
        ids = frozenset(lane.int("id") for lane in node.children("Lane"))
        known = {lane_id for section in self.road.sections for lane_id in section.lanes}
        if not ids <= known:
            raise node.invalid(f"road {self.road.id} has no lane {min(ids - known)}")
        self.lanes = ids or None

    def points(self) -> list[RoadPoint]:
        """Points on lanes of traffic there, from which and to which a way may lead."""
        assert self.road is not None
        s = self.road.length / 2 if self.s is None else self.s
        return [
            self.road.lane_point(s, lane)
            for lane in self.road.lane_ids(s)
            if self.road.lane_type(s, lane) in DRIVABLE
        ]


def _limited(node: Node, network: RoadNetwork) -> Iterator[Stretch]:
    """The stretches of a RoadRange, cut off after its length."""
    cursors = [_Cursor(child, network) for child in node.children("RoadCursor")]
    if len(cursors) < 2:
        raise node.invalid("a RoadRange needs two RoadCursors or more")
    left = float(node.float("length", math.inf))
    if left < 0.0:
        raise node.invalid(f"length={left:g} must not be negative")
    for number, (one, other) in enumerate(pairwise(cursors)):
        for road_id, enter, leave in _between(one, other, number == 0, number == len(cursors) - 2):
            length = min(abs(leave - enter), left)
            end = enter + math.copysign(length, leave - enter)
            left -= length
            if length > 0.0:
                yield Stretch(road_id, min(enter, end), max(enter, end), one.lanes)


def _between(
    one: _Cursor, other: _Cursor, first: bool, last: bool
) -> list[tuple[str, float, float]]:
    """Roads with s from one cursor to the next; a road at either end of the range without s is
    meant as a whole."""
    assert one.road is not None and other.road is not None
    if one.road is other.road:
        start, end = (
            0.0 if one.s is None else one.s,
            one.road.length if other.s is None else other.s,
        )
        return [(one.road.id, start, end)]
    path = _shortest(one, other)
    found = [(leg.road_id, leg.enter, leg.leave) for leg in path.legs]
    if first and one.s is None:
        found[0] = (
            one.road.id,
            0.0 if path.legs[0].forward else one.road.length,
            path.legs[0].leave,
        )
    if last and other.s is None:
        found[-1] = (
            other.road.id,
            path.legs[-1].enter,
            other.road.length if path.legs[-1].forward else 0.0,
        )
    return found


def _shortest(one: _Cursor, other: _Cursor) -> RoadPath:
    paths = [one.network.route(pair) for pair in product(one.points(), other.points())]
    shortest = min(
        (path for path in paths if path is not None), key=lambda path: path.length, default=None
    )
    if shortest is None:
        raise other.node.invalid("no way leads here from the cursor before")
    return shortest
