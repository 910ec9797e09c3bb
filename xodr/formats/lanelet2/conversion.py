"""Conversion of Lanelet2 maps to OpenDRIVE: roads, junctions, traffic lights, crosswalks; distance
of lanes from lanelets."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import accumulate, chain
from os import PathLike
from pathlib import Path
from typing import NamedTuple

import numpy as np

from schemas.common.errors import UsageError
from xodr.builders.elements import (
    Geo,
    LaneDesign,
    PlanPose,
    RoadDesign,
    RoadMap,
    SectionDesign,
    traffic_light,
)
from xodr.formats.lanelet2.borders import completed
from xodr.formats.lanelet2.graph import Graph, Layout
from xodr.formats.lanelet2.junctions import junction_ids, junctions, layout
from xodr.formats.lanelet2.lanelet import Lanelet, Points, across, lengths, places, points_at
from xodr.formats.lanelet2.reader import Crosswalk, read_lanelets
from xodr.formats.lanelet2.shapes import BORDER_TOLERANCE, Borders, RoadShape, mouths, shape
from xodr.graph.network import RoadNetwork
from xodr.model import Controller, OutlineCorner, RoadLink, RoadObject, Signal
from xodr.model.geometry import Cubic
from xodr.model.road import Road
from xodr.reader import load

# road maps of lanelets --------------------------------------------------------------------------


_SAME = 1e-9
"""Difference of coefficients of equal pieces"""
_BESIDE = 1.0
"""Distance (m) of a traffic light from the road's right edge."""


def signals(graph: Graph, plan: Layout, shapes: list[RoadShape]) -> dict[int, tuple[Signal, ...]]:
    """The lights at the end of each bundle that has some: one for all neighbouring lanes that it
    holds."""
    by_id: dict[int, tuple[Signal, ...]] = {}
    count = 0
    for number, bundle in enumerate(plan.bundles):
        here = []
        for light, lanes in _held(graph, bundle.last):
            count += 1
            edge = shapes[number].end[-1]
            held = (-lanes[-1] - 1, -lanes[0] - 1)
            here.append(
                traffic_light(
                    count, str(number + 1), shapes[number].length, edge - _BESIDE, light, held
                )
            )
        if here:
            by_id[number] = tuple(here)
    return by_id


def _held(graph: Graph, names: tuple[str, ...]) -> list[tuple[str, list[int]]]:
    """Each light with the lanes that it holds; a light for lanes that are apart comes once for each
    group of them."""
    runs: dict[str, list[list[int]]] = defaultdict(list)
    for lane, name in enumerate(names):
        for light in graph.lanelets[name].lights:
            # OpenDRIVE's validity is a span of lanes: a light for lanes apart needs one for each.
            if runs[light] and runs[light][-1][-1] == lane - 1:
                runs[light][-1].append(lane)
            else:
                runs[light].append([lane])
    return [(light, run) for light, groups in runs.items() for run in groups]


def controllers(lights: dict[int, tuple[Signal, ...]]) -> tuple[Controller, ...]:
    """One controller for each light, which may stand at the ends of several roads."""
    groups: dict[str, list[str]] = defaultdict(list)
    for here in lights.values():
        for signal in here:
            groups[signal.name].append(signal.id)
    return tuple(
        Controller(str(place), name, None, tuple(ids))
        for place, (name, ids) in enumerate(groups.items(), 1)
    )


class Built(NamedTuple):
    """A road map made of lanelets.

    lanelets: road id and lane id of each lanelet. Of a lanelet that was split, that is its first
        part; further parts have its id followed by "/2", "/3". parts: the lanelets, so cut. notes:
        what could not be kept as it was, one sentence each.
    """

    map: RoadMap
    lanelets: dict[str, tuple[str, int]]
    parts: list[Lanelet]
    notes: list[str]


