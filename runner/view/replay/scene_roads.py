"""Roads in replays: lane surfaces and marks near a run, outlines of objects, signals with their
states over time.

Heights belong to all of them: pages show roads from above and in three dimensions."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from xodr.lookup.arrays import sample, stations, values
from xodr.model import NO_WIDTH, PERMANENT, TEMPORARY, RoadMark

if TYPE_CHECKING:
    from xodr.graph.network import RoadNetwork
    from xodr.model import Junction, LaneSection, OutlineCorner, RoadObject, Structure
    from xodr.model.geometry import Profile
    from xodr.model.road import Road

Line = NDArray[np.float64]
"""A polyline or a ring: rows x, y, z, m."""
_WIDTH = 0.12
"""Width of marks whose file does not give one, m"""
_APART = 2.0
"""Distance between the middles of two marks side by side, in widths"""
_TOLERANCE = 0.02
"""Tolerance (m) of simplified lines, sideways and in height"""
_SAGITTA = 0.02
"""Greatest distance (m) of a curved edge from the chord between two stations"""
_PAIRS = {"solid solid": "ss", "solid broken": "sb", "broken solid": "bs", "broken broken": "bb"}
_PATTERNS = {"broken": "broken", "botts dots": "dots", "none": "unmarked"}

SURFACES = {
    **dict.fromkeys(("shoulder", "stop", "border", "parking", "restricted"), "shoulder"),
    **dict.fromkeys(("sidewalk", "walking", "curb"), "walk"),
    **dict.fromkeys(("biking",), "bike"),
    **dict.fromkeys(("none", "median", "tram", "rail"), "verge"),
}
"""Appearance of lanes by type; the others are carriageway."""


class Area(NamedTuple):
    """A rectangle of the world: west, south, east, north, m."""

    west: float
    south: float
    east: float
    north: float

    def wider(self, margin: float) -> Area:
        """Rectangle with a margin (m) all around."""
        return Area(
            self.west - margin, self.south - margin, self.east + margin, self.north + margin
        )

    def meets(self, other: Area) -> bool:
        """Whether two rectangles have something in common."""
        return (
            self.west <= other.east
            and other.west <= self.east
            and self.south <= other.north
            and other.south <= self.north
        )


class Marks(NamedTuple):
    """Appearance of marks: `pattern` solid, broken, dots or unmarked (a border without marks),
    colour, width in m."""

    pattern: str
    colour: str
    width: float


def surfaces(network: RoadNetwork, area: Area) -> dict[str, list[Line]]:
    """Outlines of the permanent lanes within an area, by appearance.

    The first half of a ring is one border of a lane, the second half the other one backwards, with
    as many points: the n-th
    from the beginning and the n-th from the end lie at the same s.
    """
    found: dict[str, list[NDArray[np.float64]]] = defaultdict(list)
    for road in network.on(PERMANENT).roads.values():
        everywhere = _stations(road)
        for section in road.sections:
            along = _within(everywhere, section.s, section.end)
            for lane_id in (*section.left, *section.right):
                lane = section.lanes[lane_id]
                borders = np.stack(
                    [_border(road, along, lane.inner), _border(road, along, lane.outer)]
                )
                found[SURFACES.get(lane.type, "road")].append(borders)
    return {
        look: [
            np.concatenate([inner, outer[::-1]])
            for inner, outer in _simplified(_clipped(strips, area))
        ]
        for look, strips in sorted(found.items())
    }


_EDGE = Marks("unmarked", "standard", _WIDTH)
"""Appearance of the boundaries of junctions"""


def marks(network: RoadNetwork, area: Area) -> dict[Marks, list[Line]]:
    """Lines of marks within an area, by appearance; marks of temporary lanes last, above the
    permanent ones."""
    layers: dict[str, dict[Marks, list[Line]]] = {
        PERMANENT: defaultdict(list),
        TEMPORARY: defaultdict(list),
    }
    for layer, found in layers.items():
        for road in network.on(layer).roads.values():
            everywhere = _stations(road)
            for section in road.sections:
                for lane_id in sorted(section.lanes):
                    if section.lanes[lane_id].layer == layer:
                        for look, line in _marks_of(road, section, lane_id, everywhere):
                            found[look].append(line)
    for junction in network.junctions.values():
        layers[PERMANENT][_EDGE].extend(_boundary(network, junction))
    usual, temporary = layers.values()
    looks = [*sorted(usual.keys() - temporary.keys()), *sorted(temporary)]
    return {
        look: [
            line
            for (line,) in _simplified(
                _clipped([line[None] for line in (*usual[look], *temporary[look])], area)
            )
        ]
        for look in looks
    }


def _marks_of(
    road: Road, section: LaneSection, lane_id: int, everywhere: Line
) -> Iterator[tuple[Marks, Line]]:
    lane = section.lanes[lane_id]
    declared = lane.marks
    if lane.layer == TEMPORARY:
        # Yellow where the file has no other colour: nothing else tells them from the marks below.
        declared = tuple(
            mark._replace(color="yellow") if mark.color == "standard" else mark for mark in declared
        )
    elif road.junction_id is None:
        # Borders without a mark get a faint line: lanes are told apart where files have no marks.
        first = declared[0].s if declared else section.end
        declared = (
            (RoadMark(section.s, "none", "standard", None), *declared)
            if first > section.s
            else declared
        )
    for mark, end in zip(declared, [*(mark.s for mark in declared), section.end][1:], strict=True):
        start, end = max(mark.s, section.s), min(end, section.end)
        if start < end and (
            mark.type != "none" or (road.junction_id is None and lane.layer == PERMANENT)
        ):
            for look, aside in _strokes(mark):
                outwards = aside if lane_id > 0 else -aside
                yield look, _along(road, lane_id, start, end, everywhere, outwards)


def _boundary(network: RoadNetwork, junction: Junction) -> list[Line]:
    """The boundary of a junction as one closed line, if the file gives one."""
    points: list[Line] = []
    # From a segment along a road on: joints are turned to fit the end of the one before.
    along = next(
        (number for number, segment in enumerate(junction.boundary) if not segment.joint), 0
    )
    for road_id, start, end, lanes, joint in (
        *junction.boundary[along:],
        *junction.boundary[:along],
    ):
        road = network.on(PERMANENT).roads[road_id]
        start, end = min(start, road.length), min(end, road.length)
        if joint:
            found = road.section(start).lanes
            first, last = (
                lane if lane in found else usual
                for lane, usual in zip(lanes, (min(found), max(found)), strict=True)
            )
            piece = np.concatenate(
                [_border(road, np.array([start]), found[lane].outer) for lane in (first, last)]
            )
        else:
            piece = _outer_border(road, lanes[0] or 0, start, end)
        # Joints have no direction of their own: the nearer end comes first.
        if (
            joint
            and points
            and math.dist(points[-1][-1], piece[0]) > math.dist(points[-1][-1], piece[-1])
        ):
            piece = piece[::-1]
        points.append(piece)
    return [np.concatenate([*points, points[0][:1]])] if points else []


def _outer_border(road: Road, lane_id: int, start: float, end: float) -> Line:
    """Return the outer border of a lane from s to s, in that order, over lane sections in which the
    lane exists."""
    low, high = sorted((start, end))
    found = []
    for section in road.sections:
        first, last = max(low, section.s), min(high, section.end)
        if first < last and lane_id in section.lanes:
            found.append(
                _border(road, _within(_stations(road), first, last), section.lanes[lane_id].outer)
            )
    line = np.concatenate(found) if found else np.zeros((0, 3))
    return line if start <= end else line[::-1]


def _strokes(mark: RoadMark) -> Iterator[tuple[Marks, float]]:
    """The single lines of a mark, and how far outside (left, on the centre line: right) of the
    border each is, m."""
    width = mark.width or _WIDTH
    if mark.type in _PAIRS:
        for letter, aside in zip(_PAIRS[mark.type], (-0.5, 0.5), strict=True):
            yield (
                Marks("solid" if letter == "s" else "broken", mark.color, width),
                aside * _APART * width,
            )
    else:
        yield Marks(_PATTERNS.get(mark.type, "solid"), mark.color, width), 0.0


def _along(
    road: Road,
    lane_id: int,
    start: float,
    end: float,
    everywhere: NDArray[np.float64],
    aside: float,
) -> Line:
    """The outer border of a lane from s to s, moved by `aside` (m) to the left."""
    return _border(
        road, _within(everywhere, start, end), road.section(start).lanes[lane_id].outer, aside
    )


def _within(everywhere: NDArray[np.float64], start: float, end: float) -> NDArray[np.float64]:
    return np.concatenate([[start], everywhere[(everywhere > start) & (everywhere < end)], [end]])


def _stations(road: Road) -> NDArray[np.float64]:
    """Stations (s) of borders, as close together as the sharpest edge of the road needs."""
    usual = stations(road)
    # The outer edge of a bend is the most curved: borders are sampled for it.
    reach = max(map(abs, road.edges(0.5 * road.length)))
    found = [usual[:1]]
    for low, high in pairwise(usual.tolist()):
        # Curvature may jump at `high`: the value just before it belongs to this piece.
        bend = max(
            abs(road.curvature(s)) for s in (low, 0.5 * (low + high), math.nextafter(high, low))
        )
        # A chord c of curvature κ is off by c²κ/8; at the edge chords are longer by 1 + κ · reach.
        sagitta = (high - low) ** 2 * bend * (1.0 + bend * reach) / 8.0
        found.append(
            np.linspace(low, high, max(1, math.ceil(math.sqrt(sagitta / _SAGITTA))) + 1)[1:]
        )
    return np.concatenate(found)


def _border(road: Road, along: NDArray[np.float64], border: Profile, aside: float = 0.0) -> Line:
    """World coordinates along a border that is moved by `aside` (m) to the left."""
    t = values(border, along) + aside
    if road.surface is not None or any(
        lane.level for section in road.sections for lane in section.lanes.values()
    ):
        return sample(road, along, t)
    # Without a surface or level lanes a cross-section is straight: only its roll counts.
    roll = values(road.superelevation, along)
    x, y, h = np.array([road.line.at(s) for s in along.tolist()]).T
    level = t * np.cos(roll)
    return np.column_stack(
        [
            x - level * np.sin(h),
            y + level * np.cos(h),
            values(road.elevation, along) + t * np.sin(roll),
        ]
    )


def _clipped(strips: Iterable[NDArray[np.float64]], area: Area) -> list[NDArray[np.float64]]:
    """The pieces of strips (sides, stations, 3) that have something in an area, without stretches
    of no width."""
    kept = []
    for strip in strips:
        low = np.minimum(strip[:, :-1], strip[:, 1:]).min(axis=0)
        high = np.maximum(strip[:, :-1], strip[:, 1:]).max(axis=0)
        there = (
            (low[:, 0] < area.east)
            & (high[:, 0] > area.west)
            & (low[:, 1] < area.north)
            & (high[:, 1] > area.south)
        )
        if len(strip) > 1:
            # Lanes that open or close have stretches without width, which would be slivers.
            wide = np.abs(strip[0] - strip[-1]).max(axis=1) > NO_WIDTH
            there &= wide[:-1] | wide[1:]
        changes = np.flatnonzero(np.diff(np.concatenate([[0], there.astype(np.int8), [0]])))
        kept += [strip[:, begin : end + 1] for begin, end in changes.reshape(-1, 2).tolist()]
    return kept


def _simplified(strips: Sequence[NDArray[np.float64]]) -> list[NDArray[np.float64]]:
    """Strips with no more stations than all of their sides need, in plan and in height."""
    if not strips:
        return []
    lengths = np.array([strip.shape[1] for strip in strips])
    first, owner = np.cumsum(lengths) - lengths, np.repeat(np.arange(len(strips)), lengths)
    station = np.arange(len(owner)) - first[owner]
    kept = (station == 0) | (station == lengths[owner] - 1)
    for side in range(len(strips[0])):
        points = np.concatenate([strip[side] for strip in strips])
        lines = [points[:, :2]]
        # Heights are simplified over the way driven, as a plan of their own.
        if np.ptp(points[:, 2]) > _TOLERANCE:
            steps = np.hypot(*np.diff(points[:, :2], axis=0, prepend=points[:1, :2]).T)
            lines.append(np.column_stack([np.cumsum(steps), points[:, 2]]))
        for flat in lines:
            # The station rides along as z: what `simplify` keeps is told by it.
            shapes = shapely.linestrings(np.column_stack([flat, station]), indices=owner)
            needed, index = shapely.get_coordinates(
                shapely.simplify(shapes, _TOLERANCE, preserve_topology=False),
                include_z=True,
                return_index=True,
            )
            kept[first[index] + needed[:, 2].astype(np.int64)] = True
    pieces = np.split(kept, first[1:])
    return [strip[:, mask] for strip, mask in zip(strips, pieces, strict=True)]


class ObjectBlock(NamedTuple):
    """An object: its outline on the ground, rows x, y, z (m), and its height (m)."""

    ring: Line
    height: float


_POINT = 0.15
"""Radius of what has no size, m"""
_CORNERS = 12
"""Corners of what is round"""


LOOKS = {
    **dict.fromkeys(("crosswalk", "building", "pole", "barrier"), ""),
    **dict.fromkeys(("tree", "vegetation"), "tree"),
    **dict.fromkeys(("parkingSpace", "roadMark", "patch", "roadSurface", "trafficIsland"), "flat"),
    **dict.fromkeys(("streetLamp", "wind"), "pole"),
    **dict.fromkeys(("railing", "soundBarrier", "guardRail", "wall", "fence"), "barrier"),
}
"""Appearance of objects by type, empty for the type's own name; the others are plain blocks."""
_HEIGHTS = {
    "crosswalk": 0.0,
    "flat": 0.0,
    "tree": 5.0,
    "building": 8.0,
    "pole": 4.0,
    "barrier": 0.8,
}
"""Heights (m) of objects whose file gives none"""
_LOW = 0.3
"""Height (m) of all others"""
_PARAPET, _WALL = 1.0, 4.7
"""Heights (m) of the parapets of bridges and the walls of tunnels"""
_THICK = 0.3
"""Thickness of both, m"""
_PIECE = 12
"""Intervals between stations that one block of them covers"""


