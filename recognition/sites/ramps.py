"""Which lanes of fast roads are ramps, by where they begin and end: for maps whose lane types do not tell.

Beside means: on the same road, in the same direction, main lanes both. A ramp's road comes from or leads elsewhere than the lanes
beside those it joins; an extra lane begins or ends beside lanes that go on.
"""

from __future__ import annotations

from collections import Counter

from recognition.sites.lanes import LaneGraph
from recognition.sites.roles import Role

_Links = list[list[int]]


def ramp_roles(graph: LaneGraph, main: set[int]) -> dict[int, Role]:
    """Roles of those among the main lanes that are ramps."""
    return _Ramps(graph, main).roles()


class _Ramps:
    def __init__(self, graph: LaneGraph, main: set[int]) -> None:
        self._graph, self._main = graph, main
        groups: dict[tuple[str, int, bool], list[int]] = {}
        for number in sorted(main):
            strip = graph.strips[number]
            groups.setdefault((strip.road, strip.section, strip.forward), []).append(number)
        self._beside = {number: [other for other in group if other != number] for group in groups.values() for number in group}

    def roles(self) -> dict[int, Role]:
        following, preceding = self._graph.following, self._graph.preceding
        leaving, entering = self._ramp(following, preceding), self._ramp(preceding, following)
        roles = dict.fromkeys(leaving, Role.OFF_RAMP) | dict.fromkeys(entering, Role.ON_RAMP)
        return roles | dict.fromkeys(leaving & entering, Role.WEAVING)

    def _ramp(self, onwards: _Links, back: _Links) -> set[int]:
        """Lanes that leave the others, or begin beside them and lead to such: off-ramps; with links reversed, on-ramps."""
        found: set[int] = set()
        for number in sorted(self._main):
            if self._parts(number, onwards):
                found.update(self._chain(onwards[number][0], onwards), self._extra(number, back))
            if self._ends(number, back):
                chain = self._chain(number, onwards)
                if any(not self._beside[one] for one in chain):
                    found.update(chain)
        return found

    def _parts(self, number: int, links: _Links) -> bool:
        """Whether a lane leads to another road than most of its group."""
        roads = [self._graph.strips[links[one][0]].road for one in (number, *self._beside[number]) if links[one]]
        if not links[number] or links[number][0] not in self._main:
            return False
        counts = Counter(roads).most_common(2)
        return len(counts) > 1 and counts[0][1] > counts[1][1] and roads[0] != counts[0][0]

    def _ends(self, number: int, links: _Links) -> bool:
        """Whether a lane ends beside lanes that go on."""
        return not links[number] and any(links[other] for other in self._beside[number])

    def _chain(self, number: int, links: _Links) -> list[int]:
        """A lane and those that follow it one by one."""
        chain: list[int] = []
        while number in self._main and number not in chain:
            chain.append(number)
            if len(links[number]) != 1:
                break
            number = links[number][0]
        return chain

    def _extra(self, number: int, links: _Links) -> list[int]:
        """A lane as far as it runs beside others, if it ends there or has a road of its own then; nothing of a through lane."""
        chain = [number]
        while True:
            ways = links[chain[-1]]
            if not ways:
                return chain if self._ends(chain[-1], links) else []
            if len(ways) > 1 or ways[0] not in self._main or ways[0] in chain:
                return []
            if not self._beside[ways[0]]:
                return chain
            chain.append(ways[0])