def build(
    lanelets: Sequence[Lanelet],
    name: str,
    geo: Geo | None = None,
    priorities: Sequence[tuple[str, str]] = (),
    tolerance: float = BORDER_TOLERANCE,
) -> Built:
    """The road map of some lanelets, in the same coordinates.

    Every lane connection of the lanelets is one of the map. All lanes are right-hand lanes, -1 the
    leftmost; roads run in the direction of travel, and those of opposite directions are apart.

    Args:
        lanelets: see `Lanelet`.
        name: of the map.
        geo: where it is on Earth.
        priorities: pairs of lanelets of which the first has the right of way over the second: those
            inside a junction, or those that lead into it.
        tolerance: largest distance (m) of borders from the bounds of lanelets, but for their ends.

    Raises:
        UsageError: an id is used twice, or a lanelet refers to one that there is not.
    """
    graph, plan = layout(Graph(lanelets))
    borders = Borders(graph, plan)
    ends = mouths(borders)
    shapes = []
    for number, bundle in enumerate(plan.bundles):
        start, end = ends[number, False], ends[number, True]
        try:
            shapes.append(shape(borders.extended(number), start, end, tolerance))
        except ValueError as error:  # scipy finds no curve: the ends lie on each other
            names = " ".join(name for lane in bundle.lanes for name in lane)
            raise UsageError(
                f"no road can be made of the lanes {names}, whose ends lie on each other ({error})"
            ) from None
    return _Builder(graph, plan, shapes).build(name, geo, priorities)


class _Builder:
    def __init__(self, graph: Graph, plan: Layout, shapes: list[RoadShape]) -> None:
        self.graph, self.plan, self.shapes = graph, plan, shapes
        self.junctions = junction_ids(graph, plan)
        self.signals = signals(graph, plan, shapes)

    def build(self, name: str, geo: Geo | None, priorities: Sequence[tuple[str, str]]) -> Built:
        """The map, and where each lanelet is in it; arguments as of the function `build`."""
        plan = self.plan
        roads = tuple(self._road(number) for number in range(len(plan.bundles)))
        ways = junctions(plan, self.junctions, priorities)
        lights = controllers(self.signals)
        where = {name: (str(number + 1), -lane - 1) for name, (number, lane) in plan.places.items()}
        return Built(
            RoadMap(name, roads, ways, lights, geo=geo),
            where,
            list(self.graph.lanelets.values()),
            self.graph.notes,
        )

    # roads ----------------------------------------------------------------------------------

    def _road(self, number: int) -> RoadDesign:
        bundle, form = self.plan.bundles[number], self.shapes[number]
        first = [self.graph.lanelets[name] for name in bundle.first]
        # The road's limit is the highest of its lanes; others have their own.
        fastest = max(lanelet.speed_limit for lanelet in first)
        lanes = {-lane - 1: self._lane(number, lane, fastest) for lane in range(len(first))}
        return RoadDesign(
            str(number + 1), " ".join(name for lane in bundle.lanes for name in lane), form.start,
            form.plan,
            (SectionDesign(0.0, lanes, first[0].left_mark),), first[0].road_type, fastest,
            junction=str(self._junction(number, False) if bundle.inside else -1),
            predecessor=self._link(number, False), successor=self._link(number, True),
            signals=self.signals.get(number, ()), offset=_cubics(form, form.t[:, :, 0]),
        )  # fmt: skip

    def _lane(self, number: int, lane: int, fastest: float) -> LaneDesign:
        lanelet, form = (
            self.graph.lanelets[self.plan.bundles[number].lanes[lane][0]],
            self.shapes[number],
        )
        return LaneDesign(
            lanelet.type, _cubics(form, form.t[:, :, lane] - form.t[:, :, lane + 1]),
            lanelet.right_mark,
            self._linked(number, lane, False), self._linked(number, lane, True),
            lanelet.speed_limit if lanelet.speed_limit < fastest else None,
        )  # fmt: skip

    def _linked(self, number: int, lane: int, at_end: bool) -> int | None:
        """The lane that continues a lane, where its road is linked to another road."""
        joint, link = self.plan.joint(number, at_end), self._link(number, at_end)
        # At a junction lanes are linked by its connections.
        if joint is None or link is None or link.element_type != "road":
            return None
        # Pairs lead onwards; at the start of a road its own lane is the second.
        pairs = joint.lanes if at_end else [(after, before) for before, after in joint.lanes]
        return next((-other[1] - 1 for one, other in pairs if one == (number, lane)), None)

    def _link(self, number: int, at_end: bool) -> RoadLink | None:
        joint, junction = self.plan.joint(number, at_end), self._junction(number, at_end)
        if joint is None:
            return None
        if junction == -1 or self.plan.bundles[number].inside:
            # Plain joints and connecting roads have one road there.
            other = (joint.beginning if at_end else joint.ending)[0]
            return RoadLink("road", str(other + 1), "start" if at_end else "end")
        return RoadLink("junction", str(junction), None)

    def _junction(self, number: int, at_end: bool) -> int:
        """The junction at one end of a road, -1 where there is none."""
        index = self.plan.index(number, at_end)
        return -1 if index is None else self.junctions[index]


