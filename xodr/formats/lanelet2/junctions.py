"""Junctions of a map: the lanelets inside them, the joints that make up each, and the ways through
it.

A connecting road leads from one road to one other. Lanelets that cross others, or split off and
merge again, become connecting roads, and with them all that split or merge at the same place. So do
lanelets off motorways that turn where they split off or merge: side streets are entered and left
there. A lanelet that does not lead from one road to one other, since it splits or merges once more
or leaves the map, is cut in two: the part at the junction then does. Where lanes only split or
merge (ramps), nothing is inside."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from xodr.builders.elements import connection
from xodr.formats.lanelet2.graph import Bundle, Graph, Joint, Layout, chained, joined
from xodr.formats.lanelet2.lanelet import (
    Lanelet,
    Points,
    frame_at,
    lengths,
    middle,
    parts_of,
    split,
)
from xodr.model import Junction

_CLOSED = 0.5
"""Distance (m) of the ends of a lanelet that is a ring."""
_LONGEST_CROSSING = 60.0
"""Length up to which lanelets are taken to cross on the same level where they do nothing else, m.
"""
_LONGEST_PART = 15.0
"""Length of what is cut off for a junction where nothing crosses it, m."""
_PAST_CROSSING = 5.0
"""Distance (m) from the last crossing to the cut."""
_TURN, _TURNING = math.radians(45.0), 40.0
"""Least change of direction of a turn, within so many metres"""
_MOST_OF = 0.9
"""Share of a turn at which it is done"""
_BETWEEN = 1.0
"""Length of the road between two junctions where lanelets inside them meet, m"""
_LARGEST_SHARE = 0.8
"""Largest share of a lanelet that is cut off for a junction."""


def layout(graph: Graph) -> tuple[Graph, Layout]:
    """The roads that a map of lanelets consists of, and the lanelets that they are made of."""
    graph = _opened(graph)
    rows = joined(graph, [Bundle(tuple((name,) for name in row)) for row in graph.rows()])
    whole, cuts = _inside(graph, rows)
    inside = {name for number in whole for name in rows.bundles[number].first}
    table = graph.canonical()
    for number, at_end in sorted(cuts.items()):
        inside |= _cut(graph, table, rows.bundles[number], at_end)
    parts, plan = _planned(graph, table, inside)
    met = [
        number
        for joint in plan.joints
        if any(plan.bundles[number].inside for number in joint.ending)
        for number in joint.beginning
        if plan.bundles[number].inside
    ]
    if not met:
        return parts, plan
    for number in met:
        # Connecting roads that differ, as in their speed limit, are no one road; and one that leads
        # into another would be its incoming road: a stretch outside lies between.
        lanelets = [table[name] for name in plan.bundles[number].first]
        line = middle(lanelets[0].left, lanelets[-1].right)
        seconds = split(table, lanelets, frame_at(line, min(_BETWEEN, lengths(line)[-1] / 2)))
        inside = (inside - seconds.keys()) | set(seconds.values())
    return _planned(graph, table, inside)


def _planned(graph: Graph, table: dict[str, Lanelet], inside: set[str]) -> tuple[Graph, Layout]:
    """The lanelets of a table as a graph, with the notes of another one, and its roads."""
    parts = Graph(list(table.values()))
    parts.notes[:0] = graph.notes
    marked = [Bundle(tuple((name,) for name in row), row[0] in inside) for row in parts.rows()]
    return parts, joined(parts, chained(parts, joined(parts, marked)))


def _opened(graph: Graph) -> Graph:
    """The lanelets with rings cut in two: a lane across which its start and its end lie has no
    place of its own for either."""
    table = graph.canonical()
    for row in graph.rows():
        lanelets = [table[name] for name in row]
        line = middle(lanelets[0].left, lanelets[-1].right)
        if np.hypot(*(line[-1] - line[0])) < _CLOSED:
            split(table, lanelets, frame_at(line, lengths(line)[-1] / 2))
    if len(table) == len(graph.lanelets):
        return graph
    opened = Graph(list(table.values()))
    opened.notes[:0] = graph.notes
    return opened


def _inside(graph: Graph, rows: Layout) -> tuple[set[int], dict[int, bool]]:
    """Rows inside as a whole, and rows inside in part, each with whether the part is at its end."""
    siblings: dict[tuple[int, bool], tuple[int, ...]] = {}
    for joint in rows.joints:
        for side, other, at_end in (
            (joint.beginning, joint.ending, False),
            (joint.ending, joint.beginning, True),
        ):
            # Ways from one row to several have to be inside together: a split is one junction.
            if len(side) > 1 and len(other) == 1:
                siblings |= {(number, at_end): side for number in side}
    whole: set[int] = set()
    cuts: dict[int, bool] = {}
    todo = [
        (number, at_end)
        for number in range(len(rows.bundles))
        for at_end in _wanted(graph, rows, number)
    ]
    while todo:
        number, at_end = todo.pop()
        if number in whole or cuts.get(number) == at_end:
            continue
        ends = [at_end]
        if all(_single(rows, number)):
            whole.add(number)
            ends = [False, True]
        else:
            cuts[number] = at_end
        todo += [(other, end) for end in ends for other in siblings.get((number, end), ())]
    return whole, cuts


def _wanted(graph: Graph, rows: Layout, number: int) -> list[bool]:
    """The ends (True) and starts of a row at which it is the inside of a junction by itself."""
    single = _single(rows, number)
    if not _crosses(graph, rows, number) and not (all(single) and _splits_and_merges(rows, number)):
        # One end: a row is cut once at most.
        return [at_end for at_end in (False, True) if _turns(graph, rows, number, at_end)][:1]
    return [at_end for at_end, leads in zip((False, True), single, strict=True) if leads][:1]


def _single(rows: Layout, number: int) -> tuple[bool, bool]:
    """Whether a row comes from one row only, and leads to one only."""
    start, end = rows.joint(number, False), rows.joint(number, True)
    return start is not None and len(start.ending) == 1, end is not None and len(end.beginning) == 1


def _crosses(graph: Graph, rows: Layout, number: int) -> bool:
    """Whether a row crosses another one; a long row without splits and merges
    crosses on a bridge.
    """
    if not any(graph.crossings[name] for name in rows.bundles[number].first):
        return False
    joints = (rows.joint(number, False), rows.joint(number, True))
    bound = lengths(graph.lanelets[rows.bundles[number].first[0]].left)[-1]
    return bound <= _LONGEST_CROSSING or any(
        joint is not None and not joint.plain for joint in joints
    )


def _splits_and_merges(rows: Layout, number: int) -> bool:
    """Whether a single lane begins at a split and ends at a merge with others, as in a roundabout.

    A lane that splits off another lane and merges with it again widens a road and is outside of
    junctions.
    """
    start, end = rows.joint(number, False), rows.joint(number, True)
    if start is None or end is None or len(rows.bundles[number].lanes) > 1:
        return False
    return not start.plain and not end.plain and set(start.beginning) & set(end.ending) == {number}


def _turns(graph: Graph, rows: Layout, number: int, at_end: bool) -> bool:
    """Whether a row of one lane splits off another row, or merges with one at its end, and turns
    there."""
    joint, names = rows.joint(number, at_end), rows.bundles[number].first
    if joint is None or len(names) > 1 or graph.lanelets[names[0]].road_type == "motorway":
        return False
    sides = (joint.ending, joint.beginning) if at_end else (joint.beginning, joint.ending)
    return len(sides[0]) > 1 and len(sides[1]) == 1 and _bend(graph, names, at_end) > 0.0


def _bend(graph: Graph, names: tuple[str, ...], at_end: bool) -> float:
    """Return the length (m) from an end of a row up to which it turns, by `_TURN` or more within
    `_TURNING`; 0 without a turn."""
    line = middle(graph.lanelets[names[0]].left, graph.lanelets[names[-1]].right)
    line = line[::-1] if at_end else line
    at = lengths(line)
    steps = np.diff(line[at <= _TURNING], axis=0)
    if len(steps) < 2:
        return 0.0
    # Unwrapped: a turn over ±π is no jump.
    heading = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
    turned = np.abs(heading - heading[0])
    return (
        float(at[1:][int(np.argmax(turned >= _MOST_OF * turned.max()))])
        if turned.max() >= _TURN
        else 0.0
    )


def _cut(graph: Graph, table: dict[str, Lanelet], row: Bundle, at_end: bool) -> set[str]:
    """Split a row, and say which parts are inside: the ones at its end, or at its start."""
    lanelets = [table[name] for name in row.first]
    line = middle(lanelets[0].left, lanelets[-1].right)
    total = lengths(line)[-1]
    places = [s if not at_end else total - s for s in _crossed(graph, row.first, line)]
    bend = _bend(graph, row.first, at_end) if len(row.first) == 1 else 0.0
    part = max(places) + _PAST_CROSSING if places else max(bend, min(_LONGEST_PART, total / 2))
    # A stretch outside has to remain as a road.
    part = min(part, _LARGEST_SHARE * total)
    seconds = split(table, lanelets, frame_at(line, total - part if at_end else part))
    return set(seconds.values()) if at_end else set(row.first)


def _crossed(graph: Graph, names: Iterable[str], line: Points) -> list[float]:
    """Return the arc lengths at which other lines cross a line."""
    from shapely import LineString, get_coordinates, points

    curve = LineString(line)
    others = sorted({other for name in names for other in graph.crossings[name]})
    lines = [
        LineString(middle(graph.lanelets[other].left, graph.lanelets[other].right))
        for other in others
    ]
    meetings = [get_coordinates(curve.intersection(other)) for other in lines]
    return curve.project(points(np.concatenate(meetings))).tolist() if meetings else []


def junction_ids(graph: Graph, plan: Layout) -> list[int]:
    """The junction that each joint belongs to, -1 for none.

    Joints at the two ends of a connecting road share one, and so do those of connecting roads that
    cross.
    """
    # A plain joint links two roads, no junction.
    pairs, needed = [], {index for index, joint in enumerate(plan.joints) if not joint.plain}
    entry: dict[str, int] = {}
    for number, start in _entries(plan):
        end = plan.index(number, True)
        ends = {start} if end is None else {start, end}
        pairs.append((min(ends), max(ends)))
        needed |= ends
        entry |= {name: start for lane in plan.bundles[number].lanes for name in lane}
    pairs += [
        (entry[one], entry[other])
        for one in sorted(entry)
        for other in sorted(graph.crossings[one])
        if other in entry
    ]
    groups = _grouped(len(plan.joints), pairs)
    ids = {
        # After the ids of roads, which are the numbers of bundles from 1 on.
        group: len(plan.bundles) + 1 + place
        for place, group in enumerate(sorted({groups[index] for index in needed}))
    }
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
        # The smaller one is the root, whatever the order of the pairs.
        parents[second] = first
    return [root(index) for index in range(count)]


def junctions(
    plan: Layout, ids: list[int], priorities: Sequence[tuple[str, str]]
) -> tuple[Junction, ...]:
    """The junctions, with the ids that `junction_ids` gave. Road ids are the numbers of the bundles
    plus 1.

    priorities: pairs of lanelets (with right of way, waiting).
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
    return tuple(
        _junction(plan, identity, joints, sorted(ranks[identity]))
        for identity, joints in sorted(groups.items())
    )


