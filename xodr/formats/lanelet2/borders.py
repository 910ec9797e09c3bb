"""Borders of lanelets: lanelets that share them, places of splits, and implicit parts of maps.

As in Lanelet2, left and right decide the direction of travel, lanelets follow each other where
their bounds share end points, and are neighbours where they share a bound. Maps by hand have lanes
that end at the side of another one, and lanes that are missing between two others although their
borders are there."""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from xodr.formats.lanelet2.lanelet import (
    WALKS,
    CrossLine,
    Lanelet,
    LaneletNeighbour,
    Points,
    crossing,
    direction,
    frame_at,
    lengths,
    middle,
    resampled,
    row_of,
    split,
)
from xodr.formats.lanelet2.osm import Osm, OsmWay, Relation
from xodr.graph.ways import DRIVABLE

_ALIGNED = 8
"""Points of both bounds of a lanelet by which these are turned the same way."""
TOUCHING = 0.1
"""Points that are not farther apart than this are one, m."""


@dataclass(frozen=True, eq=False)
class LaneletBounds:
    """The bounds of a lanelet, turned to its direction of travel: ways, ids of
    nodes, and points.
    """

    ways: tuple[OsmWay, OsmWay]
    nodes: tuple[tuple[str, ...], tuple[str, ...]]
    left: Points
    right: Points


def bounds_of(
    osm: Osm, relation: Relation, points: dict[str, tuple[float, float]]
) -> LaneletBounds:
    """The bounds of a lanelet; points: x and y of each node.

    Raises:
        InvalidFile: it does not have one way on each side, or several that make one line, with two
            nodes or more.
    """
    left, right = _bound(osm, relation, "left"), _bound(osm, relation, "right")
    nodes = [left.nodes, right.nodes]
    lines = [np.array([points[node] for node in way]) for way in nodes]
    for role, line in (("left", lines[0]), ("right", lines[1])):
        if not lengths(line)[-1] > TOUCHING:
            raise relation.invalid(f"its {role} bound has no length")
    # Ends alone leave a choice where a lanelet is a ring.
    along, beside = (resampled(line, _ALIGNED) for line in lines)
    if np.hypot(*(along - beside).T).sum() > np.hypot(*(along - beside[::-1]).T).sum():
        nodes[1], lines[1] = nodes[1][::-1], lines[1][::-1]
    x, y = np.concatenate([lines[0], lines[1][::-1]]).T
    # Along left and back along right is clockwise; counterclockwise, left would be on the right.
    if np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) > 0.0:
        nodes, lines = [way[::-1] for way in nodes], [line[::-1] for line in lines]
    return LaneletBounds((left, right), (nodes[0], nodes[1]), lines[0], lines[1])


def _bound(osm: Osm, relation: Relation, role: str) -> OsmWay:
    ways = [osm.ways[ref] for ref in relation.refs(role, "way")]
    if not ways:
        raise relation.invalid(f"a lanelet has one way as its {role} bound, this one has none")
    short = next((way for way in ways if len(way.nodes) < 2), None)
    if short is not None:
        raise relation.invalid(
            f"its {role} bound, way {short.id}, has {len(short.nodes)} nodes, "
            "two or more are needed"
        )
    line = _joined([way.nodes for way in ways])
    if line is None:
        raise relation.invalid(
            f"its {role} bound, ways {' '.join(way.id for way in ways)}, is not one line"
        )
    return OsmWay(ways[0].id, line, ways[0].tags)


def _joined(lines: list[tuple[str, ...]]) -> tuple[str, ...] | None:
    """One line of lines (nodes), in any order and direction, that share end nodes; None where they
    make no line."""
    whole, *others = lines
    while others:
        ends = {whole[0], whole[-1]}
        following = next((line for line in others if ends & {line[0], line[-1]}), None)
        if following is None:
            return None
        others.remove(following)
        # Lines go on at the end: what meets the beginning makes the whole turn round.
        if whole[-1] not in (following[0], following[-1]):
            whole = whole[::-1]
        whole += following[1:] if following[0] == whole[-1] else following[-2::-1]
    return whole


def linked(
    lanes: list[Lanelet], bounds: list[LaneletBounds], directed: Collection[str]
) -> list[Lanelet]:
    """Return the lanes with their successors and right neighbours.

    Sidewalks have no neighbours. They are two-way and stay alone, but for `directed` ones, which
    have a direction and lead to others of these.
    """
    from scipy.spatial import KDTree

    # Both corners at once, as one point in four dimensions: lanelets follow where both ends meet.
    starts = np.array([[*edges.left[0], *edges.right[0]] for edges in bounds])
    ends = np.array([[*edges.left[-1], *edges.right[-1]] for edges in bounds])
    following = KDTree(starts).query_ball_point(ends, TOUCHING)
    beside = defaultdict(list)
    for lane, edges in zip(lanes, bounds, strict=True):
        if lane.type not in WALKS:
            beside[edges.nodes[0]].append(lane.id)
    found = []
    for index, lane in enumerate(lanes):
        walk, led = lane.type in WALKS, lane.id in directed
        after = [lanes[other] for other in sorted(following[index])]
        right = beside[bounds[index].nodes[1]]
        neighbour = LaneletNeighbour(right[0], True) if right and not walk else None
        onward = tuple(
            one.id
            for one in after
            if (led and one.id in directed if walk else one.type not in WALKS)
        )
        found.append(replace(lane, successors=onward, beside_right=neighbour))
    return found


