"""Ramps by the shapes of lanes, however a map cuts them into roads, and by observed traffic.

Lanes are compared where they are: places every few metres on their centre lines, the places beside
them, and those that traffic reaches from them. Where lanes that were side by side part or come
together, one way is the ramp: that with fewer lanes, towards the slow side, which bends away.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise, product
from typing import NamedTuple

import numpy as np

from recognition.scenes.lanes import NOWHERE, LaneGraph, Strip
from recognition.scenes.roles import CERTAIN, ROLES, LaneRole
from schemas.common.array_types import FloatArray, IntArray
from xodr.graph.network import RoadNetwork

_STEP = 5.0
"""Greatest distance between places on a centre line, m"""
_TOUCH = 0.9
"""Greatest gap or overlap of lanes side by side, m"""
_PARALLEL = math.radians(15.0)
"""Greatest angle between lanes side by side"""
_NARROW = 1.5
"""Lanes below this width (m) are the tip of a taper, which is not driven on"""
_REACH = 7.0
"""Distance within which a place beside another one is looked for, m"""
_HINT = 0.5
"""Weight of what says which way is the ramp if only the map's roads say that there are two"""
_SLOW_SIDE = 0.7
"""Logarithm of the odds that the way at the side of slow traffic is the ramp: maps may lack the
rule of traffic"""
_LOOK = 50.0
"""Way (m) on which lanes that part have come apart"""
_LEAST = 12.0
"""Way (m) that both go on at least after they have parted"""
_LONGEST = 800.0
"""Greatest length (m) of a lane beside through lanes that belongs to a ramp; HCM's weaving segments
end there"""
_RAMP = 1500.0
"""Greatest length of a ramp, m"""
_ACCESS = 300.0
"""Greatest length (m) of a slow road that belongs to a ramp"""
_UNSURE = 0.5


class LaneGuess(NamedTuple):
    """Role of a lane with its confidence from 0 to 1, and the reason where that is not certain."""

    role: LaneRole
    confidence: float = 1.0
    reason: str = ""


def ramp_roles(
    network: RoadNetwork, graph: LaneGraph, roles: dict[int, LaneRole]
) -> dict[int, LaneGuess]:
    """Return the strips whose role by itself is another one in view of the lanes beside, before and
    behind them.

    Args:
        roles: of strips by themselves. Main lanes may be ramps; so may urban lanes that lead to
            main lanes or away from them.
    """
    fast = (LaneRole.MAIN, LaneRole.ON_RAMP, LaneRole.OFF_RAMP)
    # Without main lanes there is nothing to enter or to leave.
    if LaneRole.MAIN not in roles.values():
        return {}
    among = {number for number, role in roles.items() if role in (*fast, LaneRole.URBAN)}
    places = _StripSamples(network, graph, _near_fast(graph, roles, among))
    return _Ramps(network, graph, roles, places).roles()


def _near_fast(graph: LaneGraph, roles: dict[int, LaneRole], among: set[int]) -> list[int]:
    """Strips that are fast, or linked with such within the length of a ramp's slow part."""
    fast = {number for number in among if roles[number] is not LaneRole.URBAN}
    left = dict.fromkeys(fast, _ACCESS)
    waiting = sorted(fast)
    while waiting:
        strip = waiting.pop()
        for other in (*graph.following[strip], *graph.preceding[strip]):
            rest = left[strip] - graph.strips[other].length
            # Again, where a shorter way leaves more of the length.
            if other in among and left[strip] > 0.0 and rest > left.get(other, -math.inf):
                left[other] = rest
                waiting.append(other)
    return sorted(left)


