"""What shapes tell: rings of roundabouts are short, round cycles of one-way lanes; at crossings ways cross or turn."""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from recognition.sites.lanes import LaneGraph
from xodr.array_types import FloatArray
from xodr.graph.ways import DRIVABLE
from xodr.lookup.sampling import sample
from xodr.network import RoadNetwork

LONGEST = 400.0
"""Longest way round, m."""
ROUNDNESS = 0.8
"""Least 4π·area/perimeter² (1 for a circle): a square has 0.785, an ellipse of 2 : 1 0.84."""
TURN = math.radians(45.0)
"""Least change of heading of a way that turns, rad."""
_STEP = 2.0


def ring_strips(network: RoadNetwork, graph: LaneGraph) -> set[int]:
    """Indices of the strips that lie on a ring."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components, dijkstra

    one_way = _one_way(graph)
    links = [(one, after) for one in sorted(one_way) for after in graph.following[one] if after in one_way]
    if not links:
        return set()
    rows, columns = np.array(links).T
    size = len(graph.strips)
    ways = csr_array((np.maximum(graph.length[columns], 1e-3), (rows, columns)), shape=(size, size))
    component = connected_components(ways, connection="strong")[1]
    found: set[int] = set()
    for one, after in links:
        if component[one] != component[after] or {one, after} <= found:
            continue
        distance, before = dijkstra(ways, indices=[after], return_predecessors=True, limit=LONGEST)
        if distance[0, one] + graph.length[after] <= LONGEST:
            cycle = _cycle(before[0], after, one)
            if _roundness(network, graph, cycle) >= ROUNDNESS:
                found.update(cycle)
    return found


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


def _roundness(network: RoadNetwork, graph: LaneGraph, cycle: list[int]) -> float:
    x, y = np.concatenate([_centre_line(network, graph, number) for number in cycle]).T
    dx, dy = np.roll(x, -1) - x, np.roll(y, -1) - y
    area = 0.5 * abs(float((x * dy - y * dx).sum()))
    return 4.0 * math.pi * area / max(float(np.hypot(dx, dy).sum()) ** 2, 1e-9)


def _centre_line(network: RoadNetwork, graph: LaneGraph, number: int, end: bool = False) -> FloatArray:
    """Points (n, 2) on a strip's centre line, in the direction of its traffic, with its end or without."""
    strip = graph.strips[number]
    ends = (strip.start, strip.end) if strip.forward else (strip.end, strip.start)
    s = np.linspace(*ends, 1 + math.ceil((strip.end - strip.start) / _STEP))[: None if end else -1]
    road = network.roads[strip.road]
    centre = road.sections[strip.section].lanes[strip.lane].center
    return sample(road, s, [centre(one) for one in s.tolist()])[:, :2]
