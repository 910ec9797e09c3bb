"""Lanelets taken together into what becomes one road: those side by side, and those one after the other.

A `Joint` is a place where bundles end and begin. Where one bundle continues in one, roads are linked. Everywhere else there is
a junction: a default one where bundles are connecting roads (see `xodr.lanelet2.insides`), else a direct one.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from xodr.lanelet2.graph import Graph


@dataclass(frozen=True)
class Bundle:
    """One road to be: lanes from left to right, each a sequence of lanelets; all lanes have equally many."""

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
    """Bundles (by number) that end and that begin in one place, and the lanes (bundle, lane) that continue each other."""

    ending: tuple[int, ...]
    beginning: tuple[int, ...]
    lanes: tuple[tuple[tuple[int, int], tuple[int, int]], ...]

    @property
    def plain(self) -> bool:
        """Whether one bundle continues in one other."""
        return len(self.ending) == 1 and len(self.beginning) == 1 and self.ending != self.beginning


@dataclass
class Layout:
    """The bundles of a map, their joints, and the joint at the start and end of each bundle that has one."""

    bundles: list[Bundle]
    joints: list[Joint] = field(default_factory=list)
    starts: dict[int, Joint] = field(default_factory=dict)
    ends: dict[int, Joint] = field(default_factory=dict)


def joined(graph: Graph, bundles: list[Bundle]) -> Layout:
    """The joints between bundles."""
    begins = {name: (number, lane) for number, bundle in enumerate(bundles) for lane, name in enumerate(bundle.first)}
    found = Layout(bundles)
    seen: set[int] = set()
    for number in range(len(bundles)):
        if number in seen:
            continue
        ending, beginning, links = _joint(graph, bundles, begins, number)
        seen.update(ending)
        if links:
            joint = Joint(tuple(sorted(ending)), tuple(sorted(beginning)), tuple(sorted(links)))
            found.joints.append(joint)
            found.ends |= dict.fromkeys(joint.ending, joint)
            found.starts |= dict.fromkeys(joint.beginning, joint)
    return found


_Lane = tuple[int, int]


def _joint(
    graph: Graph, bundles: list[Bundle], begins: dict[str, _Lane], number: int
) -> tuple[set[int], set[int], set[tuple[_Lane, _Lane]]]:
    """All bundles that end, and begin, where one of them ends."""
    ends = {name: (index, lane) for index, bundle in enumerate(bundles) for lane, name in enumerate(bundle.last)}
    ending, beginning, links = {number}, set[int](), set[tuple[_Lane, _Lane]]()
    todo = [(number, True)]
    while todo:
        index, at_end = todo.pop()
        for lane, name in enumerate(bundles[index].last if at_end else bundles[index].first):
            for other in graph.after[name] if at_end else graph.before[name]:
                there = (begins if at_end else ends)[other]
                links.add(((index, lane), there) if at_end else (there, (index, lane)))
                group = beginning if at_end else ending
                if there[0] not in group:
                    group.add(there[0])
                    todo.append((there[0], not at_end))
    return ending, beginning, links


# one after the other -------------------------------------------------------------------------------


def chained(graph: Graph, rows: Layout) -> list[Bundle]:
    """Bundles that continue each other lane by lane, without any difference, taken together."""
    onward = {joint.ending[0]: joint.beginning[0] for joint in rows.joints if _continues(graph, rows, joint)}
    heads = [number for number in range(len(rows.bundles)) if number not in set(onward.values())]
    chains = [_chain(head, onward) for head in heads]
    closed = set(range(len(rows.bundles))) - {number for chain in chains for number in chain}
    while closed:  # rings: they are cut somewhere
        chain = _chain(min(closed), onward)
        chains.append(chain)
        closed -= set(chain)
    return [_merged([rows.bundles[number] for number in chain]) for chain in sorted(chains, key=min)]


def _continues(graph: Graph, rows: Layout, joint: Joint) -> bool:
    if not joint.plain:
        return False
    one, other = rows.bundles[joint.ending[0]], rows.bundles[joint.beginning[0]]
    same = (
        ((joint.ending[0], lane) for lane in range(len(one.lanes))),
        ((joint.beginning[0], lane) for lane in range(len(other.lanes))),
    )
    if one.inside != other.inside or len(one.lanes) != len(other.lanes) or joint.lanes != tuple(zip(*same, strict=True)):
        return False
    pairs = zip((graph.lanelets[name] for name in one.last), (graph.lanelets[name] for name in other.first), strict=True)
    return all((a.type, a.road_type, a.speed_limit) == (b.type, b.road_type, b.speed_limit) for a, b in pairs)


def _chain(head: int, onward: dict[int, int]) -> list[int]:
    chain = [head]
    while chain[-1] in onward and onward[chain[-1]] != head:
        chain.append(onward[chain[-1]])
    return chain


def _merged(bundles: list[Bundle]) -> Bundle:
    lanes = zip(*(bundle.lanes for bundle in bundles), strict=True)
    return replace(bundles[0], lanes=tuple(tuple(name for piece in lane for name in piece) for lane in lanes))
