"""Roles of lanes by their shapes: rings of roundabouts are short, round cycles of one-way lanes; at
crossings ways cross or turn."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from enum import StrEnum
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from recognition.scenes.lanes import LaneGraph
from schemas.common.array_types import BoolArray, FloatArray, IntArray
from schemas.common.errors import InvalidFile
from schemas.common.storage import digest, keep, read_object
from xodr.graph.network import RoadNetwork
from xodr.graph.ways import DRIVABLE

if TYPE_CHECKING:
    from shapely import Polygon

LONGEST = 400.0
"""Longest way round, m."""
ROUNDNESS = 0.8
"""Least 4π·area/perimeter² (1 for a circle): a square has 0.785, an ellipse of 2 : 1 0.84."""
_SIXTH = math.radians(10.0)
"""Least turn of each sixth of a ring, rad: a sixth of a circle turns by 60 degrees, the side of a
block, a quarter, by none."""
_LEAST_WAYS = 2
"""Least number of lanes that lead into a ring, and out of it."""
_ISLAND = 2.5
"""Lanes less than this inside a ring's innermost centre line belong to the ring or touch it, m."""
TURN = math.radians(45.0)
"""Least change of heading of a way that turns, rad."""
_SHORT = 0.05
"""Steps between points shorter than this have no heading, m."""


def ring_strips(graph: LaneGraph) -> set[int]:
    """Indices of the strips that lie on a ring.

    A ring is a short, round cycle of one-way lanes with curvature of one sign all along, at least
    two lanes that lead into it and two out of it, and an island without driving lanes.
    """
    cycles = _round_cycles(graph)
    rings: set[int] = set()
    for cycle in cycles:
        within = [other for other in cycles if cycle.outline.contains(other.outline.centroid)]
        concentric = {number for other in within for number in other.strips}
        innermost = min(
            (other.outline for other in within), key=lambda outline: float(outline.area)
        )
        if _has_ways(graph, concentric) and not _has_lanes_inside(graph, innermost, concentric):
            rings.update(cycle.strips)
    return rings


class _Cycle(NamedTuple):
    """Strips of a cycle, and the area within their centre lines."""

    strips: list[int]
    outline: Polygon


