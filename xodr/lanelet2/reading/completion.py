"""What a Lanelet2 map leaves implicit and a road network has to state.

Lanelets link where they share end points. Maps by hand have lanes that end at the side of another one, and lanes that are
missing between two others although their borders are there.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from xodr.lanelet2.lanelet import Lanelet, Neighbour, Points
from xodr.lanelet2.lines.bounds import TOUCHING
from xodr.lanelet2.lines.polylines import Frame, crossing, direction, frame_at, middle, resampled
from xodr.lanelet2.lines.splitting import row_of, split

_WIDTHS = (2.0, 6.0)
"""Width that a lane may have that is only seen by its borders, m."""
_BESIDE = 0.5
"""How near the corners of a lanelet's end have to be to the bounds of the lanelet that it leads into, m."""
_NEAR_END = 2.0
"""A lanelet is not split nearer to its ends than this, m."""
_OBLIQUE = 2.0
"""A lanelet's first or last points are taken for a piece of a bound where they lie this much more along than across it."""


def completed(lanelets: Iterable[Lanelet]) -> tuple[list[Lanelet], list[str]]:
    """Lanelets of a Lanelet2 map (with successors and right neighbours), and what was added, one sentence each."""
    table = {lanelet.id: lanelet for lanelet in lanelets}
    notes = [*_filled(table), *_led_into(table)]
    for name, lanelet in table.items():
        table[name] = _squared(lanelet)
        if table[name] is not lanelet:
            notes.append(f"lanelet {name} ends along another one: it tapers off there")
    return list(table.values()), notes


# lanes of which only the borders are there ----------------------------------------------------------


def _filled(table: dict[str, Lanelet]) -> list[str]:
    """Add the lane between two others where a lanelet goes on from the gap between them."""
    notes = []
    for lanelet in _without_predecessors(table):
        left = next((one for one in _lanes(table) if not one.beside_right and _touch(one.right[-1], lanelet.left[0])), None)
        right = next((one for one in _lanes(table) if _touch(one.left[-1], lanelet.right[0])), None)
        if left is None or right is None or left is right or not _parallel(left.right, right.left):
            continue
        name = f"{left.id}|{right.id}"
        table[name] = replace(
            left, id=name, left=left.right, right=right.left, successors=(lanelet.id,), beside_right=Neighbour(right.id, True),
            left_mark=left.right_mark, right_mark=right.left_mark, lights=(),
        )  # fmt: skip
        table[left.id] = replace(left, beside_right=Neighbour(name, True))
        notes.append(f"lanelet {lanelet.id} goes on between {left.id} and {right.id}: a lane is added there, {name}")
    return notes


def _lanes(table: dict[str, Lanelet]) -> list[Lanelet]:
    return [lanelet for lanelet in table.values() if lanelet.type != "sidewalk"]


def _without_predecessors(table: dict[str, Lanelet]) -> list[Lanelet]:
    followed = {name for lanelet in table.values() for name in lanelet.successors}
    return [lanelet for lanelet in _lanes(table) if lanelet.id not in followed]


def _touch(one: Points, other: Points) -> bool:
    return bool(np.hypot(*(one - other)) <= TOUCHING)


def _parallel(left: Points, right: Points) -> bool:
    """Whether two lines are a lane's width apart all along."""
    apart = np.hypot(*(resampled(left, 20) - resampled(right, 20)).T)
    return bool(apart.min() >= _WIDTHS[0] and apart.max() <= _WIDTHS[1])


# lanelets that end at the side of others -------------------------------------------------------------


def _led_into(table: dict[str, Lanelet]) -> list[str]:
    """Split lanelets where another one ends upon them, so that it can lead into the second part."""
    notes = []
    for lanelet in [lanelet for lanelet in _lanes(table) if not lanelet.successors]:
        target = next((other for other in _lanes(table) if other is not lanelet and _ends_upon(lanelet, other)), None)
        if target is None:
            continue
        row = row_of(table, target)
        line = middle(row[0].left, row[-1].right)
        x, y = (lanelet.left[-1] + lanelet.right[-1]) / 2
        heading = direction(middle(lanelet.left, lanelet.right), True)
        rest = split(table, row, frame_at(line, crossing(line, Frame(float(x), float(y), heading))[0]))[target.id]
        table[lanelet.id] = replace(lanelet, successors=(rest,))
        notes.append(f"lanelet {lanelet.id} ends upon {target.id}: it leads into that one's second part, {rest}")
    return notes


def _ends_upon(lanelet: Lanelet, other: Lanelet) -> bool:
    """Whether both corners of a lanelet's end lie on the bounds of another one, away from its ends."""
    pairs = ((lanelet.left[-1], other.left), (lanelet.right[-1], other.right))
    if lanelet.type != other.type or np.hypot(*(lanelet.left[-1] - lanelet.right[-1])) < _BESIDE:
        return False
    return all(_is_upon(point, line) for point, line in pairs)


def _is_upon(point: Points, line: Points) -> bool:
    from shapely import LineString, Point

    curve = LineString(line)
    s = curve.project(Point(*point))
    return bool(_NEAR_END < s < curve.length - _NEAR_END and curve.distance(Point(*point)) <= _BESIDE)


# ends that are not across ------------------------------------------------------------------------------


def _squared(lanelet: Lanelet) -> Lanelet:
    """The lanelet with the shorter bound led on to the other's end where the line between the two runs along the lanelet.

    That is how lanelets end that are drawn up to the side of another one: they then taper off.
    """
    left, right = lanelet.left, lanelet.right
    for place in (0, -1):
        ahead, aside = _obliqueness(left, right, place)
        if abs(ahead) > _OBLIQUE * abs(aside):
            shorter_left = (ahead > 0.0) == (place == -1)
            left, right = (_led_on(left, right, place), right) if shorter_left else (left, _led_on(right, left, place))
    return lanelet if left is lanelet.left and right is lanelet.right else replace(lanelet, left=left, right=right)


def _obliqueness(left: Points, right: Points, place: int) -> tuple[float, float]:
    """How far the right bound begins or ends ahead of the left one, and beside it, m."""
    step = sum(line[place] - line[1 if place == 0 else -2] for line in (left, right)) * (1 if place == -1 else -1)
    way = step / np.hypot(*step)
    dx, dy = right[place] - left[place]
    return float(dx * way[0] + dy * way[1]), float(dy * way[0] - dx * way[1])


def _led_on(line: Points, other: Points, place: int) -> Points:
    return np.concatenate([line, other[-1:]] if place == -1 else [other[:1], line])