def objects(network: RoadNetwork, area: Area) -> dict[str, list[ObjectBlock]]:
    """The objects within an area, by how they look."""
    found: dict[str, list[ObjectBlock]] = defaultdict(list)
    for road in network.roads.values():
        for thing in road.objects:
            look = LOOKS.get(thing.type, "object") or thing.type
            for block in _blocks(road, thing, _HEIGHTS.get(look, _LOW)):
                if _touches(block.ring, area):
                    found[look].append(block)
        for structure in road.structures:
            for look, block in _built(road, structure):
                if _touches(block.ring, area):
                    found[look].append(block)
    for junction in network.junctions.values():
        for path in junction.cross_paths:
            found["crosswalk"] += [
                ObjectBlock(ring, 0.0)
                for ring in _lanes(network.roads[path.road_id])
                if _touches(ring, area)
            ]
    return dict(sorted((look, blocks) for look, blocks in found.items() if blocks))


def _lanes(road: Road) -> Iterator[Line]:
    """Outlines of the lanes of a road."""
    for section in road.sections:
        along = _within(_stations(road), section.s, section.end)
        for lane_id in (*section.left, *section.right):
            lane = section.lanes[lane_id]
            (strip,) = _simplified(
                [np.stack([_border(road, along, lane.inner), _border(road, along, lane.outer)])]
            )
            yield np.concatenate([strip[0], strip[1][::-1]])


