"""From lanelets to a road map."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from xodr.builders.elements import Cubic, Geo, Lane, Link, Road, RoadMap, Section
from xodr.lanelet2.bundles import Layout
from xodr.lanelet2.graph import Graph
from xodr.lanelet2.junctions import junction_ids, junctions
from xodr.lanelet2.lanelet import Lanelet
from xodr.lanelet2.lines.insides import layout
from xodr.lanelet2.lines.mouths import Borders, mouths
from xodr.lanelet2.lines.shapes import Shape, shape
from xodr.lanelet2.signals import controllers, signals


class Built(NamedTuple):
    """A road map made of lanelets.

    lanelets: road id and lane id of each lanelet. Of a lanelet that was split, that is its first part; further parts have
        its id followed by "/2", "/3". parts: the lanelets, so cut. notes: what could not be kept as it was, one
        sentence each.
    """

    map: RoadMap
    lanelets: dict[str, tuple[str, int]]
    parts: list[Lanelet]
    notes: list[str]


def build(lanelets: Sequence[Lanelet], name: str, geo: Geo | None = None, priorities: Sequence[tuple[str, str]] = ()) -> Built:
    """The road map of some lanelets, in the same coordinates.

    Every lane connection of the lanelets is one of the map. All lanes are right-hand lanes, -1 the leftmost; roads run in the
    direction of travel, and those of opposite directions are apart.

    Args:
        lanelets: see `Lanelet`.
        name: of the map.
        geo: where it is on Earth.
        priorities: pairs of lanelets of which the first has the right of way over the second: those inside a junction, or
            those that lead into it.

    Raises:
        UsageError: an id is used twice, or a lanelet refers to one that there is not.
    """
    graph, plan = layout(Graph(lanelets))
    borders = Borders(graph, plan)
    ends = mouths(borders)
    shapes = [shape(borders.extended(number), ends[number, False], ends[number, True]) for number in range(len(plan.bundles))]
    return _Builder(graph, plan, shapes).build(name, geo, priorities)


class _Builder:
    def __init__(self, graph: Graph, plan: Layout, shapes: list[Shape]) -> None:
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
        return Built(RoadMap(name, roads, ways, lights, geo=geo), where, list(self.graph.lanelets.values()), self.graph.notes)

    # roads ----------------------------------------------------------------------------------

    def _road(self, number: int) -> Road:
        bundle, form = self.plan.bundles[number], self.shapes[number]
        first = [self.graph.lanelets[name] for name in bundle.first]
        fastest = max(lanelet.speed_limit for lanelet in first)
        lanes = {-lane - 1: self._lane(number, lane, fastest) for lane in range(len(first))}
        return Road(
            number + 1, " ".join(name for lane in bundle.lanes for name in lane), form.start, form.plan,
            (Section(0.0, lanes, first[0].left_mark),), first[0].road_type, fastest,
            junction=self._junction(number, False) if bundle.inside else -1,
            predecessor=self._link(number, False), successor=self._link(number, True),
            signals=self.signals.get(number, ()), offset=_cubics(form, form.t[:, :, 0]),
        )  # fmt: skip

    def _lane(self, number: int, lane: int, fastest: float) -> Lane:
        lanelet, form = self.graph.lanelets[self.plan.bundles[number].lanes[lane][0]], self.shapes[number]
        return Lane(
            lanelet.type, _cubics(form, form.t[:, :, lane] - form.t[:, :, lane + 1]), lanelet.right_mark,
            self._linked(number, lane, False), self._linked(number, lane, True),
            lanelet.speed_limit if lanelet.speed_limit < fastest else None,
        )  # fmt: skip

    def _linked(self, number: int, lane: int, at_end: bool) -> int | None:
        """The lane that continues a lane, where its road is linked to another road."""
        joint, link = self.plan.joint(number, at_end), self._link(number, at_end)
        if joint is None or link is None or link.element != "road":
            return None
        pairs = joint.lanes if at_end else [(after, before) for before, after in joint.lanes]
        return next((-other[1] - 1 for one, other in pairs if one == (number, lane)), None)

    def _link(self, number: int, at_end: bool) -> Link | None:
        joint, junction = self.plan.joint(number, at_end), self._junction(number, at_end)
        if joint is None:
            return None
        if junction == -1 or self.plan.bundles[number].inside:
            other = (joint.beginning if at_end else joint.ending)[0]
            return Link("road", other + 1, "start" if at_end else "end")
        return Link("junction", junction)

    def _junction(self, number: int, at_end: bool) -> int:
        """The junction at one end of a road, -1 where there is none."""
        index = self.plan.index(number, at_end)
        return -1 if index is None else self.junctions[index]


def _cubics(form: Shape, coefficients: np.ndarray) -> tuple[Cubic, ...]:
    return tuple(Cubic(float(s), *map(float, row)) for s, row in zip(form.s, coefficients, strict=True))