_SIDES = ("left", "right")
Nodes = tuple[str, ...]


def split_at_joints(
    lanes: Sequence[Lanelet], bounds: Sequence[LaneletBounds], joined: Collection[str]
) -> tuple[list[Lanelet], list[str]]:
    """The lanelets (with successors and right neighbours), split where neighbours share a part of a
    bound with them.

    Args:
        bounds: those of each lanelet.
        joined: lanelets with bounds of several ways.

    Returns:
        the lanelets, and a sentence on each that was split.
    """
    table = {lane.id: lane for lane in lanes}
    nodes = {
        lane.id: list(edges.nodes)
        for lane, edges in zip(lanes, bounds, strict=True)
        if lane.type not in WALKS
    }
    # By the first node, so that a bound meets only lines that may be a part of it.
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
                # Both parts may lie beside more lanelets.
                queue.extend((name, _cut(table, nodes, name, side, count)))
                notes.append(
                    f"lanelet {name} is split where {other} beside it {'begins' if at else 'ends'}"
                )
                # The lanelet's own bounds are others now.
                break
            one, right = (other, name) if side == 0 else (name, other)
            table[one] = replace(table[one], beside_right=LaneletNeighbour(right, True))
    return list(table.values()), notes


def _beside(
    line: Nodes, starts: Mapping[str, Sequence[tuple[str, Nodes]]]
) -> tuple[str, int, int] | None:
    """First lanelet with a bound that is a part of a line: id, first node and number of nodes."""
    along = ((at, *other) for at, node in enumerate(line[:-1]) for other in starts.get(node, ()))
    return next(
        (
            (name, at, len(other))
            for at, name, other in along
            if line[at : at + len(other)] == other
        ),
        None,
    )


def _cut(
    table: dict[str, Lanelet], nodes: dict[str, list[Nodes]], name: str, side: int, count: int
) -> str:
    """Split a lanelet, and lanelets that share a whole bound with it, after a number of nodes;
    return the second part."""
    points, line = getattr(table[name], _SIDES[side]), nodes[name][side]
    seconds = split(
        table, row_of(table, table[name]), frame_at(points, float(lengths(points)[count - 1]))
    )
    # Cut bounds end between the map's nodes and are compared no more, but for the one cut at a
    # node.
    for part in (*seconds, *seconds.values()):
        nodes[part] = [(), ()]
    for part, own in ((name, slice(count)), (seconds[name], slice(count - 1, None))):
        table[part] = replace(table[part], **{_SIDES[side]: points[own]})
        nodes[part][side] = line[own]
    return seconds[name]


_LED = DRIVABLE - {"restricted"}
"""Types of lanes that others lead into; restricted ones are areas."""
_WIDTHS = (2.0, 6.0)
"""Width that a lane may have that is only seen by its borders, m."""
_BESIDE = 0.5
"""Largest distance (m) between the end corners of a lanelet and the bounds of the next lanelet."""
_NEAR_END = 2.0
"""A lanelet is not split nearer to its ends than this, m."""
_OBLIQUE = 2.0
"""A lanelet's first or last points are taken for a piece of a bound where they lie this much more
along than across it."""


def completed(lanelets: Iterable[Lanelet]) -> tuple[list[Lanelet], list[str]]:
    """Complete lanelets of a Lanelet2 map (with successors and right neighbours).

    Returns:
        the lanelets, and a sentence on each change.
    """
    table = {lanelet.id: lanelet for lanelet in lanelets}
    notes = [*_filled(table), *_led_into(table)]
    for name, lanelet in table.items():
        table[name] = _squared(lanelet)
        if table[name] is not lanelet:
            notes.append(f"lanelet {name} ends along another one: it tapers off there")
    return list(table.values()), notes


# lanes of which only the borders are there ------------------------------------------------------


def _filled(table: dict[str, Lanelet]) -> list[str]:
    """Add the lane between two others where a lanelet goes on from the gap between them."""
    notes = []
    for lanelet in _without_predecessors(table):
        # Medians and other areas begin beside others without any lane before them.
        if lanelet.type not in _LED:
            continue
        left = next(
            (
                one
                for one in _lanes(table)
                if not one.beside_right and _touch(one.right[-1], lanelet.left[0])
            ),
            None,
        )
        right = next((one for one in _lanes(table) if _touch(one.left[-1], lanelet.right[0])), None)
        if left is None or right is None or left is right or not _parallel(left.right, right.left):
            continue
        name = f"{left.id}|{right.id}"
        # Bounds and marks are those of its neighbours, which the map has.
        table[name] = replace(
            left, id=name, left=left.right, right=right.left, successors=(lanelet.id,),
            beside_right=LaneletNeighbour(right.id, True), left_mark=left.right_mark,
            right_mark=right.left_mark, lights=(),
        )  # fmt: skip
        table[left.id] = replace(left, beside_right=LaneletNeighbour(name, True))
        notes.append(
            f"lanelet {lanelet.id} goes on between {left.id} and {right.id}: a lane is added "
            f"there, {name}"
        )
    return notes