class _StripSamples:
    """Places on the centre lines of strips.

    Attributes:
        strip, x, y, h, width: of each place (m, rad).
        left, right: the place beside it, NOWHERE for none.
        links: the places that traffic reaches next from each, and those from which it reaches it.
    """

    def __init__(self, network: RoadNetwork, graph: LaneGraph, strips: Sequence[int]) -> None:
        parts = [_sampled(network, graph, number) for number in strips]
        sizes = [len(part) for part in parts]
        self.strip = np.repeat(np.array(strips, np.int64), sizes)
        rows = np.concatenate([np.zeros((0, 5)), *parts])
        self.x, self.y, self.h, self.width, self.cell = rows.T
        ends = np.cumsum(sizes)
        self.first = dict(zip(strips, (ends - sizes).tolist(), strict=True))
        self.last = dict(zip(strips, (ends - 1).tolist(), strict=True))
        self.links = (
            self._linked(graph.following, self.first, self.last, 1),
            self._linked(graph.preceding, self.last, self.first, -1),
        )
        self.left, self.right = self._beside()

    def _linked(
        self, strips: list[list[int]], begins: dict[int, int], ends: dict[int, int], step: int
    ) -> list[list[int]]:
        found = [[place + step] for place in range(len(self.x))]
        for strip, place in ends.items():
            found[place] = [begins[after] for after in strips[strip] if after in begins]
        return found

    def _beside(self) -> tuple[IntArray, IntArray]:
        from scipy.spatial import KDTree

        left, right = (np.full(len(self.x), NOWHERE, np.int64) for _ in range(2))
        if not len(self.x):
            return left, right
        pairs = KDTree(np.stack([self.x, self.y], axis=1)).query_pairs(
            _REACH, output_type="ndarray"
        )
        one, other = np.concatenate([pairs, pairs[:, ::-1]]).T
        dx, dy = self.x[other] - self.x[one], self.y[other] - self.y[one]
        cos, sin = np.cos(self.h[one]), np.sin(self.h[one])
        along, across = dx * cos + dy * sin, dy * cos - dx * sin
        gap = np.abs(np.abs(across) - 0.5 * (self.width[one] + self.width[other]))
        angle = np.abs(np.remainder(self.h[other] - self.h[one] + np.pi, math.tau) - np.pi)
        # Places of two lanes need not be level: they are up to half a step apart, in bends more.
        good = (gap <= _TOUCH) & (angle <= _PARALLEL) & (np.abs(along) <= 0.7 * _STEP)
        good &= (self.width[one] >= _NARROW) & (self.width[other] >= _NARROW)
        good &= self.strip[one] != self.strip[other]
        order = np.lexsort((np.abs(along), np.round(gap, 1)))[::-1]  # the best is written last
        for side, table in ((1.0, left), (-1.0, right)):
            chosen = order[(good & (side * across > 0.0))[order]]
            table[one[chosen]] = other[chosen]
        return left, right

    def row(self, place: int) -> list[int]:
        """Places side by side with one, itself among them, from left to right."""
        found = [place]
        for table, at in ((self.left, 0), (self.right, len(self.x))):
            while (beside := int(table[found[at if at == 0 else -1]])) != NOWHERE:
                # Places of faulty maps may lie beside each other in a circle.
                if beside in found or len(found) > 30:
                    break
                found.insert(0, beside) if at == 0 else found.append(beside)
        return found

    def ahead(self, place: int, distance: float, way: int) -> list[tuple[int, float]]:
        """Places a distance ahead (0) or back (1) by all ways, or at their ends; the way to each,
        m."""
        found, waiting, seen = [], [(place, 0.0)], {place}
        while waiting:
            here, gone = waiting.pop()
            onwards = (
                [] if gone >= distance else [x for x in self.links[way][here] if x not in seen]
            )
            if not onwards:
                found.append((here, gone))
            for after in onwards:
                seen.add(after)
                waiting.append((after, gone + 0.5 * float(self.cell[here] + self.cell[after])))
        return sorted(found)

    def together(self, one: int, other: int, spread: float = 0.0) -> bool:
        """Whether a place is in the row of another one, or its lane touches a lane of the row.

        spread: distance (m) that is between them later, besides.
        """
        row = np.array(self.row(one))
        dx, dy = self.x[row] - self.x[other], self.y[row] - self.y[other]
        cos, sin = np.cos(self.h[other]), np.sin(self.h[other])
        along, across = np.abs(dx * cos + dy * sin), np.abs(dy * cos - dx * sin)
        apart = across - 0.5 * (self.width[row] + self.width[other])
        return bool(((along <= 2.0 * _STEP) & (apart + spread <= _TOUCH)).any())


def _sampled(network: RoadNetwork, graph: LaneGraph, number: int) -> FloatArray:
    """x, y, heading, width and length of each place of a strip (n, 5), in the direction of its
    traffic."""
    strip = graph.strips[number]
    count = max(1, math.ceil((strip.end - strip.start) / _STEP))
    line = graph.centre_line(number, count)
    edges = np.linspace(strip.start, strip.end, count + 1)
    middles = 0.5 * (edges[1:] + edges[:-1])
    lane = network.roads[strip.road].sections[strip.section].lanes[strip.lane]
    width = [lane.width(s) for s in (middles if strip.forward else middles[::-1]).tolist()]
    dx, dy = np.diff(line, axis=0).T
    centre = 0.5 * (line[1:] + line[:-1])
    return np.column_stack([centre, np.arctan2(dy, dx), width, np.hypot(dx, dy)])