def _through(plan: Layout, name: str) -> list[int]:
    """Connecting roads that contain a lanelet, else connecting roads after it."""
    parts = [plan.places[part] for part in parts_of(name, plan.places)]
    inside = [number for number, _ in parts if plan.bundles[number].inside]
    if inside:
        return inside
    joints = [(part, joint) for part in parts if (joint := plan.joint(part[0], True)) is not None]
    return sorted(
        {
            after[0]
            for part, joint in joints
            for before, after in joint.lanes
            if before == part and plan.bundles[after[0]].inside
        }
    )


def _junction(
    plan: Layout, identity: int, joints: list[Joint], priorities: list[tuple[int, int]]
) -> Junction:
    """A junction: its connections enter the connecting roads, or lead from road to road where there
    are none."""
    inside = any(
        plan.bundles[number].inside
        for joint in joints
        for number in (*joint.ending, *joint.beginning)
    )
    lanes: dict[tuple[int, int], list[tuple[int, int]]] = defaultdict(list)
    for joint in joints:
        for (before, one), (after, other) in joint.lanes:
            # Ways out of connecting roads are links of these, no connections.
            if not inside or plan.bundles[after].inside:
                lanes[before, after].append((-one - 1, -other - 1))
    connections = tuple(
        connection(str(before + 1), str(after + 1), links)
        for (before, after), links in sorted(lanes.items())
    )
    kind = "default" if inside else "direct"
    ranks = tuple((str(high), str(low)) for high, low in priorities)
    return Junction(str(identity), f"Junction {identity}", kind, connections, priorities=ranks)