def _round_cycles(graph: LaneGraph) -> list[_Cycle]:
    """Round cycles of one-way lanes, no longer than `LONGEST`, which turn one way all along."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components, dijkstra
    from shapely import Polygon

    one_way = _one_way(graph)
    links = [
        (one, after)
        for one in sorted(one_way)
        for after in graph.following[one]
        if after in one_way
    ]
    if not links:
        return []
    rows, columns = np.array(links).T
    size = len(graph.strips)
    # Sparse graphs take a length of 0 for no link.
    ways = csr_array((np.maximum(graph.length[columns], 1e-3), (rows, columns)), shape=(size, size))
    # Cycles lie within strongly connected components: most links need no search.
    component = connected_components(ways, connection="strong")[1]
    seen: set[int] = set()
    round_cycles: list[_Cycle] = []
    for one, after in links:
        if component[one] != component[after] or {one, after} <= seen:
            continue
        distance, before = dijkstra(ways, indices=[after], return_predecessors=True, limit=LONGEST)
        if distance[0, one] + graph.length[after] <= LONGEST:
            cycle = _cycle(before[0], after, one)
            points = np.concatenate([graph.centre_line(number)[:-1] for number in cycle])
            if _roundness(points) >= ROUNDNESS and _turns_one_way(points):
                seen.update(cycle)
                # A buffer of 0 repairs outlines that touch themselves.
                round_cycles.append(_Cycle(cycle, Polygon(points).buffer(0.0)))
    return round_cycles


def _has_ways(graph: LaneGraph, ring: set[int]) -> bool:
    """Whether enough lanes lead into a ring, and out of it."""
    entries = {before for number in ring for before in graph.preceding[number]} - ring
    exits = {after for number in ring for after in graph.following[number]} - ring
    return min(len(entries), len(exits)) >= _LEAST_WAYS


def _has_lanes_inside(graph: LaneGraph, outline: Polygon, ring: set[int]) -> bool:
    """Whether a driving lane that is not of the ring reaches its island.

    A lane from or to the ring with its other end outside does not: what it has inside comes of a
    map that is wrong at the ring.
    """
    from shapely import LineString, Point

    island = outline.buffer(-_ISLAND)
    for number, strip in enumerate(graph.strips):
        if strip.kind not in DRIVABLE or number in ring:
            continue
        line = LineString(graph.centre_line(number))
        leaves, enters = (
            not ring.isdisjoint(links[number]) for links in (graph.preceding, graph.following)
        )
        away = Point(line.coords[-1 if leaves else 0])
        if line.intersects(island) and (leaves == enters or outline.contains(away)):
            return True
    return False


def _turns_one_way(points: FloatArray) -> bool:
    """Whether each sixth of a closed line of points (n, 2) turns to the side to which the whole
    turns, by `_SIXTH` or more."""
    steps = np.roll(points, -1, axis=0) - points
    length = np.hypot(*steps.T)
    steps, length = steps[length > _SHORT], length[length > _SHORT]
    heading = np.arctan2(steps[:, 1], steps[:, 0])
    turn = np.remainder(np.roll(heading, -1) - heading + np.pi, 2.0 * np.pi) - np.pi
    # Twice round, so that sixths may go over the first point.
    way, turned = (
        np.concatenate([[0.0], np.cumsum(np.concatenate([values, values]))])
        for values in (length, turn)
    )
    starts = np.arange(len(length))
    whole = turned[len(length)]
    ends = np.searchsorted(way, way[starts] + way[len(length)] / 6.0)
    # Once round in all: a figure of eight turns by 0.
    return abs(abs(whole) - math.tau) < _SIXTH and bool(
        (np.sign(whole) * (turned[ends] - turned[starts]) >= _SIXTH).all()
    )


def crosses_or_turns(network: RoadNetwork, graph: LaneGraph, ways: list[int]) -> bool:
    """Whether some of these strips cross, coming from different roads and leading to different
    ones, or turn by `TURN`."""
    from shapely import LineString

    def roads(links: list[list[int]], number: int) -> set[str]:
        return {graph.strips[other].road for other in links[number]}

    for number in ways:
        strip = graph.strips[number]
        line = network.roads[strip.road].line
        if abs(math.remainder(line.at(strip.end)[2] - line.at(strip.start)[2], math.tau)) >= TURN:
            return True
    lines = {number: LineString(graph.centre_line(number)) for number in ways}
    return any(
        roads(graph.preceding, one).isdisjoint(roads(graph.preceding, other))
        and roads(graph.following, one).isdisjoint(roads(graph.following, other))
        and lines[one].intersects(lines[other])
        for one, other in combinations(ways, 2)
    )


def _one_way(graph: LaneGraph) -> set[int]:
    """Driving lanes of roads that have them in one direction only."""
    ways: dict[str, set[bool]] = {}
    driving = [number for number, strip in enumerate(graph.strips) if strip.kind in DRIVABLE]
    for number in driving:
        strip = graph.strips[number]
        ways.setdefault(strip.road, set()).add(strip.forward)
    return {number for number in driving if len(ways[graph.strips[number].road]) == 1}


def _cycle(before: NDArray[np.int32], first: int, last: int) -> list[int]:
    cycle = [last]
    while cycle[-1] != first:
        cycle.append(int(before[cycle[-1]]))
    return cycle[::-1]


def _roundness(points: FloatArray) -> float:
    x, y = points.T
    dx, dy = np.roll(x, -1) - x, np.roll(y, -1) - y
    area = 0.5 * abs(float((x * dy - y * dx).sum()))
    return 4.0 * math.pi * area / max(float(np.hypot(dx, dy).sum()) ** 2, 1e-9)


ENDING = ".roles.json"
_HELP = "edit the file, or delete it to have roles proposed anew"
_TOLERANCE = 0.01
"""Stretches may miss the ends of a road by this, m: files round."""


class LaneRole(StrEnum):
    """Role of a lane."""

    MAIN = "main"
    """through lane of a motorway or another road faster than 70 km/h"""
    ON_RAMP = "on_ramp"
    """lane that leads onto main lanes, the acceleration lane included"""
    OFF_RAMP = "off_ramp"
    """lane that leads off main lanes, the deceleration lane included"""
    WEAVING = "weaving"
    """lane from an on-ramp to an off-ramp, which is part of both"""
    URBAN = "urban"
    """lane of a road with a limit of at most 70 km/h"""
    APPROACH = "approach"
    """urban lane that leads to a junction or roundabout"""
    INSIDE = "inside"
    """lane through a junction without traffic lights"""
    SIGNALISED = "signalised"
    """lane through a junction with traffic lights"""
    ENTRY = "entry"
    """lane from an approach into a roundabout's ring"""
    RING = "ring"
    """lane of a roundabout's ring"""
    EXIT = "exit"
    """lane out of a roundabout's ring"""
    OTHER = "other"
    """lane that no rule asks for"""