def _built(road: Road, structure: Structure) -> Iterator[tuple[str, ObjectBlock]]:
    """Parapets of a bridge; walls of a tunnel and its stretch, without a roof that would hide the
    traffic."""
    start, end = max(structure.s, 0.0), min(structure.s + structure.length, road.length)
    if start >= end:
        return
    along = _within(_stations(road), start, end)
    right, left = np.array([road.edges(s) for s in along.tolist()]).T
    edges = [sample(road, along, t) for t in (left + _THICK, left, right, right - _THICK)]
    (strip,) = _simplified([np.stack(edges)])
    tunnel = structure.kind == "tunnel"
    for first in range(0, strip.shape[1] - 1, _PIECE):
        outer, inner, other, last = strip[:, first : first + _PIECE + 1]
        for one, two in ((outer, inner), (other, last)):
            yield (
                "barrier",
                ObjectBlock(np.concatenate([one, two[::-1]]), _WALL if tunnel else _PARAPET),
            )
        if tunnel:
            yield "covered", ObjectBlock(np.concatenate([inner, other[::-1]]), 0.0)


def _touches(ring: Line, area: Area) -> bool:
    (west, south), (east, north) = ring[:, :2].min(axis=0), ring[:, :2].max(axis=0)
    return bool(
        west <= area.east and east >= area.west and south <= area.north and north >= area.south
    )