def _cubics(form: RoadShape, coefficients: np.ndarray) -> tuple[Cubic, ...]:
    """Pieces of a profile; one that goes on as the piece before it does is left out."""
    kept: list[Cubic] = []
    for s, row in zip(form.s, coefficients, strict=True):
        piece = Cubic(float(s), *map(float, row))
        if not kept or not all(
            abs(before - after) <= _SAME
            for before, after in zip(_continued(kept[-1], piece.start), piece[1:], strict=True)
        ):
            kept.append(piece)
    return tuple(kept)


def _continued(piece: Cubic, start: float) -> tuple[float, float, float, float]:
    """The coefficients of a piece from another start on."""
    _, a, b, c, d = piece
    ds = start - piece.start
    return (
        a + ds * (b + ds * (c + ds * d)),
        b + ds * (2.0 * c + 3.0 * ds * d),
        c + 3.0 * ds * d,
        d,
    )


def with_crosswalks(
    roads: Sequence[RoadDesign], crosswalks: Sequence[Crosswalk]
) -> tuple[RoadDesign, ...]:
    """Roads with crosswalks, each on the road with the nearest piece.

    Only the place of a crosswalk matters, not its road.
    """
    poses = [(number, s, pose) for number, road in enumerate(roads) for s, pose in _poses(road)]
    places = np.array([(pose.x, pose.y) for _, _, pose in poses])
    found: dict[int, list[RoadObject]] = defaultdict(list)
    for identity, area in enumerate(crosswalks, 1):
        centre = area.outline.mean(axis=0)
        number, s, pose = poses[int(np.argmin(np.hypot(*(places - centre).T)))]
        outline = tuple(_corner(pose, point) for point in area.outline.tolist())
        crosswalk = RoadObject(
            str(identity), roads[number].id, s, 0.0, area.id, "crosswalk", outlines=(outline,)
        )
        found[number].append(crosswalk)
    return tuple(replace(road, objects=tuple(found[number])) for number, road in enumerate(roads))


def _poses(road: RoadDesign) -> Iterator[tuple[float, PlanPose]]:
    """Yield s and pose at the ends of the pieces of the reference line."""
    return zip(
        accumulate((piece.length for piece in road.plan), initial=0.0), road.poses, strict=True
    )


def _corner(pose: PlanPose, point: Sequence[float]) -> OutlineCorner:
    return OutlineCorner(*pose.local(point), 0.0, 0.0, on_road=False)


# files ------------------------------------------------------------------------------------------


STEP = 0.5
"""Distance between the places that are compared, m."""


def deviation(
    lanelets: Sequence[Lanelet], where: Mapping[str, tuple[str, int]], network: RoadNetwork
) -> dict[str, float]:
    """Largest distance [m] of each lanelet's bounds from the borders of its lane, and of the lane's
    centre from theirs.

    Bounds may also lie on lanes that lead on from it or to it: lanes begin a bit earlier or later
    than their lanelets. `where` gives the road and lane of each lanelet.
    """
    lines = {lane: _lines(network.roads[lane[0]], lane[1]) for lane in set(where.values())}
    deviations = {}
    for lanelet in lanelets:
        own = where[lanelet.id]
        # Lanes may begin earlier or later than their lanelets, which then lie on those around.
        links = chain(network.links(*own, True), network.links(*own, False))
        around = [
            lines[lane]
            for lane in (own, *((link.road_id, link.lane_id) for link in links))
            if lane in lines
        ]
        borders = (
            _farthest(lanelet.left, [lane.left for lane in around]),
            _farthest(lanelet.right, [lane.right for lane in around]),
        )
        deviations[lanelet.id] = max(*borders, _off_centre(lanelet, lines[own]))
    return deviations


