"""Roles of lanes by their shapes: rings of roundabouts are short, round cycles of one-way lanes; at crossings ways cross or
turn."""

from __future__ import annotations

import json
import math
from collections import Counter
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
from schemas.common.array_types import FloatArray, IntArray
from schemas.common.errors import InvalidFile
from schemas.common.storage import digest, keep, read_object
from xodr.graph.network import RoadNetwork
from xodr.graph.ways import DRIVABLE
from xodr.lookup.arrays import sample

if TYPE_CHECKING:
    from shapely import Polygon

LONGEST = 400.0
"""Longest way round, m."""
ROUNDNESS = 0.8
"""Least 4π·area/perimeter² (1 for a circle): a square has 0.785, an ellipse of 2 : 1 0.84."""
_SIXTH = math.radians(10.0)
"""Least turn of each sixth of a ring, rad: a sixth of a circle turns by 60 degrees, the side of a block, a quarter, by none."""
_LEAST_WAYS = 2
"""Least number of lanes that lead into a ring, and out of it."""
_ISLAND = 2.5
"""Lanes less than this inside a ring's innermost centre line belong to the ring or touch it, m."""
TURN = math.radians(45.0)
"""Least change of heading of a way that turns, rad."""
_STEP = 2.0
_SHORT = 0.05
"""Steps between points shorter than this have no heading, m."""


def ring_strips(network: RoadNetwork, graph: LaneGraph) -> set[int]:
    """Indices of the strips that lie on a ring.

    A ring is a short, round cycle of one-way lanes with curvature of one sign all along, at least
    two lanes that lead into it and two out of it, and an island without driving lanes.
    """
    cycles = _round_cycles(network, graph)
    rings: set[int] = set()
    for cycle in cycles:
        within = [other for other in cycles if cycle.outline.contains(other.outline.centroid)]
        concentric = {number for other in within for number in other.strips}
        innermost = min(
            (other.outline for other in within), key=lambda outline: float(outline.area)
        )
        if _has_ways(graph, concentric) and not _has_lanes_inside(
            network, graph, innermost, concentric
        ):
            rings.update(cycle.strips)
    return rings


class _Cycle(NamedTuple):
    """Strips of a cycle, and the area within their centre lines."""

    strips: list[int]
    outline: Polygon


def _round_cycles(network: RoadNetwork, graph: LaneGraph) -> list[_Cycle]:
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
    ways = csr_array((np.maximum(graph.length[columns], 1e-3), (rows, columns)), shape=(size, size))
    component = connected_components(ways, connection="strong")[1]
    seen: set[int] = set()
    found: list[_Cycle] = []
    for one, after in links:
        if component[one] != component[after] or {one, after} <= seen:
            continue
        distance, before = dijkstra(ways, indices=[after], return_predecessors=True, limit=LONGEST)
        if distance[0, one] + graph.length[after] <= LONGEST:
            cycle = _cycle(before[0], after, one)
            points = np.concatenate([_centre_line(network, graph, number) for number in cycle])
            if _roundness(points) >= ROUNDNESS and _turns_one_way(points):
                seen.update(cycle)
                found.append(_Cycle(cycle, Polygon(points).buffer(0.0)))
    return found


def _has_ways(graph: LaneGraph, ring: set[int]) -> bool:
    """Whether enough lanes lead into a ring, and out of it."""
    entries = {before for number in ring for before in graph.preceding[number]} - ring
    exits = {after for number in ring for after in graph.following[number]} - ring
    return min(len(entries), len(exits)) >= _LEAST_WAYS


def _has_lanes_inside(
    network: RoadNetwork, graph: LaneGraph, outline: Polygon, ring: set[int]
) -> bool:
    """Whether a driving lane that is not of the ring reaches its island.

    A lane from or to the ring with its other end outside does not: what it has inside comes of a
    map that is wrong at the ring.
    """
    from shapely import LineString, Point

    island = outline.buffer(-_ISLAND)
    for number, strip in enumerate(graph.strips):
        if strip.kind not in DRIVABLE or number in ring:
            continue
        line = LineString(_centre_line(network, graph, number, end=True))
        leaves, enters = (
            not ring.isdisjoint(links[number]) for links in (graph.preceding, graph.following)
        )
        away = Point(line.coords[-1 if leaves else 0])
        if line.intersects(island) and (leaves == enters or outline.contains(away)):
            return True
    return False