class _Gore(NamedTuple):
    """Gore: lanes part there (way 0), or come together (1).

    Attributes:
        trunk: places side by side there, from left to right. split: number of those of the left
            way; one lane of both ways counts to both.
        left, right: the first places of both ways beyond. score: logarithm of the odds that the
            right one is the ramp.
    """

    way: int
    trunk: tuple[int, ...]
    sides: tuple[tuple[int, ...], tuple[int, ...]]
    ways: tuple[int, int]
    score: float


class _Ramps:
    def __init__(
        self,
        network: RoadNetwork,
        graph: LaneGraph,
        roles: dict[int, LaneRole],
        places: _StripSamples,
    ) -> None:
        self._network, self._graph, self._roles, self._places = network, graph, roles, places
        self._links = (graph.following, graph.preceding)
        self._known = set(places.first)

    def roles(self) -> dict[int, LaneGuess]:
        """Roles of ramps, and main lanes that may be ramps."""
        gores = [gore for way in (0, 1) for gore in self._gores(way)]
        gores = [gore for gore in gores if self._fast(gore.trunk)]
        sure = [gore for gore in gores if _sigmoid(abs(gore.score)) >= CERTAIN]
        # A ramp ends, at the latest, at the main lanes of a gore of the other way.
        trunks: tuple[set[int], set[int]] = (set(), set())
        for gore in sure:
            main, _ = self._main_and_ramp(gore)
            trunks[gore.way].update(self._strips(main))
        regions: tuple[dict[int, float], dict[int, float]] = ({}, {})
        for gore in sure:
            first = gore.ways[1 if gore.score > 0.0 else 0]
            self._region(first, gore, trunks[1 - gore.way], regions[gore.way])
        beside: tuple[dict[int, LaneGuess], dict[int, LaneGuess]] = ({}, {})
        for gore in sure:
            _, ramp = self._main_and_ramp(gore)
            shared = set(gore.sides[0]) & set(gore.sides[1])
            for place in ramp:
                if place not in shared:
                    self._extra(place, gore, regions, beside[gore.way])
        found = self._merged(regions, beside)
        for gore in gores:
            if gore not in sure:
                reason = "both ways at a fork may be the ramp"
                for strip in self._strips([*gore.trunk, *gore.ways]):
                    found.setdefault(strip, LaneGuess(LaneRole.MAIN, _UNSURE, reason))
        for strip, guess in self._ends(found).items():
            found.setdefault(strip, guess)
        return {
            strip: guess
            for strip, guess in found.items()
            if self._roles[strip] is LaneRole.MAIN
            or guess.role is LaneRole.WEAVING
            or (self._roles[strip] is LaneRole.URBAN and guess.role is not LaneRole.MAIN)
        }

    def _merged(
        self,
        regions: tuple[dict[int, float], dict[int, float]],
        beside: tuple[dict[int, LaneGuess], dict[int, LaneGuess]],
    ) -> dict[int, LaneGuess]:
        found: dict[int, LaneGuess] = {}
        for way, role in ((0, LaneRole.OFF_RAMP), (1, LaneRole.ON_RAMP)):
            guesses = {s: LaneGuess(role, odds) for s, odds in regions[way].items()} | beside[way]
            for strip, guess in guesses.items():
                other = found.get(strip)
                if other is not None and other.role is not guess.role:
                    guess = LaneGuess(LaneRole.WEAVING, min(other.confidence, guess.confidence))
                found[strip] = guess
        return found

    def _fast(self, trunk: Iterable[int]) -> bool:
        """Whether the lanes at a gore are of a fast road, not of a town's."""
        return any(self._roles[strip] is not LaneRole.URBAN for strip in self._strips(trunk))

    def _strips(self, places: Iterable[int]) -> list[int]:
        return [int(self._places.strip[place]) for place in places]

    def _main_and_ramp(self, gore: _Gore) -> tuple[tuple[int, ...], tuple[int, ...]]:
        return gore.sides if gore.score > 0.0 else (gore.sides[1], gore.sides[0])

    def _gores(self, way: int) -> Iterable[_Gore]:
        places = self._places
        onward = places.links[way]
        for one in range(len(places.x)):
            beside = int(places.right[one])
            if beside != NOWHERE:
                other_roads = self._other_roads(one, beside, onward)
                if other_roads or self._last_beside(one, beside, onward):
                    row = places.row(one)
                    at = row.index(one) + 1
                    sides = row[:at], row[at:]
                    if gore := self._parting(one, beside, sides, way, other_roads):
                        yield gore
            for left, right in pairwise(self._from_left(onward[one], way)):
                row = places.row(one)
                at = row.index(one)
                if gore := self._parting(left, right, (row[: at + 1], row[at:]), way):
                    yield gore

    def _last_beside(self, one: int, other: int, onward: list[list[int]]) -> bool:
        """Whether two places side by side are the last ones: none of their followers are side by
        side."""
        following = {other, *onward[other]}
        following.update(after for between in onward[other] for after in onward[between])
        nexts = [after for following in onward[one] for after in (following, *onward[following])]
        return not any(int(self._places.right[after]) in following for after in nexts)

    def _other_roads(self, one: int, other: int, onward: list[list[int]]) -> bool:
        """Whether two places side by side on one road are the last before different roads."""
        roads = self._graph.road
        here, there = ({int(roads[s]) for s in self._strips(onward[x])} for x in (one, other))
        same = roads[self._places.strip[one]] == roads[self._places.strip[other]]
        return bool(same and here and there) and here.isdisjoint(there)

    def _from_left(self, places: list[int], way: int) -> list[int]:
        """Places where ways have parted, from the left to the right of the traffic."""
        if len(places) < 2:
            return places
        p = self._places
        far = {place: p.ahead(place, _LOOK, way)[0][0] for place in places}
        h = float(p.h[places[0]])

        def across(place: int) -> float:
            return float(p.y[far[place]] * math.cos(h) - p.x[far[place]] * math.sin(h))

        return sorted(places, key=across, reverse=True)

    def _parting(
        self,
        left: int,
        right: int,
        sides: tuple[Sequence[int], Sequence[int]],
        way: int,
        other_roads: bool = False,
    ) -> _Gore | None:
        """The gore beyond which two places' ways are apart, if they are.

        Ways that have not come apart at the map's border do so if the map has them on roads of
        their own from here on; that is less sure.
        """
        places = self._places
        both = (left, right)
        # Both ways are compared at the same distance, that of the shorter one.
        look = min(max(gone for _, gone in places.ahead(place, _LOOK, way)) for place in both)
        if look < _LEAST:
            return None
        ends = [
            [at for at, gone in places.ahead(place, look, way) if gone >= look - _STEP]
            for place in both
        ]
        rest = _LOOK - look  # beyond the border of the map they go on as they are
        sign, apart = (1.0 if way == 0 else -1.0), True
        for a, b in product(*ends):
            turn = math.remainder(float(places.h[a] - places.h[b]), math.tau)
            spread = rest * math.sin(max(sign * turn, 0.0))
            if places.together(a, b, spread) or places.together(b, a, spread):
                apart = False
        if not apart and not (other_roads and rest > _STEP):
            return None
        trunk = tuple(dict.fromkeys((*sides[0], *sides[1])))
        far = (ends[0][0], ends[1][0])
        score = self._score(sides, far, way) * (1.0 if apart else _HINT)
        return _Gore(way, trunk, (tuple(sides[0]), tuple(sides[1])), (left, right), score)

    def _score(
        self, sides: tuple[Sequence[int], Sequence[int]], far: tuple[int, int], way: int
    ) -> float:
        """Logarithm of the odds that the way on the right is the ramp."""
        strips = self._graph.strips
        ends = [strips[strip] for strip in self._strips(far)]
        # Signs add up as logarithms of odds, as if they were independent: numbers of lanes, side,
        # kinds, limits, bends.
        score = 1.5 * float(np.clip(len(sides[0]) - len(sides[1]), -2, 2))
        score += _SLOW_SIDE if self._rule(ends[0]) == "RHT" else -_SLOW_SIDE
        ramps = [
            self._roles[strip] in (LaneRole.ON_RAMP, LaneRole.OFF_RAMP)
            for strip in self._strips(far)
        ]
        score += 4.0 * (ramps[1] - ramps[0])
        limits = [end.speed_limit for end in ends]
        if min(limits) < 0.95 * max(limits) and math.isfinite(max(limits)):
            score += 1.0 if limits[1] < limits[0] else -1.0
        p = self._places
        h = float(p.h[p.ahead(sides[0][-1], _LOOK, 1 - way)[0][0]])
        turns = [abs(math.remainder(float(p.h[place]) - h, math.tau)) for place in far]
        if abs(turns[0] - turns[1]) > math.radians(1.5):
            score += 1.0 if turns[1] > turns[0] else -1.0
        return score

    def _rule(self, strip: Strip) -> str:
        return self._network.roads[strip.road].rule

    def _region(self, first: int, gore: _Gore, trunk: set[int], found: dict[int, float]) -> None:
        """Add the strips of a ramp from a gore on, up to the lanes that it joins or leaves at its
        other end."""
        confidence = _sigmoid(abs(gore.score))
        start = int(self._places.strip[first])
        own = set(self._strips(gore.trunk))
        if self._mostly_beyond(first, gore.way):
            own.discard(start)
        waiting = [
            (strip, 0.0)
            for strip in ([start] if start not in own else self._links[gore.way][start])
        ]
        while waiting:
            strip, gone = waiting.pop()
            if strip not in self._known or strip in trunk or strip in own or gone > _RAMP:
                continue
            # A gore that is as sure has been here.
            if found.get(strip, 0.0) >= confidence:
                continue
            found[strip] = confidence
            length = gone + self._graph.strips[strip].length
            waiting += [(after, length) for after in self._links[gore.way][strip]]

    def _extra(
        self, place: int, gore: _Gore, regions: tuple[dict[int, float], dict[int, float]],
        found: dict[int, LaneGuess],
    ) -> None:  # fmt: skip
        """Add a lane beside through lanes that leads to a ramp only, from where it begins; with
        merging ramps, reversed."""
        role = LaneRole.ON_RAMP if gore.way else LaneRole.OFF_RAMP
        back = 1 - gore.way
        chain, length = [], 0.0
        strip = int(self._places.strip[place])
        while True:
            chain.append(strip)
            length += self._graph.strips[strip].length
            ways = [other for other in self._links[back][strip] if other in self._known]
            weaves = strip in regions[back] or any(other in regions[back] for other in ways)
            if length > _LONGEST:
                return
            if weaves:
                role = LaneRole.WEAVING
                break
            if not ways:
                break
            if len(ways) > 1 or ways[0] in chain:
                return
            if len(self._links[gore.way][ways[0]]) > 1:
                break  # it begins where another lane widens into two
            strip = ways[0]
        if self._mostly_beyond(place, gore.way):
            chain = chain[1:]
        for strip in chain:
            found[strip] = LaneGuess(role, _sigmoid(abs(gore.score)))

    def _mostly_beyond(self, place: int, way: int) -> bool:
        """Whether most of a place's strip lies beyond it."""
        strip = int(self._places.strip[place])
        first, last = self._places.first[strip], self._places.last[strip]
        behind, beyond = place - first, last - place
        return beyond > behind if way == 0 else behind > beyond

    def _ends(self, found: dict[int, LaneGuess]) -> dict[int, LaneGuess]:
        """Lanes at the slow side from the map's border to their end beside others, or from a
        beginning to the border."""
        unsure: dict[int, LaneGuess] = {}
        for way, verb, far in ((0, "ends", "begins"), (1, "begins", "ends")):
            for strip in sorted(self._known):
                if strip in found or self._roles[strip] is not LaneRole.MAIN:
                    continue
                if not self._stops(strip, way) or not self._outer(strip):
                    continue
                chain = self._chain(strip, 1 - way)
                length = sum(self._graph.strips[one].length for one in chain)
                if (
                    self._stops(chain[-1], 1 - way)
                    or found.keys() & set(chain)
                    or length > _LONGEST
                ):
                    continue
                if self._links[1 - way][chain[-1]]:
                    continue
                reason = (
                    f"{far} at the border of the map and {verb} beside other lanes: of a ramp or "
                    "a through lane"
                )
                unsure |= dict.fromkeys(chain, LaneGuess(LaneRole.MAIN, _UNSURE, reason))
        return unsure

    def _stops(self, strip: int, way: int) -> bool:
        """Whether a strip ends, or merges into the lane beside it, while a strip beside it
        continues."""
        place = (self._places.last if way == 0 else self._places.first)[strip]
        mates = [
            mate
            for mate in self._places.row(self._wide(place, way))
            if int(self._places.strip[mate]) != strip
        ]
        goes = [
            mate for mate in mates if self._places.ahead(mate, 2.0 * _LOOK, way)[-1][1] >= _LOOK
        ]
        onwards = self._links[way][strip]
        into = any(len(self._links[1 - way][after]) > 1 for after in onwards)
        return bool(goes) and (not onwards or into)

    def _wide(self, place: int, way: int) -> int:
        """The nearest place on the same strip, away from its end, that is wide
        enough to drive on.
        """
        places, step = self._places, -1 if way == 0 else 1
        strip = places.strip[place]
        at = place
        while (
            places.width[at] < 2.0 * _NARROW
            and 0 <= at + step < len(places.x)
            and places.strip[at + step] == strip
        ):
            at += step
        return at

    def _outer(self, strip: int) -> bool:
        """Whether a strip lies at the side of slow traffic."""
        places = self._places
        at = (places.first[strip] + places.last[strip]) // 2
        right = self._rule(self._graph.strips[strip]) == "RHT"
        return int((places.right if right else places.left)[at]) == NOWHERE

    def _chain(self, strip: int, way: int) -> list[int]:
        chain = [strip]
        while True:
            ways = [other for other in self._links[way][chain[-1]] if other in self._known]
            if len(ways) != 1 or ways[0] in chain or len(self._links[1 - way][ways[0]]) > 1:
                return chain
            chain.append(ways[0])


