"""Graph of lanelets (successors, neighbours, crossings) and their bundles; each becomes one road.

A `Joint` is a place where bundles end and begin. Where one bundle continues in one, roads are
linked. Everywhere else there is a junction: a default one where bundles are connecting roads (see
`xodr.formats.lanelet2.junctions`), else a direct one."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from schemas.common.errors import Unsupported, UsageError
from xodr.formats.lanelet2.lanelet import (
    WALKS,
    Lanelet,
    LaneletNeighbour,
    Points,
    lengths,
    middle,
    resampled,
)

APART = 0.5
"""Bounds of neighbours that are farther apart than this [m] are not one border."""
_ASKED, _MOST_CROSSED = 64, 100
"""Lanelets whose crossings are looked up at a time, and the most that a lanelet has on average"""


class Graph:
    """Lanelets by id, with links that hold in both directions.

    Attributes:
        after, before: ids of the lanelets that follow and precede each one, sorted as the lanelets
            are.
        notes: what was declared but does not hold.

    Raises:
        UsageError: an id is used twice, or a lanelet refers to one that there is not.
    """

    def __init__(self, lanelets: Sequence[Lanelet]) -> None:
        self.lanelets = {lanelet.id: lanelet for lanelet in lanelets}
        if len(self.lanelets) < len(lanelets):
            raise UsageError("two lanelets have the same id")
        self.order = {name: number for number, name in enumerate(self.lanelets)}
        self.notes: list[str] = []
        pairs = {(lanelet.id, other) for lanelet in lanelets for other in lanelet.successors}
        pairs |= {(other, lanelet.id) for lanelet in lanelets for other in lanelet.predecessors}
        self.after: dict[str, list[str]] = defaultdict(list)
        self.before: dict[str, list[str]] = defaultdict(list)
        for one, other in sorted(
            pairs, key=lambda pair: (self._place(pair[0]), self._place(pair[1]))
        ):
            self.after[one].append(other)
            self.before[other].append(one)
        self.right = self._right_neighbours()

    def _place(self, name: str) -> int:
        if name not in self.order:
            raise UsageError(f"there is no lanelet {name!r}, but another one refers to it")
        return self.order[name]

    def _right_neighbours(self) -> dict[str, str]:
        """Right neighbour of each lanelet, with the same direction and a shared bound."""
        pairs: dict[str, str] = {}
        for lanelet in self.lanelets.values():
            if lanelet.beside_right and lanelet.beside_right.same_direction:
                pairs.setdefault(lanelet.id, lanelet.beside_right.id)
            if lanelet.beside_left and lanelet.beside_left.same_direction:
                pairs.setdefault(lanelet.beside_left.id, lanelet.id)
        right_neighbours: dict[str, str] = {}
        taken: set[str] = set()
        for left, right in sorted(pairs.items(), key=lambda pair: self._place(pair[0])):
            gap = _gap(self.lanelets[left].right, self.lanelets[self._known(right)].left)
            if gap > APART or right in taken:
                self.notes.append(
                    f"lanelets {left} and {right} are declared neighbours, but are {gap:.2f} m "
                    "apart: kept as two roads"
                )
                continue
            right_neighbours[left] = right
            taken.add(right)
        return right_neighbours

    def _known(self, name: str) -> str:
        self._place(name)
        return name

    def canonical(self) -> dict[str, Lanelet]:
        """The lanelets with all their successors and right neighbours, and nothing said twice."""
        return {
            name: replace(
                lanelet,
                predecessors=(),
                successors=tuple(self.after[name]),
                beside_left=None,
                beside_right=LaneletNeighbour(self.right[name], True)
                if name in self.right
                else None,
            )
            for name, lanelet in self.lanelets.items()
        }

    def rows(self) -> list[tuple[str, ...]]:
        """Lanelets that lie beside each other, from left to right; every lanelet is in one row."""
        inner = set(self.right.values())
        rows = [tuple(self._rightwards(name)) for name in self.lanelets if name not in inner]
        # Neighbours in a ring have no leftmost one: each of them is a row.
        left_over = set(self.lanelets) - {name for row in rows for name in row}
        return rows + [(name,) for name in self.lanelets if name in left_over]

    def _rightwards(self, name: str) -> Iterator[str]:
        current: str | None = name
        while current is not None:
            yield current
            current = self.right.get(current)

    @cached_property
    def crossings(self) -> dict[str, set[str]]:
        """Lanelets with centre lines that cross, unless both come from, or lead to, one lanelet."""
        from shapely import LineString, STRtree

        names = [name for name, lanelet in self.lanelets.items() if lanelet.type not in WALKS]
        lines = [
            LineString(middle(self.lanelets[name].left, self.lanelets[name].right))
            for name in names
        ]
        crossing: dict[str, set[str]] = defaultdict(set)
        if not lines:
            return crossing
        tree, count = STRtree(lines), 0
        # In portions, so that a map that is refused has not taken all memory before.
        for start in range(0, len(lines), _ASKED):
            pairs = tree.query(lines[start : start + _ASKED], predicate="crosses").T
            count += len(pairs)
            if count > _MOST_CROSSED * len(lines):
                raise Unsupported(
                    f"the lanelets cross each other more than {_MOST_CROSSED} times each"
                )
            for one, other in pairs:
                name = names[start + one]
                if start + one != other and not self._related(name, names[other]):
                    crossing[name].add(names[other])
        return crossing

    def _related(self, one: str, other: str) -> bool:
        # Lanelets that fork or merge touch at their ends, which is no crossing.
        ends = [(set(links[one]) & set(links[other])) for links in (self.before, self.after)]
        return any(ends) or other in self.after[one] or other in self.before[one]


def _gap(one: Points, other: Points, count: int = 20) -> float:
    """Largest distance between points at equal shares of the lengths of two lines, m."""
    return float(np.hypot(*(resampled(one, count) - resampled(other, count)).T).max())


LONGEST = 500.0
"""Length up to which bundles that continue each other become one road, m."""


@dataclass(frozen=True)
class Bundle:
    """One road to be: lanes from left to right, each a sequence of lanelets; all lanes have equally
    many."""

    lanes: tuple[tuple[str, ...], ...]
    inside: bool = False

    @property
    def first(self) -> tuple[str, ...]:
        """The lanelets that the lanes begin with."""
        return tuple(lane[0] for lane in self.lanes)

    @property
    def last(self) -> tuple[str, ...]:
        """The lanelets that the lanes end with."""
        return tuple(lane[-1] for lane in self.lanes)


@dataclass(frozen=True)
class Joint:
    """Bundles (by number) that end and that begin in one place, and the lanes (bundle, lane) that
    continue each other."""

    ending: tuple[int, ...]
    beginning: tuple[int, ...]
    lanes: tuple[tuple[tuple[int, int], tuple[int, int]], ...]

    @property
    def plain(self) -> bool:
        """Whether a bundle continues in a single other bundle."""
        return len(self.ending) == 1 and len(self.beginning) == 1 and self.ending != self.beginning


class Layout:
    """The bundles of a map, and the joints between them.

    Attributes:
        places: bundle and lane of each lanelet.
    """

    def __init__(self, bundles: list[Bundle], joints: list[Joint]) -> None:
        self.bundles, self.joints = bundles, joints
        self.places = {
            name: (number, lane)
            for number, bundle in enumerate(bundles)
            for lane, names in enumerate(bundle.lanes)
            for name in names
        }
        self._at = {
            (number, True): index for index, joint in enumerate(joints) for number in joint.ending
        }
        self._at |= {
            (number, False): index
            for index, joint in enumerate(joints)
            for number in joint.beginning
        }

    def index(self, number: int, at_end: bool) -> int | None:
        """Return the number of the joint at the end (start) of a bundle; None
        where there is none.
        """
        return self._at.get((number, at_end))

    def joint(self, number: int, at_end: bool) -> Joint | None:
        """The joint at the end (start) of a bundle; None where there is none."""
        index = self.index(number, at_end)
        return None if index is None else self.joints[index]


def joined(graph: Graph, bundles: list[Bundle]) -> Layout:
    """The joints between bundles."""
    places = {
        (name, at_end): (number, lane)
        for number, bundle in enumerate(bundles)
        for at_end, names in ((False, bundle.first), (True, bundle.last))
        for lane, name in enumerate(names)
    }
    joints: list[Joint] = []
    seen: set[int] = set()
    for number in range(len(bundles)):
        if number not in seen:
            joint = _joint(graph, bundles, places, number)
            seen.update(joint.ending)
            if joint.lanes:
                joints.append(joint)
    return Layout(bundles, joints)


_Lane = tuple[int, int]


def _joint(
    graph: Graph, bundles: list[Bundle], places: dict[tuple[str, bool], _Lane], number: int
) -> Joint:
    """All bundles that end, and begin, where one of them ends."""
    groups: dict[bool, set[int]] = {True: {number}, False: set()}
    links: set[tuple[_Lane, _Lane]] = set()
    todo = [(number, True)]
    # To and fro over links until no bundle is new: merges may themselves split.
    while todo:
        index, at_end = todo.pop()
        for lane, name in enumerate(bundles[index].last if at_end else bundles[index].first):
            for other in graph.after[name] if at_end else graph.before[name]:
                there = places[other, not at_end]
                links.add(((index, lane), there) if at_end else (there, (index, lane)))
                if there[0] not in groups[not at_end]:
                    groups[not at_end].add(there[0])
                    todo.append((there[0], not at_end))
    return Joint(tuple(sorted(groups[True])), tuple(sorted(groups[False])), tuple(sorted(links)))


# one after the other ----------------------------------------------------------------------------


def chained(graph: Graph, rows: Layout) -> list[Bundle]:
    """Bundles that continue each other lane by lane, without any difference, taken together."""
    onward = {
        joint.ending[0]: joint.beginning[0]
        for joint in rows.joints
        if _continues(graph, rows, joint)
    }
    heads = [number for number in range(len(rows.bundles)) if number not in set(onward.values())]
    chains = [_chain(head, onward) for head in heads]
    closed = set(range(len(rows.bundles))) - {number for chain in chains for number in chain}
    while closed:  # rings: they are cut somewhere, and once more, since no road leads to itself
        chain = _chain(min(closed), onward)
        half = len(chain) // 2
        chains += [part for part in (chain[:half], chain[half:]) if part]
        closed -= set(chain)
    parts = [
        part
        for chain in chains
        for part in _short(chain, [_length(graph, rows.bundles[number]) for number in chain])
    ]
    return [_merged([rows.bundles[number] for number in part]) for part in sorted(parts, key=min)]


def _continues(graph: Graph, rows: Layout, joint: Joint) -> bool:
    if not joint.plain:
        return False
    one, other = rows.bundles[joint.ending[0]], rows.bundles[joint.beginning[0]]
    same = (
        ((joint.ending[0], lane) for lane in range(len(one.lanes))),
        ((joint.beginning[0], lane) for lane in range(len(other.lanes))),
    )
    if (
        # Any difference would be lost in one road, which has one type and one list of lanes.
        one.inside != other.inside
        or len(one.lanes) != len(other.lanes)
        or joint.lanes != tuple(zip(*same, strict=True))
    ):
        return False
    pairs = zip(
        (graph.lanelets[name] for name in one.last),
        (graph.lanelets[name] for name in other.first),
        strict=True,
    )
    # A light stands at the end of a road.
    return all(_kind(a) == _kind(b) and not a.lights for a, b in pairs)


def _kind(lanelet: Lanelet) -> tuple[str, str, float]:
    return lanelet.type, lanelet.road_type, lanelet.speed_limit


def _chain(head: int, onward: dict[int, int]) -> list[int]:
    chain = [head]
    # A ring comes back to its head.
    while chain[-1] in onward and onward[chain[-1]] != head:
        chain.append(onward[chain[-1]])
    return chain


def _length(graph: Graph, bundle: Bundle) -> float:
    return float(sum(lengths(graph.lanelets[name].left)[-1] for name in bundle.lanes[0]))


def _short(chain: list[int], sizes: list[float]) -> list[list[int]]:
    """The chain cut where it would become too long."""
    parts, total = [chain[:1]], sizes[0]
    for number, size in zip(chain[1:], sizes[1:], strict=True):
        total += size
        if total > LONGEST:
            parts.append([])
            total = size
        parts[-1].append(number)
    return parts


def _merged(bundles: list[Bundle]) -> Bundle:
    lanes = zip(*(bundle.lanes for bundle in bundles), strict=True)
    return replace(
        bundles[0], lanes=tuple(tuple(name for piece in lane for name in piece) for lane in lanes)
    )