def _turns_one_way(points: FloatArray) -> bool:
    """Whether each sixth of a closed line of points (n, 2) turns to the side to which the whole turns, by `_SIXTH` or more."""
    steps = np.roll(points, -1, axis=0) - points
    length = np.hypot(*steps.T)
    steps, length = steps[length > _SHORT], length[length > _SHORT]
    heading = np.arctan2(steps[:, 1], steps[:, 0])
    turn = np.remainder(np.roll(heading, -1) - heading + np.pi, 2.0 * np.pi) - np.pi
    way, turned = (
        np.concatenate([[0.0], np.cumsum(np.concatenate([each, each]))]) for each in (length, turn)
    )
    starts = np.arange(len(length))
    whole = turned[len(length)]
    ends = np.searchsorted(way, way[starts] + way[len(length)] / 6.0)
    return abs(abs(whole) - math.tau) < _SIXTH and bool(
        (np.sign(whole) * (turned[ends] - turned[starts]) >= _SIXTH).all()
    )


def crosses_or_turns(network: RoadNetwork, graph: LaneGraph, ways: list[int]) -> bool:
    """Whether some of these strips cross, coming from different roads and leading to different ones, or turn by `TURN`."""
    from shapely import LineString

    def roads(links: list[list[int]], number: int) -> set[str]:
        return {graph.strips[other].road for other in links[number]}

    for number in ways:
        strip = graph.strips[number]
        line = network.roads[strip.road].line
        if abs(math.remainder(line.at(strip.end)[2] - line.at(strip.start)[2], math.tau)) >= TURN:
            return True
    lines = {number: LineString(_centre_line(network, graph, number, end=True)) for number in ways}
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


def _centre_line(
    network: RoadNetwork, graph: LaneGraph, number: int, end: bool = False
) -> FloatArray:
    """Points (n, 2) on a strip's centre line, in the direction of its traffic, with its end or without."""
    strip = graph.strips[number]
    ends = (strip.start, strip.end) if strip.forward else (strip.end, strip.start)
    s = np.linspace(*ends, 1 + math.ceil((strip.end - strip.start) / _STEP))[: None if end else -1]
    road = network.roads[strip.road]
    centre = road.sections[strip.section].lanes[strip.lane].center
    return sample(road, s, [centre(one) for one in s.tolist()])[:, :2]


_Links = list[list[int]]


def ramp_roles(graph: LaneGraph, main: set[int]) -> dict[int, LaneRole]:
    """Roles of those among the main lanes that are ramps."""
    return _Ramps(graph, main).roles()


_STEPS = 4
"""Strips within which a lane that has a road of its own comes back to the lanes that were beside it"""


