"""Which lanelets are the inside of junctions, and become their connecting roads.

A connecting road leads from one road to one other. Lanelets that cross others, or split off and merge again, are taken for such,
and with them all that split or merge where they do. What does not lead from one to one, since it splits or merges once more or
leaves the map, is cut in two: the part at the junction then does. Where lanes only split or merge (ramps), nothing is inside.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from xodr.lanelet2.bundles import Bundle, Layout, chained, joined
from xodr.lanelet2.graph import Graph
from xodr.lanelet2.lanelet import Lanelet, Points
from xodr.lanelet2.lines.polylines import frame_at, lengths, middle
from xodr.lanelet2.lines.splitting import split

_LONGEST_CROSSING = 60.0
"""Length up to which lanelets are taken to cross on the same level where they do nothing else, m."""
_LONGEST_PART = 15.0
"""Length of what is cut off for a junction where nothing crosses it, m."""
_PAST_CROSSING = 5.0
"""How far beyond the last crossing the cut is, m."""
_LARGEST_SHARE = 0.8
"""Largest share of a lanelet that is cut off for a junction."""


def layout(graph: Graph) -> tuple[Graph, Layout]:
    """The roads that a map of lanelets consists of, and the lanelets that they are made of."""
    rows = joined(graph, [Bundle(tuple((name,) for name in row)) for row in graph.rows()])
    whole, cuts = _inside(graph, rows)
    inside = {name for number in whole for name in rows.bundles[number].first}
    table = graph.canonical()
    for number, at_end in sorted(cuts.items()):
        inside |= _cut(graph, table, rows.bundles[number], at_end)
    parts = Graph(list(table.values()))
    parts.notes[:0] = graph.notes
    marked = [Bundle(tuple((name,) for name in row), row[0] in inside) for row in parts.rows()]
    return parts, joined(parts, chained(parts, joined(parts, marked)))


def _inside(graph: Graph, rows: Layout) -> tuple[set[int], dict[int, bool]]:
    """The rows that are inside as a whole, and those of which a part is, with whether that is the part at their end."""
    siblings: dict[tuple[int, bool], tuple[int, ...]] = {}
    for joint in rows.joints:
        for side, other, at_end in ((joint.beginning, joint.ending, False), (joint.ending, joint.beginning, True)):
            if len(side) > 1 and len(other) == 1:
                siblings |= {(number, at_end): side for number in side}
    whole: set[int] = set()
    cuts: dict[int, bool] = {}
    todo = [(number, at_end) for number in range(len(rows.bundles)) for at_end in _wanted(graph, rows, number)]
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
        return []
    return [at_end for at_end, leads in zip((False, True), single, strict=True) if leads][:1]


def _single(rows: Layout, number: int) -> tuple[bool, bool]:
    """Whether a row comes from one row only, and leads to one only."""
    start, end = rows.joint(number, False), rows.joint(number, True)
    return start is not None and len(start.ending) == 1, end is not None and len(end.beginning) == 1


def _crosses(graph: Graph, rows: Layout, number: int) -> bool:
    """Whether a row crosses another one; a long one that neither splits nor merges does so on a bridge."""
    if not any(graph.crossings[name] for name in rows.bundles[number].first):
        return False
    joints = (rows.joint(number, False), rows.joint(number, True))
    bound = lengths(graph.lanelets[rows.bundles[number].first[0]].left)[-1]
    return bound <= _LONGEST_CROSSING or any(joint is not None and not joint.plain for joint in joints)


def _splits_and_merges(rows: Layout, number: int) -> bool:
    """Whether a single lane begins at a split and ends at a merge with others, as in a roundabout.

    A lane that splits off another one and comes back to it widens a road, and is no inside of a junction.
    """
    start, end = rows.joint(number, False), rows.joint(number, True)
    if start is None or end is None or len(rows.bundles[number].lanes) > 1:
        return False
    return not start.plain and not end.plain and set(start.beginning) & set(end.ending) == {number}


def _cut(graph: Graph, table: dict[str, Lanelet], row: Bundle, at_end: bool) -> set[str]:
    """Split a row, and say which parts are inside: the ones at its end, or at its start."""
    lanelets = [table[name] for name in row.first]
    line = middle(lanelets[0].left, lanelets[-1].right)
    total = lengths(line)[-1]
    places = [s if not at_end else total - s for s in _crossed(graph, row.first, line)]
    part = max(places) + _PAST_CROSSING if places else min(_LONGEST_PART, total / 2)
    part = min(part, _LARGEST_SHARE * total)
    seconds = split(table, lanelets, frame_at(line, total - part if at_end else part))
    return set(seconds.values()) if at_end else set(row.first)


def _crossed(graph: Graph, names: Iterable[str], line: Points) -> list[float]:
    """Where others cross a line, as lengths on it."""
    from shapely import LineString, get_coordinates, points

    curve = LineString(line)
    others = sorted({other for name in names for other in graph.crossings[name]})
    lines = [LineString(middle(graph.lanelets[other].left, graph.lanelets[other].right)) for other in others]
    meetings = [get_coordinates(curve.intersection(other)) for other in lines]
    return curve.project(points(np.concatenate(meetings))).tolist() if meetings else []