CERTAIN = 0.7
"""Least confidence of a role that classes may ask for"""
ROLES = tuple(LaneRole)
"""All roles; their indices are the codes of `Roles.codes`."""


class RoleRange(NamedTuple):
    """Role of a lane of a road, from one s to another (m), with its confidence from 0 to 1 and its
    doubts."""

    road: str
    lane: int
    start: float
    end: float
    role: LaneRole
    confidence: float = 1.0
    reason: str = ""

    @property
    def certain(self) -> bool:
        """Whether events on the lane can be of classes that ask for its role."""
        return self.confidence >= CERTAIN


@dataclass(frozen=True)
class Roles:
    """Roles of all driving lanes of one map. Lanes without an entry (shoulders, pavements) have the
    role `other`."""

    entries: tuple[RoleRange, ...]

    def codes(self, graph: LaneGraph, strip: IntArray, s: FloatArray) -> IntArray:
        """Index into `ROLES` of each row's role; rows on no strip have that of `other`."""
        other = ROLES.index(LaneRole.OTHER)
        codes = np.array([ROLES.index(entry.role) for entry in self.entries] + [other])
        return codes[self._entry_of(graph, strip, s)]

    def certain(self, graph: LaneGraph, strip: IntArray, s: FloatArray) -> BoolArray:
        """Whether the role of each row's lane is sure."""
        certain = np.array([entry.certain for entry in self.entries] + [True])
        return certain[self._entry_of(graph, strip, s)]

    @property
    def doubts(self) -> tuple[str, ...]:
        """Lanes with unsure roles, and the reasons."""
        where: dict[str, list[str]] = {}
        for entry in self.entries:
            if not entry.certain:
                lanes = where.setdefault(entry.reason or "of low confidence", [])
                lanes.append(f"road {entry.road} lane {entry.lane}")
        return tuple(
            f"{', '.join(dict.fromkeys(lanes))}: {reason}" for reason, lanes in where.items()
        )

    def _entry_of(self, graph: LaneGraph, strip: IntArray, s: FloatArray) -> IntArray:
        """Index of each row's entry; the number of entries for none."""
        none = len(self.entries)
        found = np.full(len(graph.strips) + 1, none, np.int64)
        parts: list[tuple[int, int]] = []
        for index, entry in enumerate(self.entries):
            for number in graph.numbers(entry.road, entry.lane, entry.start, entry.end):
                piece = graph.strips[number]
                if entry.start <= piece.start + _TOLERANCE and entry.end >= piece.end - _TOLERANCE:
                    found[number] = index
                else:
                    parts.append((number, index))
        rows = found[strip]
        for number, index in parts:
            entry = self.entries[index]
            rows[(strip == number) & (s >= entry.start) & (s <= entry.end)] = index
        return rows


def roles_of(network: RoadNetwork, proposed: Sequence[RoleRange], folder: Path) -> Roles:
    """The roles in an edited file, beside the map or in a folder for proposals; without one those
    proposed, which are written into that folder if it allows.

    Raises:
        InvalidFile: an edited file is malformed, or does not fit the map; names the entry.
    """
    beside = Path(network.path).with_suffix(ENDING)
    own = folder / beside.name
    for path in dict.fromkeys((beside, own)):
        if path.is_file():
            document = _document(path)
            # A proposal that nobody has edited has its own digest, and is made anew.
            if document.get("proposal") != _digest(document.get("roles")):
                return Roles(tuple(_checked(document.get("roles"), network, path)))
    proposal = Roles(tuple(proposed))
    _keep(_text(proposal), own)
    return proposal


