"""Lanelets of maps that give centre lines of lanes only: widths, neighbours and successors are
inferred.

Lanes run beside each other where their centre lines do, at a lane's distance and in the same
direction; both are split where one begins or ends beside the other, and share the line half-way
between them as a bound. Other bounds lie on the nearest line that the map has beside the lane (road
edges, lane marks, outlines), else half a usual lane away. Lanes follow each other where one centre
line begins at the end of another."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from schemas.common.array_types import FloatArray, IntArray
from xodr.formats.lanelet2.lanelet import Lanelet, LaneletNeighbour, Points, lengths, points_at

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

STEP = 1.0
"""Distance between the places that are compared, m."""
MEETING = 1.0
"""Greatest distance between the end of a lane and the beginning of one that follows it, m."""
_ONWARD, _ALONG = math.radians(45.0), math.radians(15.0)
"""Greatest angles between lanes that follow each other, and between those beside each other"""
_APART = (2.2, 5.2)
"""Distance between the centre lines of lanes beside each other, m."""
_LEVEL = 0.75
"""Places beside each other are no farther ahead than this, m."""
_LEAST_BESIDE = 8.0
"""Lanes that are beside each other for a shorter way are not neighbours, m."""
_SHORTEST = 6.0
"""Lanes are not split nearer to their ends, or to another split, than this, m."""
_HALF = (1.2, 2.75)
"""Least and greatest distance of a bound from the centre line, m."""
_USUAL = 1.75
_DENSE = 0.5
_ROUNDS = 8


@dataclass(frozen=True, eq=False)
class CentreLine:
    """A lane as a line (n, 2) in the direction of its traffic, m; other attributes as of `Lanelet`.

    successors: None where the map doesn't give them.
    """

    id: str
    line: Points
    type: str = "driving"
    road_type: str = "town"
    speed_limit: float = math.inf
    successors: tuple[str, ...] | None = None
    lights: tuple[str, ...] = ()


class _Run(NamedTuple):
    """A stretch of lane `left` from `a` to `b` (m) with lane `right` beside it on its right, from
    `c` to `d`."""

    left: int
    right: int
    a: float
    b: float
    c: float
    d: float


def lanelets_of(
    lanes: Sequence[CentreLine], edges: Iterable[Points]
) -> tuple[list[Lanelet], list[str]]:
    """Return lanelets of centre lines, and what was inferred, one sentence each.

    Args:
        lanes: of some length, with ids that differ.
        edges: lines beside lanes: road edges, lane marks, outlines.
    """
    return _CentreLineSamples(lanes, edges).lanelets()


class _CentreLineSamples:
    def __init__(self, lanes: Sequence[CentreLine], edges: Iterable[Points]) -> None:
        self._lanes = lanes
        self._length = [float(lengths(lane.line)[-1]) for lane in lanes]
        grids = [np.linspace(0.0, total, max(2, round(total / STEP) + 1)) for total in self._length]
        lines = [points_at(lane.line, grid) for lane, grid in zip(lanes, grids, strict=True)]
        self._lane = np.repeat(np.arange(len(lanes)), [len(grid) for grid in grids])
        self._s, self._place = np.concatenate(grids), np.concatenate(lines)
        self._heading = np.concatenate([_headings(line) for line in lines])
        self._edges = _places_on(edges)
        self._widths_unknown = 0

    def lanelets(self) -> tuple[list[Lanelet], list[str]]:
        """The lanelets, and notes."""
        follows = self._followers()
        runs = self._runs()
        cuts = self._cuts(runs)
        ends = [[0.0, *cuts[number], total] for number, total in enumerate(self._length)]
        parts = [(number, part) for number, own in enumerate(ends) for part in range(len(own) - 1)]
        right = self._right(runs, ends)
        left = {other: one for one, other in right.items()}
        lines = {
            part: points_at(self._lanes[part[0]].line, _grid(*ends[part[0]][part[1] : part[1] + 2]))
            for part in parts
        }
        made = []
        for number, part in parts:
            lane, last = self._lanes[number], part == len(ends[number]) - 2
            after = [(other, 0) for other in follows[number]] if last else [(number, part + 1)]
            made.append(
                Lanelet(
                    self._name(number, part),
                    self._bound((number, part), left.get((number, part)), lines, 1.0),
                    self._bound((number, part), right.get((number, part)), lines, -1.0),
                    successors=tuple(self._name(*part) for part in after),
                    beside_right=LaneletNeighbour(self._name(*right[number, part]), True)
                    if (number, part) in right
                    else None,
                    type=lane.type,
                    road_type=lane.road_type,
                    speed_limit=lane.speed_limit,
                    lights=lane.lights if last else (),
                )
            )
        return made, self._notes(right, cuts)

    def _name(self, number: int, part: int) -> str:
        return self._lanes[number].id if part == 0 else f"{self._lanes[number].id}.{part + 1}"

    def _notes(
        self, right: dict[tuple[int, int], tuple[int, int]], cuts: dict[int, list[float]]
    ) -> list[str]:
        notes = []
        if any(lane.successors is None for lane in self._lanes):
            notes.append(
                "which lanes follow each other is inferred: those whose centre lines meet within "
                f"{MEETING:g} m"
            )
        notes.append(
            f"lanes beside each other are inferred from their centre lines: {len(right)} pairs"
        )
        if any(cuts.values()):
            notes.append(
                f"{sum(map(bool, cuts.values()))} lanes are split where one "
                "beside them begins or ends"
            )
        notes.append("bounds of lanes are inferred from centre lines and the lines beside them")
        if self._widths_unknown:
            notes.append(
                f"{self._widths_unknown} bounds have no line near them: they are {_USUAL:g} m "
                "from the centre"
            )
        return notes

    # successors ---------------------------------------------------------------------------------

    def _followers(self) -> list[list[int]]:
        """The lanes that follow each lane."""
        from scipy.spatial import KDTree

        number = {lane.id: index for index, lane in enumerate(self._lanes)}
        first = np.searchsorted(self._lane, np.arange(len(self._lanes)))
        last = np.append(first[1:], len(self._lane)) - 1
        near = KDTree(self._place[first]).query_ball_point(self._place[last], MEETING)
        followers = []
        for index, lane in enumerate(self._lanes):
            if lane.successors is not None:
                followers.append([number[name] for name in lane.successors if name in number])
                continue
            turns = {
                other: self._heading[first[other]] - self._heading[last[index]]
                for other in near[index]
            }
            onward = [other for other, turn in turns.items() if math.cos(turn) > math.cos(_ONWARD)]
            followers.append(
                sorted(
                    other
                    for other in onward
                    if other != index and self._lanes[other].type == lane.type
                )
            )
        return followers

    # neighbours ---------------------------------------------------------------------------------

    def _runs(self) -> list[_Run]:
        """Stretches of lanes beside each other."""
        right, left = self._nearest(-1.0), self._nearest(1.0)
        here = np.flatnonzero(right >= 0)
        # each is the nearest one of the other
        here = here[self._lane[left[right[here]]] == self._lane[here]]
        runs = []
        breaks = np.diff(here) != 1
        # A run ends where either of both lanes changes, too.
        breaks |= (np.diff(self._lane[here]) != 0) | (np.diff(self._lane[right[here]]) != 0)
        for rows in np.split(here, np.flatnonzero(breaks) + 1):
            if len(rows) and self._s[rows[-1]] - self._s[rows[0]] >= _LEAST_BESIDE:
                other = right[rows]
                ends = (
                    self._s[rows[0]],
                    self._s[rows[-1]],
                    self._s[other].min(),
                    self._s[other].max(),
                )
                runs.append(
                    _Run(int(self._lane[rows[0]]), int(self._lane[other[0]]), *map(float, ends))
                )
        return runs

    def _nearest(self, side: float) -> IntArray:
        """The nearest place of another lane beside each place, on its left (1.0) or right (-1.0);
        -1 for none."""
        from scipy.spatial import cKDTree

        pairs = cKDTree(self._place).query_pairs(_APART[1], output_type="ndarray")
        one, other = np.concatenate([pairs, pairs[:, ::-1]]).T
        # Lanes of other types, such as sidewalks beside a road, do not share its rows.
        kinds = np.unique([lane.type for lane in self._lanes], return_inverse=True)[1][self._lane]
        kept = (self._lane[one] != self._lane[other]) & (kinds[one] == kinds[other])
        kept &= np.cos(self._heading[one] - self._heading[other]) > math.cos(_ALONG)
        one, other = one[kept], other[kept]
        ahead, aside = _local(self._place[one], self._heading[one], self._place[other])
        kept = (np.abs(ahead) <= _LEVEL) & (side * aside >= _APART[0]) & (side * aside <= _APART[1])
        one, other, aside = one[kept], other[kept], aside[kept]
        found = np.full(len(self._place), -1, np.int64)
        order = np.lexsort((other, np.abs(aside)))[::-1]  # the nearest is written last
        found[one[order]] = other[order]
        return found

    def _cuts(self, runs: Sequence[_Run]) -> dict[int, list[float]]:
        """Return places where lanes are split, in ascending order: a split of one is one of those
        beside it."""
        cuts: dict[int, list[float]] = defaultdict(list)

        def add(number: int, s: float) -> None:
            if all(
                # Cuts pass from lane to lane with errors of the samples: close ones are the same.
                abs(s - other) >= _SHORTEST
                for other in (0.0, self._length[number], *cuts[number])
            ):
                cuts[number].append(s)

        # A cut may pass through a whole row of lanes: on to the next one with each round.
        for _ in range(_ROUNDS):
            before = sum(map(len, cuts.values()))
            for run in runs:
                at = [run.a, run.b, *cuts[run.left]]
                # The other lane's ends are cuts, too: neighbours begin and end together.
                at += [
                    _between(s, run.c, run.d, run.a, run.b)
                    for s in (*cuts[run.right], 0.0, self._length[run.right])
                ]
                for s in at:
                    if run.a <= s <= run.b:
                        add(run.left, s)
                        add(run.right, _between(s, run.a, run.b, run.c, run.d))
            if sum(map(len, cuts.values())) == before:
                break
        return {number: sorted(cuts[number]) for number in range(len(self._lanes))}

    def _right(
        self, runs: Sequence[_Run], ends: list[list[float]]
    ) -> dict[tuple[int, int], tuple[int, int]]:
        """Part of a lane to the right of each part, with the same beginning and end."""
        found: dict[tuple[int, int], tuple[int, int]] = {}
        taken: set[tuple[int, int | None]] = set()
        for run in runs:
            for part, (start, end) in enumerate(
                zip(ends[run.left][:-1], ends[run.left][1:], strict=True)
            ):
                there = [_between(s, run.a, run.b, run.c, run.d) for s in (start, end)]
                own = ends[run.right]
                other = next(
                    (
                        k
                        for k in range(len(own) - 1)
                        if all(abs(own[k + i] - there[i]) < _SHORTEST for i in (0, 1))
                    ),
                    None,
                )
                middle = 0.5 * (start + end)
                free = (run.left, part) not in found and (run.right, other) not in taken
                if other is not None and run.a < middle < run.b and free:
                    found[run.left, part] = run.right, other
                    taken.add((run.right, other))
        return found

    # bounds -------------------------------------------------------------------------------------

    def _bound(
        self,
        part: tuple[int, int],
        beside: tuple[int, int] | None,
        lines: dict[tuple[int, int], Points],
        side: float,
    ) -> Points:
        """The bound of a part on its left (side 1.0) or right (-1.0)."""
        line = lines[part]
        if beside is not None:
            count = max(len(line), len(lines[beside]))
            one, other = (_resampled(bound, count) for bound in (line, lines[beside]))
            # One line for both, so that neighbours share their bound.
            return 0.5 * (one + other)
        heading = _headings(line)
        away = self._to_edges(line, heading, side)
        known = np.isfinite(away)
        # An unknown place takes the median of its bound; bounds without any known one are told.
        self._widths_unknown += not known.any()
        away = np.where(known, away, np.median(away[known]) if known.any() else _USUAL)
        # A moving average over five places: marks and edges come in pieces that jump.
        away = np.convolve(np.pad(away, 2, mode="edge"), np.full(5, 0.2), mode="valid")
        normal = np.column_stack([-np.sin(heading), np.cos(heading)])
        return line + side * np.clip(away, *_HALF)[:, None] * normal

    def _to_edges(self, line: Points, heading: FloatArray, side: float) -> FloatArray:
        """Distance to the nearest edge beside each place of a line, m; NaN for none."""
        found = np.full(len(line), np.inf)
        if self._edges is None:
            return np.full(len(line), np.nan)
        tree, places = self._edges
        for index, near in enumerate(tree.query_ball_point(line, _HALF[1] + _LEVEL)):
            ahead, aside = _local(line[index], heading[index], places[near])
            # Edges ahead or behind belong to other places of the line.
            aside = side * aside[np.abs(ahead) <= _DENSE]
            found[index] = aside[(aside >= _HALF[0]) & (aside <= _HALF[1])].min(initial=np.inf)
        return np.where(np.isfinite(found), found, np.nan)


def _places_on(edges: Iterable[Points]) -> tuple[cKDTree, Points] | None:
    """Return a tree of places on lines, and the places (n, 2); None without any."""
    from scipy.spatial import cKDTree

    lines = [
        points_at(line, _grid(0.0, float(lengths(line)[-1]), _DENSE))
        for line in edges
        if len(line) > 1
    ]
    places = np.concatenate(lines) if lines else None
    return None if places is None else (cKDTree(places), places)


def _grid(start: float, end: float, step: float = STEP) -> FloatArray:
    return np.linspace(start, end, max(2, round((end - start) / step) + 1))


def _resampled(line: Points, count: int) -> Points:
    return points_at(line, np.linspace(0.0, lengths(line)[-1], count))


def _headings(line: Points) -> FloatArray:
    steps = np.gradient(line, axis=0)
    return np.arctan2(steps[:, 1], steps[:, 0])


def _local(origin: Points, heading: FloatArray, there: Points) -> tuple[FloatArray, FloatArray]:
    """Return distances of places ahead of and to the left of others, m."""
    (dx, dy), cos, sin = (there - origin).T, np.cos(heading), np.sin(heading)
    return cos * dx + sin * dy, cos * dy - sin * dx


def _between(s: float, a: float, b: float, c: float, d: float) -> float:
    """The place on one lane beside place `s` of another, where a to b runs beside c to d."""
    # Kept from 0, for runs of one place.
    return c + (s - a) * (d - c) / max(b - a, 1e-6)
