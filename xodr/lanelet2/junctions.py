"""The junctions of a map: which joints make up each of them, and the ways through it."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence

from xodr.builders.elements import Connection, Junction
from xodr.lanelet2.bundles import Joint, Layout
from xodr.lanelet2.graph import Graph
from xodr.lanelet2.lines.splitting import parts_of


def junction_ids(graph: Graph, plan: Layout) -> list[int]:
    """The junction that each joint belongs to, -1 for none.

    Joints at the two ends of a connecting road share one, and so do those of connecting roads that cross.
    """
    pairs, needed = [], {index for index, joint in enumerate(plan.joints) if not joint.plain}
    entry: dict[str, int] = {}
    for number, start in _entries(plan):
        end = plan.index(number, True)
        ends = {start} if end is None else {start, end}
        pairs.append((min(ends), max(ends)))
        needed |= ends
        entry |= {name: start for lane in plan.bundles[number].lanes for name in lane}
    pairs += [(entry[one], entry[other]) for one in sorted(entry) for other in sorted(graph.crossings[one]) if other in entry]
    groups = _grouped(len(plan.joints), pairs)
    ids = {group: len(plan.bundles) + 1 + place for place, group in enumerate(sorted({groups[index] for index in needed}))}
    return [ids[group] if index in needed else -1 for index, group in enumerate(groups)]


def _entries(plan: Layout) -> Iterator[tuple[int, int]]:
    """The connecting roads, and the joints that they begin at."""
    for number, bundle in enumerate(plan.bundles):
        start = plan.index(number, False)
        if bundle.inside and start is not None:
            yield number, start


def _grouped(count: int, pairs: list[tuple[int, int]]) -> list[int]:
    """The smallest number that each number is joined with, directly or by way of others."""
    parents = list(range(count))

    def root(index: int) -> int:
        while parents[index] != index:
            index = parents[index]
        return index

    for one, other in pairs:
        first, second = sorted((root(one), root(other)))
        parents[second] = first
    return [root(index) for index in range(count)]


def junctions(plan: Layout, ids: list[int], priorities: Sequence[tuple[str, str]]) -> tuple[Junction, ...]:
    """The junctions, with the ids that `junction_ids` gave. Road ids are the numbers of the bundles plus 1.

    priorities: pairs of lanelets of which the first goes before the second.
    """
    groups: dict[int, list[Joint]] = defaultdict(list)
    for joint, identity in zip(plan.joints, ids, strict=True):
        if identity != -1:
            groups[identity].append(joint)
    ranks: dict[int, set[tuple[int, int]]] = defaultdict(set)
    inside = {number: ids[index] for number, index in _entries(plan)}
    for first, waiting in priorities:
        for high in _through(plan, first):
            for low in _through(plan, waiting):
                if high != low and inside[high] == inside[low]:
                    ranks[inside[high]].add((high + 1, low + 1))
    return tuple(_junction(plan, identity, joints, sorted(ranks[identity])) for identity, joints in sorted(groups.items()))


def _through(plan: Layout, name: str) -> list[int]:
    """The connecting roads that a lanelet is part of, else those that it leads to."""
    parts = [plan.places[part] for part in parts_of(name, plan.places)]
    inside = [number for number, _ in parts if plan.bundles[number].inside]
    if inside:
        return inside
    joints = [(part, joint) for part in parts if (joint := plan.joint(part[0], True)) is not None]
    return sorted(
        {after[0] for part, joint in joints for before, after in joint.lanes if before == part and plan.bundles[after[0]].inside}
    )


def _junction(plan: Layout, identity: int, joints: list[Joint], priorities: list[tuple[int, int]]) -> Junction:
    """A junction: its connections enter the connecting roads, or lead from road to road where there are none."""
    inside = any(plan.bundles[number].inside for joint in joints for number in (*joint.ending, *joint.beginning))
    lanes: dict[tuple[int, int], list[tuple[int, int]]] = defaultdict(list)
    for joint in joints:
        for (before, one), (after, other) in joint.lanes:
            if not inside or plan.bundles[after].inside:
                lanes[before, after].append((-one - 1, -other - 1))
    connections = tuple(Connection(before + 1, after + 1, tuple(links)) for (before, after), links in sorted(lanes.items()))
    return Junction(identity, f"Junction {identity}", connections, tuple(priorities), direct=not inside)