class _Ramps:
    def __init__(self, graph: LaneGraph, main: set[int]) -> None:
        self._graph, self._main = graph, main
        groups: dict[tuple[str, int, bool], list[int]] = {}
        for number in sorted(main):
            strip = graph.strips[number]
            groups.setdefault((strip.road, strip.section, strip.forward), []).append(number)
        self._beside = {
            number: [other for other in group if other != number]
            for group in groups.values()
            for number in group
        }

    def roles(self) -> dict[int, LaneRole]:
        following, preceding = self._graph.following, self._graph.preceding
        leaving, entering = self._ramp(following, preceding), self._ramp(preceding, following)
        roles = dict.fromkeys(leaving, LaneRole.OFF_RAMP) | dict.fromkeys(
            entering, LaneRole.ON_RAMP
        )
        return roles | dict.fromkeys(leaving & entering, LaneRole.WEAVING)

    def _ramp(self, onwards: _Links, back: _Links) -> set[int]:
        """Lanes that leave the others, or begin beside them and lead to such: off-ramps; with links reversed, on-ramps."""
        found: set[int] = set()
        for number in sorted(self._main):
            if self._parts(number, onwards):
                found.update(self._chain(onwards[number][0], onwards), self._extra(number, back))
            if self._ends(number, back):
                chain = self._chain(number, onwards)
                if any(not self._beside[one] for one in chain):
                    found.update(chain)
        return found

    def _parts(self, number: int, links: _Links) -> bool:
        """Whether a lane leads to another road than most of its group."""
        roads = [
            self._graph.strips[links[one][0]].road
            for one in (number, *self._beside[number])
            if links[one]
        ]
        if not links[number] or links[number][0] not in self._main:
            return False
        counts = Counter(roads).most_common(2)
        elsewhere = len(counts) > 1 and counts[0][1] > counts[1][1] and roads[0] != counts[0][0]
        return elsewhere and not self._rejoins(number, links)

    def _rejoins(self, number: int, links: _Links) -> bool:
        """Whether a lane with a road of its own comes back to the lanes beside it, as an acceleration lane does at its end."""
        beside, reached = self._beside[number], set(self._beside[number])
        own = number
        for _ in range(_STEPS):
            beside = [after for one in beside for after in links[one]]
            reached.update(beside)
            if len(links[own]) != 1:
                return False
            own = links[own][0]
            if own in reached:
                return True
        return False

    def _ends(self, number: int, links: _Links) -> bool:
        """Whether a lane ends beside lanes that go on."""
        return not links[number] and any(links[other] for other in self._beside[number])

    def _chain(self, number: int, links: _Links) -> list[int]:
        """A lane and those that follow it one by one."""
        chain: list[int] = []
        while number in self._main and number not in chain:
            chain.append(number)
            if len(links[number]) != 1:
                break
            number = links[number][0]
        return chain

    def _extra(self, number: int, links: _Links) -> list[int]:
        """A lane as far as it runs beside others, if it ends there or has a road of its own then; nothing of a through lane."""
        chain = [number]
        while True:
            ways = links[chain[-1]]
            if not ways:
                return chain if self._ends(chain[-1], links) else []
            if len(ways) > 1 or ways[0] not in self._main or ways[0] in chain:
                return []
            if not self._beside[ways[0]]:
                return [*chain, ways[0]] if self._rejoins(chain[-1], links) else chain
            chain.append(ways[0])


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


ROLES = tuple(LaneRole)
"""All roles; their indices are the codes of `Roles.codes`."""


class RoleRange(NamedTuple):
    """The role of a lane of a road, from one s to another (m)."""

    road: str
    lane: int
    start: float
    end: float
    role: LaneRole


@dataclass(frozen=True)
class Roles:
    """Roles of all driving lanes of one map. Lanes without an entry (shoulders, pavements) have the role `other`."""

    entries: tuple[RoleRange, ...]

    def codes(self, graph: LaneGraph, strip: IntArray, s: FloatArray) -> IntArray:
        """Index into `ROLES` of each row's role; rows on no strip have that of `other`."""
        other = ROLES.index(LaneRole.OTHER)
        found = np.full(len(graph.strips) + 1, other, np.int64)
        parts: list[tuple[int, RoleRange]] = []
        for entry in self.entries:
            for number in graph.numbers(entry.road, entry.lane, entry.start, entry.end):
                piece = graph.strips[number]
                if entry.start <= piece.start + _TOLERANCE and entry.end >= piece.end - _TOLERANCE:
                    found[number] = ROLES.index(entry.role)
                else:
                    parts.append((number, entry))
        codes = found[strip]
        for number, entry in parts:
            codes[(strip == number) & (s >= entry.start) & (s <= entry.end)] = ROLES.index(
                entry.role
            )
        return codes


def roles_of(network: RoadNetwork, proposed: Sequence[RoleRange], folder: Path) -> Roles:
    """The roles in an edited file, beside the map or in a folder for proposals; without one those proposed, which are written
    into that folder if it allows.

    Raises:
        InvalidFile: an edited file is malformed, or does not fit the map; names the entry.
    """
    beside = Path(network.path).with_suffix(ENDING)
    own = folder / beside.name
    for path in dict.fromkeys((beside, own)):
        if path.is_file():
            document = _document(path)
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

    if not isinstance(one, dict) or not {"road", "lane", "role"} <= one.keys() <= {
        "road",
        "lane",
        "role",
        "from",
        "to",
    }:
        raise wrong("an entry has road, lane and role, and perhaps from and to")
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
            f"from {start:g} to {end:g} m is no stretch of road {road.id}, which is {road.length:g} m long"
        )
    lanes = {
        lane
        for section in road.sections
        if section.end > start and section.s < end
        for lane in section.lanes
        if lane
    }
    if isinstance(one["lane"], bool) or one["lane"] not in lanes:
        raise wrong(f"road {road.id} has no lane {one['lane']!r} from {start:g} to {end:g} m")
    return RoleRange(road.id, one["lane"], float(start), float(end), LaneRole(one["role"]))