def _blocks(road: Road, thing: RoadObject, usual: float) -> list[ObjectBlock]:
    height = usual if thing.height is None or not usual else thing.height
    outlines = [outline for outline in thing.outlines if outline]
    if outlines:
        tops = [max(corner.height for corner in outline) if usual else 0.0 for outline in outlines]
        return [
            ObjectBlock(_outline(road, thing, outline), top or height)
            for outline, top in zip(outlines, tops, strict=True)
        ]
    if thing.length and thing.width:
        u, v = thing.length / 2, thing.width / 2
        points = np.array([(u, v, 0.0), (-u, v, 0.0), (-u, -v, 0.0), (u, -v, 0.0)])
    else:
        angles = np.linspace(0.0, math.tau, _CORNERS, endpoint=False)
        points = (thing.radius or _POINT) * np.column_stack(
            [np.cos(angles), np.sin(angles), np.zeros(_CORNERS)]
        )
    return [ObjectBlock(_placed(road, thing, points), height)]


def _outline(road: Road, thing: RoadObject, corners: tuple[OutlineCorner, ...]) -> Line:
    points = np.array([(corner.u, corner.v, corner.z) for corner in corners])
    if not corners[0].on_road:
        return _placed(road, thing, points)
    return sample(road, points[:, 0], points[:, 1]) + points * (0.0, 0.0, 1.0)


