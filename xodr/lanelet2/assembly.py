"""From lanelets to a road map."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from xodr.builders.elements import Connection, Cubic, Geo, Junction, Lane, Link, Road, RoadMap, Section
from xodr.lanelet2.bundles import Bundle, Joint, Layout
from xodr.lanelet2.graph import Graph
from xodr.lanelet2.insides import layout
from xodr.lanelet2.lanelet import Lanelet
from xodr.lanelet2.mouths import Borders, mouths
from xodr.lanelet2.shapes import Shape, shape


class Built(NamedTuple):
    """A road map made of lanelets.

    lanelets: road id and lane id of each lanelet. Of a lanelet that was cut in two for a junction, that is its first part; the
        second part has its id followed by "/2". parts: the lanelets, so cut. notes: what could not be kept as it was, one
        sentence each.
    """

    map: RoadMap
    lanelets: dict[str, tuple[str, int]]
    parts: list[Lanelet]
    notes: list[str]


def build(lanelets: Sequence[Lanelet], name: str, geo: Geo | None = None) -> Built:
    """The road map of some lanelets, in the same coordinates.

    Every lane connection of the lanelets is one of the map. All lanes are right-hand lanes, -1 the leftmost; roads run in the
    direction of travel, and those of opposite directions are apart.

    Raises:
        UsageError: an id is used twice, or a lanelet refers to one that there is not.
    """
    graph, plan = layout(Graph(lanelets))
    borders = Borders(graph, plan)
    ends = mouths(borders)
    shapes = [shape(borders.extended(number), ends[number, False], ends[number, True]) for number in range(len(plan.bundles))]
    return _Builder(graph, plan, shapes).build(name, geo)


class _Builder:
    def __init__(self, graph: Graph, plan: Layout, shapes: list[Shape]) -> None:
        self.graph, self.plan, self.shapes = graph, plan, shapes
        self.junctions = _junctions(graph, plan)

    def build(self, name: str, geo: Geo | None) -> Built:
        roads = tuple(self._road(number) for number in range(len(self.plan.bundles)))
        groups: dict[int, list[Joint]] = defaultdict(list)
        for joint, identity in zip(self.plan.joints, self.junctions, strict=True):
            if identity is not None:
                groups[identity].append(joint)
        junctions = tuple(self._junction(identity, joints) for identity, joints in sorted(groups.items()))
        where = {
            lanelet: (str(number + 1), -lane - 1)
            for number, bundle in enumerate(self.plan.bundles)
            for lane, names in enumerate(bundle.lanes)
            for lanelet in names
        }
        return Built(RoadMap(name, roads, junctions, geo=geo), where, list(self.graph.lanelets.values()), self.graph.notes)

    # roads ----------------------------------------------------------------------------------

    def _road(self, number: int) -> Road:
        bundle, form = self.plan.bundles[number], self.shapes[number]
        first = [self.graph.lanelets[name] for name in bundle.first]
        fastest = max(lanelet.speed_limit for lanelet in first)
        start, end = self.plan.starts.get(number), self.plan.ends.get(number)
        lanes = {-lane - 1: self._lane(number, lane, fastest) for lane in range(len(first))}
        return Road(
            number + 1, " ".join(name for lane in bundle.lanes for name in lane), form.start, form.plan,
            (Section(0.0, lanes, first[0].left_mark),), first[0].road_type, fastest,
            junction=self._junction_of(start) if bundle.inside else -1,
            predecessor=self._link(number, start, False), successor=self._link(number, end, True),
            offset=_cubics(form, form.t[:, :, 0]),
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
        joint = (self.plan.ends if at_end else self.plan.starts).get(number)
        link = self._link(number, joint, at_end)
        if joint is None or link is None or link.element != "road":
            return None
        pairs = joint.lanes if at_end else [(after, before) for before, after in joint.lanes]
        return next((-other[1] - 1 for one, other in pairs if one == (number, lane)), None)

    def _link(self, number: int, joint: Joint | None, at_end: bool) -> Link | None:
        if joint is None:
            return None
        if self._junction_of(joint) == -1 or self.plan.bundles[number].inside:
            other = (joint.beginning if at_end else joint.ending)[0]
            return Link("road", other + 1, "start" if at_end else "end")
        return Link("junction", self._junction_of(joint))

    # junctions ------------------------------------------------------------------------------

    def _junction_of(self, joint: Joint | None) -> int:
        index = self.plan.joints.index(joint) if joint else None
        found = self.junctions[index] if index is not None else None
        return -1 if found is None else found

    def _junction(self, identity: int, joints: list[Joint]) -> Junction:
        """A junction: its connections enter the connecting roads, or lead from road to road where there are none."""
        inside = any(self.plan.bundles[number].inside for joint in joints for number in (*joint.ending, *joint.beginning))
        lanes: dict[tuple[int, int], list[tuple[int, int]]] = defaultdict(list)
        for joint in joints:
            for (before, one), (after, other) in joint.lanes:
                if not inside or self.plan.bundles[after].inside:
                    lanes[before, after].append((-one - 1, -other - 1))
        connections = tuple(Connection(before + 1, after + 1, tuple(links)) for (before, after), links in sorted(lanes.items()))
        return Junction(identity, f"Junction {identity}", connections, direct=not inside)


def _cubics(form: Shape, coefficients: np.ndarray) -> tuple[Cubic, ...]:
    return tuple(Cubic(float(s), *map(float, row)) for s, row in zip(form.s, coefficients, strict=True))


def _junctions(graph: Graph, plan: Layout) -> list[int | None]:
    """The junction that each joint belongs to: joints at the same connecting roads, and at such as cross, share one."""
    groups = list(range(len(plan.joints)))

    def root(index: int) -> int:
        while groups[index] != index:
            index = groups[index]
        return index

    def join(numbers: Sequence[int]) -> None:
        for number in numbers[1:]:
            one, other = sorted((root(numbers[0]), root(number)))
            groups[other] = one

    places = {id(joint): index for index, joint in enumerate(plan.joints)}
    inner = {
        number: [places[id(plan.starts[number])], places[id(plan.ends[number])]]
        for number, bundle in enumerate(plan.bundles)
        if bundle.inside
    }
    owner = {name: number for number in inner for lane in plan.bundles[number].lanes for name in lane}
    for number, both in inner.items():
        join(both)
        crossed = {owner[other] for name in _names(plan.bundles[number]) for other in graph.crossings[name] if other in owner}
        for other in sorted(crossed):
            join([both[0], inner[other][0]])
    touched = {index for both in inner.values() for index in both}
    needed = [index for index, joint in enumerate(plan.joints) if index in touched or not joint.plain]
    ids = {group: len(plan.bundles) + 1 + place for place, group in enumerate(sorted({root(index) for index in needed}))}
    return [ids[root(index)] if index in needed else None for index in range(len(plan.joints))]


def _names(bundle: Bundle) -> list[str]:
    return [name for lane in bundle.lanes for name in lane]