def _lanes(table: dict[str, Lanelet]) -> list[Lanelet]:
    return [lanelet for lanelet in table.values() if lanelet.type not in WALKS]


def _without_predecessors(table: dict[str, Lanelet]) -> list[Lanelet]:
    followed = {name for lanelet in table.values() for name in lanelet.successors}
    return [lanelet for lanelet in _lanes(table) if lanelet.id not in followed]


def _touch(one: Points, other: Points) -> bool:
    return bool(np.hypot(*(one - other)) <= TOUCHING)


def _parallel(left: Points, right: Points) -> bool:
    """Whether two lines are a lane's width apart all along."""
    apart = np.hypot(*(resampled(left, 20) - resampled(right, 20)).T)
    return bool(apart.min() >= _WIDTHS[0] and apart.max() <= _WIDTHS[1])


# lanelets that end at the side of others --------------------------------------------------------


def _led_into(table: dict[str, Lanelet]) -> list[str]:
    """Split lanelets where another one ends upon them, so that it can lead into the second part."""
    notes = []
    # A list beforehand: splits put more lanelets into the table.
    for lanelet in [lanelet for lanelet in _lanes(table) if not lanelet.successors]:
        target = next(
            (
                other
                for other in _lanes(table)
                if other is not lanelet and _ends_upon(lanelet, other)
            ),
            None,
        )
        if target is None:
            continue
        row = row_of(table, target)
        line = middle(row[0].left, row[-1].right)
        x, y = (lanelet.left[-1] + lanelet.right[-1]) / 2
        heading = direction(middle(lanelet.left, lanelet.right), True)
        rest = split(
            table, row, frame_at(line, crossing(line, CrossLine(float(x), float(y), heading))[0])
        )[target.id]
        table[lanelet.id] = replace(lanelet, successors=(rest,))
        notes.append(
            f"lanelet {lanelet.id} ends upon {target.id}: it leads into that "
            f"one's second part, {rest}"
        )
    return notes


def _ends_upon(lanelet: Lanelet, other: Lanelet) -> bool:
    """Whether both corners of a lanelet's end lie on the bounds of another one,
    away from its ends.
    """
    pairs = ((lanelet.left[-1], other.left), (lanelet.right[-1], other.right))
    # A lanelet that tapers off comes to a point, which lies on one bound only.
    if lanelet.type != other.type or np.hypot(*(lanelet.left[-1] - lanelet.right[-1])) < _BESIDE:
        return False
    return all(_is_upon(point, line) for point, line in pairs)


def _is_upon(point: Points, line: Points) -> bool:
    from shapely import LineString, Point

    curve = LineString(line)
    s = curve.project(Point(*point))
    # At the ends of the other one, lanelets follow each other without any split.
    return bool(
        _NEAR_END < s < curve.length - _NEAR_END and curve.distance(Point(*point)) <= _BESIDE
    )


# ends that are not across -----------------------------------------------------------------------


def _squared(lanelet: Lanelet) -> Lanelet:
    """The lanelet with the shorter bound led on to the other's end where the line between the two
    runs along the lanelet.

    That is how lanelets end that are drawn up to the side of another one: they then taper off.
    """
    left, right = lanelet.left, lanelet.right
    for place in (0, -1):
        # Across the lanelet, the line between the corners has hardly any part along it.
        ahead, aside = _obliqueness(left, right, place)
        if abs(ahead) > _OBLIQUE * abs(aside):
            shorter_left = (ahead > 0.0) == (place == -1)
            left, right = (
                (_led_on(left, right, place), right)
                if shorter_left
                else (left, _led_on(right, left, place))
            )
    return (
        lanelet
        if left is lanelet.left and right is lanelet.right
        else replace(lanelet, left=left, right=right)
    )


def _obliqueness(left: Points, right: Points, place: int) -> tuple[float, float]:
    """Return the offset (m) of the right bound's end from the left one's, along and across."""
    step = sum(line[place] - line[1 if place == 0 else -2] for line in (left, right)) * (
        1 if place == -1 else -1
    )
    way = step / np.hypot(*step)
    dx, dy = right[place] - left[place]
    return float(dx * way[0] + dy * way[1]), float(dy * way[0] - dx * way[1])


def _led_on(line: Points, other: Points, place: int) -> Points:
    return np.concatenate([line, other[-1:]] if place == -1 else [other[:1], line])