def _placed(road: Road, thing: RoadObject, points: Line) -> Line:
    """Points of an object's frame in the world."""
    pose = road.pose(thing.s, thing.t)
    h = pose.h + thing.heading + (math.pi if thing.orientation == "-" else 0.0)
    turned = points[:, :2] @ np.array([(math.cos(h), math.sin(h)), (-math.sin(h), math.cos(h))])
    placed: Line = np.column_stack([turned, points[:, 2]])
    return placed + np.array([pose.x, pose.y, pose.z + thing.z_offset])


def signals(network: RoadNetwork, area: Area) -> list[dict[str, Any]]:
    """Signals within an area: id, place of the foot (m), name, whether it changes; height above the
    foot (m), type, heading of the face (rad), and whether the back has one, too."""
    shown = []
    for signal in network.signals.values():
        x, y, z, h, *_ = network.road(signal.road_id).pose(signal.s, signal.t)
        if area.west <= x <= area.east and area.south <= y <= area.north:
            # A face looks against the traffic that it is for.
            seen_from = h + signal.h_offset + (0.0 if signal.orientation == "-" else math.pi)
            shown.append(
                {
                    "id": signal.id,
                    "x": x,
                    "y": y,
                    "name": signal.name or signal.type,
                    "dynamic": signal.dynamic,
                }
                | {
                    "z": z,
                    "up": signal.z_offset,
                    "type": signal.type,
                    "h": seen_from,
                    "both": signal.orientation == "none",
                }
            )
    return shown