class _Lines(NamedTuple):
    """Borders and centre of a lane, as seen in the direction of +s."""

    left: Points
    right: Points
    centre: Points


def _lines(road: Road, lane_id: int) -> _Lines:
    grid = np.linspace(0.0, road.length, places(road.length, STEP)).tolist()
    lane = road.lane(0.0, lane_id)
    return _Lines(
        *(
            np.array([road.pose(s, at(s))[:2] for s in grid])
            for at in (lane.inner, lane.outer, lane.center)
        )
    )


def _farthest(bound: Points, borders: list[Points]) -> float:
    from shapely import LineString, MultiLineString, distance, points

    # Its own points as well: between even places a corner could lie far off unseen.
    total = lengths(bound)[-1]
    dense = np.concatenate([bound, points_at(bound, np.linspace(0.0, total, places(total, STEP)))])
    return float(
        distance(points(dense), MultiLineString([LineString(border) for border in borders])).max()
    )


def _off_centre(lanelet: Lanelet, lane: _Lines) -> float:
    """Return the distance of a lane's centre from the middle between its bounds,
    across the road.
    """
    sideways = lane.left - lane.right
    onward = np.column_stack([sideways[:, 1], -sideways[:, 0]])
    # Without width there is no direction across.
    wide = np.hypot(*sideways.T) > STEP
    left, right = (
        across(lane.centre[wide], onward[wide], bound) for bound in (lanelet.left, lanelet.right)
    )
    return float(np.nanmax(np.abs(left + right) / 2, initial=0.0))


_ASTRAY = 0.5
"""Lanes farther away than this from their lanelets are named, m."""


class Conversion(NamedTuple):
    """Result of converting a Lanelet2 map.

    Attributes:
        path: the OpenDRIVE file.
        lanelets: road id and lane id of each lanelet that became a lane.
        notes: what was assumed, changed or left out, one sentence each.
        deviation: largest distance between a lanelet's borders or centre line and those of its
            lane, m.
    """

    path: Path
    lanelets: dict[str, tuple[str, int]]
    notes: list[str]
    deviation: float


def convert(
    osm: str | PathLike[str], origin: tuple[float, float] | None, target: str | PathLike[str]
) -> Conversion:
    """Write a Lanelet2 map as OpenDRIVE, in the coordinates of the tracks that were recorded on it.

    Args:
        osm: the map.
        origin: latitude and longitude of the origin of the coordinates, degrees; None for that of
            the map's own local coordinates, or of INTERACTION (0, 0) where it has none.
        target: the OpenDRIVE file to write.

    Raises:
        InvalidFile: the map is malformed; names file, line and element.
        UsageError: the origin is no place on Earth.
    """
    source = Path(osm)
    found = read_lanelets(source, origin)
    lanelets, added = completed(found.lanes)
    made = write(lanelets, source.stem, target, found.crosswalks, found.geo, found.priorities)
    signs = [f"left out, signs: {' '.join(sign.id for sign in found.signs)}"] if found.signs else []
    return made._replace(notes=[*found.notes, *signs, *added, *made.notes])


def write(
    lanelets: Sequence[Lanelet],
    name: str,
    target: str | PathLike[str],
    crosswalks: Sequence[Crosswalk] = (),
    geo: Geo | None = None,
    priorities: Sequence[tuple[str, str]] = (),
) -> Conversion:
    """Write lanelets of any origin as OpenDRIVE, in their coordinates.

    Args:
        lanelets, name, geo, priorities: as of `build`.
        target: the OpenDRIVE file to write.
        crosswalks: outlines on the road.

    Raises:
        UsageError: an id is used twice, or a lanelet refers to an unknown one.
    """
    built = build(lanelets, name, geo, priorities)
    written = replace(built.map, roads=with_crosswalks(built.map.roads, crosswalks)).write(target)
    away = deviation(built.parts, built.lanelets, load(written))
    astray = [f"{name} ({distance:.1f} m)" for name, distance in away.items() if distance > _ASTRAY]
    notes = (
        [f"lanes that are not everywhere where their lanelets are: {', '.join(astray)}"]
        if astray
        else []
    )
    return Conversion(written, built.lanelets, [*built.notes, *notes], max(away.values()))