# writing ------------------------------------------------------------------------------------


def _text(roles: Roles) -> str:
    listed = [
        {
            "road": entry.road,
            "lane": entry.lane,
            "from": entry.start,
            "to": entry.end,
            "role": str(entry.role),
        }
        | ({} if entry.certain else {"confidence": entry.confidence, "reason": entry.reason})
        for entry in roles.entries
    ]
    lines = ",\n  ".join(json.dumps(one, ensure_ascii=False) for one in listed)
    return f'{{"proposal": "{_digest(listed)}",\n "roles": [\n  {lines}\n]}}\n'


def _digest(listed: object) -> str:
    return digest(json.dumps(listed, sort_keys=True).encode())


def _keep(text: str, path: Path) -> None:
    with suppress(
        OSError
    ):  # a folder for reading only keeps no file: the same roles are proposed next time
        keep(text.encode(), path)


# reading ------------------------------------------------------------------------------------


def _document(path: Path) -> dict[str, Any]:
    document = read_object(path, _HELP)
    if not isinstance(document.get("roles"), list):
        raise InvalidFile(f"lane roles are an object with a list `roles`; {_HELP}", path=path)
    return document


def _checked(listed: Any, network: RoadNetwork, path: Path) -> list[RoleRange]:
    entries = [_entry(one, number, network, path) for number, one in enumerate(listed, 1)]
    by_lane: dict[tuple[str, int], RoleRange] = {}
    for entry in sorted(entries):
        before = by_lane.get((entry.road, entry.lane))
        if before is not None and before.end > entry.start + _TOLERANCE:
            where = f"road {entry.road}, lane {entry.lane}"
            raise InvalidFile(
                f"{where}: s = {entry.start:g} to {before.end:g} m has two roles; {_HELP}",
                path=path,
            )
        by_lane[entry.road, entry.lane] = entry
    return entries


def _entry(one: Any, number: int, network: RoadNetwork, path: Path) -> RoleRange:
    def wrong(message: str) -> InvalidFile:
        return InvalidFile(f"{message}; {_HELP}", path=path, element=f"entry {number}")

    needed = {"road", "lane", "role"}
    optional = {"from", "to", "confidence", "reason"}
    if not isinstance(one, dict) or not needed <= one.keys() <= needed | optional:
        raise wrong(
            "an entry has road, lane and role, and perhaps from and to, confidence and reason"
        )
    road = network.roads.get(str(one["road"]))
    if road is None:
        raise wrong(f"the map has no road {one['road']!r}")
    if one["role"] not in ROLES:
        raise wrong(f"{one['role']!r} is none of the roles {', '.join(ROLES)}")
    start, end = one.get("from", 0.0), one.get("to", road.length)
    if not all(
        isinstance(value, int | float) and not isinstance(value, bool) for value in (start, end)
    ):
        raise wrong("from and to are numbers, m")
    if not -_TOLERANCE <= start < end <= road.length + _TOLERANCE:
        raise wrong(
            f"from {start:g} to {end:g} m is no stretch of road {road.id}, which is "
            f"{road.length:g} m long"
        )
    lanes = {
        lane
        for section in road.sections
        if section.end > start and section.s < end
        for lane in section.lanes
        if lane
    }
    # JSON may have a list here, which no set can be asked for.
    if type(one["lane"]) is not int or one["lane"] not in lanes:
        raise wrong(f"road {road.id} has no lane {one['lane']!r} from {start:g} to {end:g} m")
    confidence = one.get("confidence", 1.0)
    if isinstance(confidence, bool) or not isinstance(confidence, int | float):
        raise wrong("confidence is a number from 0 to 1")
    if not 0.0 <= confidence <= 1.0:
        raise wrong("confidence is a number from 0 to 1")
    role, reason = LaneRole(one["role"]), str(one.get("reason", ""))
    where = (road.id, one["lane"], float(start), float(end))
    return RoleRange(*where, role, float(confidence), reason)