def _sigmoid(odds: float) -> float:
    return 1.0 / (1.0 + math.exp(-odds))


# observed traffic ---------------------------------------------------------------------------

_FEWEST = 5
"""Fewest vehicles on a ramp that say something of it"""
_THROUGH = 0.25
"""Share of vehicles that come from main lanes onto an on-ramp, or go from an off-ramp back to them,
above which it is a main lane: overtaking on an acceleration lane is rare"""
_MAIN = ROLES.index(LaneRole.MAIN)


def by_traffic(lanes: LaneGraph, track: IntArray, strip: IntArray, role: IntArray) -> IntArray:
    """Return roles of rows in which ramps that carry through traffic are main lanes.

    Linked strips with the role of an on-ramp count together, and so do those of an off-ramp,
    however the map cuts them into roads.

    Args:
        track, strip, role: of rows (n,) in the order of tracks and time; role as an index into
            `ROLES`.
    """
    found = role.copy()
    for ramp, before in ((LaneRole.ON_RAMP, True), (LaneRole.OFF_RAMP, False)):
        code = ROLES.index(ramp)
        on = (role == code) & (strip != NOWHERE)
        if not on.any():
            continue
        part = _linked(lanes, np.unique(strip[on]))
        number = np.where(on, part[strip], NOWHERE)
        other_visit = (np.diff(number) != 0) | (np.diff(track) != 0)
        begins = np.flatnonzero(np.append(True, other_visit) & on)
        ends = np.flatnonzero(np.append(other_visit, True) & on)
        other = begins - 1 if before else ends + 1
        here = begins if before else ends
        inside = (other >= 0) & (other < len(track))
        other = np.where(inside, other, 0)
        main = inside & (track[other] == track[here]) & (role[other] == _MAIN)
        visits = np.bincount(number[here], minlength=int(part.max()) + 1)
        through = np.bincount(number[here], main, minlength=len(visits))
        wrong = (visits >= _FEWEST) & (through > _THROUGH * visits)
        found[on & wrong[np.where(on, number, 0)]] = _MAIN
    return found


def _linked(lanes: LaneGraph, strips: IntArray) -> IntArray:
    """Number of the group of linked strips that each strip of a graph is in; NOWHERE for none."""
    group = np.full(len(lanes.strips) + 1, NOWHERE, np.int64)
    among = set(strips.tolist())
    count = 0
    for first in strips.tolist():
        if group[first] != NOWHERE:
            continue
        waiting = [first]
        while waiting:
            strip = waiting.pop()
            if group[strip] == NOWHERE:
                group[strip] = count
                waiting += [
                    neighbour
                    for neighbour in (*lanes.following[strip], *lanes.preceding[strip])
                    if neighbour in among
                ]
        count += 1
    return group
