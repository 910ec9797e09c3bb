"""Roads as they are drawn: the surfaces of lanes and the marks between them, from above, in the neighbourhood of a run."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from xodr.lookup.sampling import lane_borders, sample, stations

if TYPE_CHECKING:
    from xodr.model import LaneSection, RoadMark
    from xodr.network import RoadNetwork
    from xodr.road import Road

Line = NDArray[np.float64]
"""A polyline: rows x, y, m."""
_WIDTH = 0.12
"""Width of marks whose file does not give one, m"""
_APART = 2.0
"""Distance between the middles of two marks side by side, in widths"""
_TOLERANCE = 0.02
"""How far a simplified line may be from the true one, m"""
_PAIRS = {"solid solid": "ss", "solid broken": "sb", "broken solid": "bs", "broken broken": "bb"}
_DASHES = {"broken": "broken", "botts dots": "dots"}
_UNMARKED = "unmarked"

SURFACES = {
    **dict.fromkeys(("shoulder", "stop", "border", "parking", "restricted"), "shoulder"),
    **dict.fromkeys(("sidewalk", "walking", "curb"), "walk"),
    **dict.fromkeys(("biking",), "bike"),
    **dict.fromkeys(("none", "median", "tram", "rail"), "verge"),
}
"""How lanes look, by their type; the others are carriageway."""


class Area(NamedTuple):
    """A rectangle of the world: west, south, east, north, m."""

    west: float
    south: float
    east: float
    north: float

    def wider(self, margin: float) -> Area:
        """The same with a margin (m) all around."""
        return Area(self.west - margin, self.south - margin, self.east + margin, self.north + margin)

    def meets(self, other: Area) -> bool:
        """Whether two rectangles have something in common."""
        return self.west <= other.east and other.west <= self.east and self.south <= other.north and other.south <= self.north


class Marks(NamedTuple):
    """How marks look: `pattern` solid, broken, dots or unmarked (a border without marks), colour, width in m."""

    pattern: str
    colour: str
    width: float


def surfaces(network: RoadNetwork, area: Area) -> dict[str, list[Line]]:
    """Outlines of lanes within an area, by how they look."""
    found: dict[str, list[Line]] = defaultdict(list)
    for road in network.roads.values():
        types = [section.lanes[lane].type for section in road.sections for lane in (*section.left, *section.right)]
        for kind, (_, inner, outer) in zip(types, lane_borders(road), strict=True):
            found[SURFACES.get(kind, "road")].append(np.concatenate([inner[:, :2], outer[::-1, :2]]))
    return {look: _clipped(shapely.polygons, rings, area) for look, rings in sorted(found.items())}


def marks(network: RoadNetwork, area: Area) -> dict[Marks, list[Line]]:
    """Lines of marks within an area, by how they look."""
    found: dict[Marks, list[Line]] = defaultdict(list)
    for road in network.roads.values():
        everywhere = stations(road)
        for section in road.sections:
            for lane_id in sorted(section.lanes):
                for look, line in _marks_of(road, section, lane_id, everywhere):
                    found[look].append(line)
    return {look: _clipped(shapely.linestrings, lines, area) for look, lines in sorted(found.items())}


def _marks_of(road: Road, section: LaneSection, lane_id: int, everywhere: Line) -> Iterator[tuple[Marks, Line]]:
    declared = section.lanes[lane_id].marks
    if not declared and road.junction_id is None:
        yield Marks(_UNMARKED, "standard", _WIDTH), _along(road, lane_id, section.s, section.end, everywhere, 0.0)
    for mark, end in zip(declared, [*(mark.s for mark in declared), section.end][1:], strict=True):
        start, end = max(mark.s, section.s), min(end, section.end)
        if start < end and mark.type != "none":
            for look, aside in _strokes(mark):
                outwards = aside if lane_id > 0 else -aside
                yield look, _along(road, lane_id, start, end, everywhere, outwards)


def _strokes(mark: RoadMark) -> Iterator[tuple[Marks, float]]:
    """The single lines of a mark, and how far outside (left, on the centre line: right) of the border each is, m."""
    width = mark.width or _WIDTH
    if mark.type in _PAIRS:
        for letter, aside in zip(_PAIRS[mark.type], (-0.5, 0.5), strict=True):
            yield Marks("solid" if letter == "s" else "broken", mark.color, width), aside * _APART * width
    else:
        yield Marks(_DASHES.get(mark.type, "solid"), mark.color, width), 0.0


def _along(road: Road, lane_id: int, start: float, end: float, everywhere: Line, aside: float) -> Line:
    """The outer border of a lane from s to s, moved by `aside` (m) to the left."""
    inside = [start, *everywhere[(everywhere > start) & (everywhere < end)].tolist(), end]
    outer = road.section(start).lanes[lane_id].outer
    return sample(road, inside, [outer(s) + aside for s in inside])[:, :2]


def _clipped(build: Callable[[Line], Any], lines: Iterable[Line], area: Area) -> list[Line]:
    """What of rings or lines lies within an area, with no more points than needed."""
    kept = []
    for line in lines:
        west, south = line.min(axis=0)
        east, north = line.max(axis=0)
        if west <= area.east and east >= area.west and south <= area.north and north >= area.south:
            whole = shapely.simplify(build(line), _TOLERANCE)
            for part in shapely.get_parts(shapely.clip_by_rect(whole, *area)):
                ring = shapely.get_exterior_ring(part) or part
                kept.append(shapely.get_coordinates(ring))
    return [line for line in kept if len(line) > 1]
