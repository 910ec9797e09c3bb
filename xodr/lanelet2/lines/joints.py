"""Lanelets beside several others: split where the bound of a neighbour begins or ends, so that neighbours share whole bounds."""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

from xodr.lanelet2.lanelet import Lanelet, Neighbour
from xodr.lanelet2.lines.bounds import Bounds
from xodr.lanelet2.lines.polylines import frame_at, lengths
from xodr.lanelet2.lines.splitting import row_of, split

_SIDES = ("left", "right")
Nodes = tuple[str, ...]


def split_at_joints(
    lanes: Sequence[Lanelet], bounds: Sequence[Bounds], joined: Collection[str]
) -> tuple[list[Lanelet], list[str]]:
    """The lanelets (with successors and right neighbours), split where neighbours share a part of a bound with them.

    Args:
        bounds: those of each lanelet.
        joined: lanelets with bounds of several ways.

    Returns:
        the lanelets, and a sentence on each that was split.
    """
    table = {lane.id: lane for lane in lanes}
    nodes = {lane.id: list(edges.nodes) for lane, edges in zip(lanes, bounds, strict=True) if lane.type != "sidewalk"}
    starts: list[dict[str, list[tuple[str, Nodes]]]] = [defaultdict(list), defaultdict(list)]
    for name, lines in nodes.items():
        for side, line in enumerate(lines):
            starts[side][line[0]].append((name, line))
    notes, queue = [], deque(name for name in nodes if name in joined)
    while queue:
        name = queue.popleft()
        for side in (0, 1):
            line = nodes[name][side]
            found = _beside(line, starts[1 - side])
            if found is None:
                continue
            other, at, shared = found
            count = at + 1 if at else shared
            if count < len(line):
                queue.extend((name, _cut(table, nodes, name, side, count)))
                notes.append(f"lanelet {name} is split where {other} beside it {'begins' if at else 'ends'}")
                break
            one, right = (other, name) if side == 0 else (name, other)
            table[one] = replace(table[one], beside_right=Neighbour(right, True))
    return list(table.values()), notes


def _beside(line: Nodes, starts: Mapping[str, Sequence[tuple[str, Nodes]]]) -> tuple[str, int, int] | None:
    """The first lanelet with a bound that is a part of a line: its id, from which node on, and how many nodes."""
    along = ((at, *other) for at, node in enumerate(line[:-1]) for other in starts.get(node, ()))
    return next(((name, at, len(other)) for at, name, other in along if line[at : at + len(other)] == other), None)


def _cut(table: dict[str, Lanelet], nodes: dict[str, list[Nodes]], name: str, side: int, count: int) -> str:
    """Split a lanelet, and who shares a whole bound with it, after as many nodes of one of its bounds; its second part."""
    points, line = getattr(table[name], _SIDES[side]), nodes[name][side]
    seconds = split(table, row_of(table, table[name]), frame_at(points, float(lengths(points)[count - 1])))
    for part in (*seconds, *seconds.values()):
        nodes[part] = [(), ()]
    for part, own in ((name, slice(count)), (seconds[name], slice(count - 1, None))):
        table[part] = replace(table[part], **{_SIDES[side]: points[own]})
        nodes[part][side] = line[own]
    return seconds[name]
