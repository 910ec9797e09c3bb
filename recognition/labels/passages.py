"""Ways through junctions: from which lane into which, with how much of a turn."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from recognition.labels.stays import held, stays
from recognition.sites.lanes import NOWHERE, Floats, Whole
from recognition.sites.roles import ROLES, Role

if TYPE_CHECKING:
    from recognition.labels.scene import Flags, Scene


@dataclass(frozen=True, eq=False)
class Passages:
    """Complete ways through junctions, in the order of their rows.

    Attributes:
        before, after: last row before the junction and first one behind it.
        row: the middle: half of the turn is done there, or, of a straight way, half of the way.
        turn: change of heading, rad, positive to the left.
        junction: number of the junction.
        signalised: whether it has traffic lights.
        origin, target: strips before and behind the junction. origin_road: number of the road before it.
    """

    before: Whole
    after: Whole
    row: Whole
    turn: Floats
    junction: Whole
    signalised: Flags
    origin: Whole
    target: Whole
    origin_road: Whole

    def __len__(self) -> int:
        return len(self.row)

    def rows(self, index: int) -> Whole:
        """All rows of one of them."""
        return np.arange(self.before[index], self.after[index] + 1)


def passages(scene: Scene) -> Passages:
    """The ways of all tracks through junctions; those that begin or end inside are left out."""
    junction_of, road_of = _numbers(scene)
    inside = np.where(scene.has_role(Role.INSIDE, Role.SIGNALISED), junction_of[scene.strip], NOWHERE)
    inside = held(inside, scene.track, scene.rows(scene.rules.flicker))
    start, size = stays(inside, scene.track)
    crossing = inside[start] != NOWHERE
    before, after = start[crossing] - 1, (start + size)[crossing]
    known = (before >= 0) & (after < len(inside))
    before, after = before[known], after[known]
    same = (scene.track[before] == scene.track[before + 1]) & (scene.track[after] == scene.track[after - 1])
    same &= (scene.strip[before] != NOWHERE) & (scene.strip[after] != NOWHERE)
    before, after = before[same], after[same]
    turned = np.cumsum(np.remainder(np.diff(scene.h, prepend=scene.h[:1]) + np.pi, 2.0 * np.pi) - np.pi)
    way = np.cumsum(np.hypot(np.diff(scene.x, prepend=scene.x[:1]), np.diff(scene.y, prepend=scene.y[:1])))
    turn = turned[after] - turned[before]
    straight = np.abs(turn) < np.radians(scene.rules.turn[0])
    row = [
        _half(way if goes_straight else turned, start, end)
        for start, end, goes_straight in zip(before.tolist(), after.tolist(), straight.tolist(), strict=True)
    ]
    lights = scene.role[before + 1] == ROLES.index(Role.SIGNALISED)
    origin, target = scene.strip[before], scene.strip[after]
    return Passages(before, after, np.array(row, np.int64), turn, inside[before + 1], lights, origin, target, road_of[origin])


def _numbers(scene: Scene) -> tuple[Whole, Whole]:
    """Number of the junction (NOWHERE for none) and of the road of each strip."""
    roads = scene.site.network.roads
    junctions = {name: number for number, name in enumerate(scene.site.network.junctions)}
    numbers = {name: number for number, name in enumerate(roads)}
    strips = scene.site.lanes.strips
    junction = [junctions.get(roads[strip.road].junction_id or "", NOWHERE) for strip in strips]
    return np.array(junction, np.int64), np.array([numbers[strip.road] for strip in strips], np.int64)


def _half(values: Floats, start: int, end: int) -> int:
    """The first row at which half of the change of a value from one row to another is done."""
    share = (values[start : end + 1] - values[start]) / (values[end] - values[start] or 1.0)
    return start + int(np.argmax(share >= 0.5))
