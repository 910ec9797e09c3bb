"""Ways through junctions: from which lane into which, with how much of a turn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from recognition.labels.scene.rows import SceneRows
from recognition.labels.scene.stays import held, stays
from recognition.sites.lanes import NOWHERE
from recognition.sites.roles import ROLES, Role
from xodr.array_types import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Passages:
    """Ways through junctions, in the order of their rows; also of tracks that begin or end inside.

    Attributes:
        first, last: first and last row: those beside the junction, or those inside where the track begins or ends.
        arrived: whether the last row is behind the junction.
        row: the middle: half of the turn is done there, or, of a straight way, half of the way.
        turn: change of heading, rad, positive to the left.
        junction: number of the junction.
        signalised: whether it has traffic lights.
        origin, target: strips before and behind the junction, NOWHERE where neither track nor map tell.
        origin_road: number of the road of the origin, NOWHERE likewise.
    """

    first: IntArray
    last: IntArray
    arrived: BoolArray
    row: IntArray
    turn: FloatArray
    junction: IntArray
    signalised: BoolArray
    origin: IntArray
    target: IntArray
    origin_road: IntArray

    def __len__(self) -> int:
        return len(self.row)

    def rows(self, index: int) -> IntArray:
        """All rows of one of them."""
        return np.arange(self.first[index], self.last[index] + 1)


def passages(scene: SceneRows) -> Passages:
    """The ways of all tracks through junctions, of `rules.passage` at least."""
    junction_of, road_of = _junctions(scene), scene.site.lanes.road
    inside = np.where(scene.has_role(Role.INSIDE, Role.SIGNALISED), junction_of[scene.strip], NOWHERE)
    inside = held(inside, scene.track, scene.rows(scene.rules.flicker))
    start, size = stays(inside, scene.track)
    way = np.cumsum(np.hypot(np.diff(scene.x, prepend=scene.x[:1]), np.diff(scene.y, prepend=scene.y[:1])))
    chosen = (inside[start] != NOWHERE) & (way[start + size - 1] - way[start] >= scene.rules.passage)
    start, end = start[chosen], (start + size - 1)[chosen]
    entered, arrived = _same_track(scene, start, -1), _same_track(scene, end, 1)
    first, last = start - entered, end + arrived
    turned = np.cumsum(np.remainder(np.diff(scene.h, prepend=scene.h[:1]) + np.pi, 2.0 * np.pi) - np.pi)
    turn = turned[last] - turned[first]
    straight = np.abs(turn) < np.radians(scene.rules.turn[0])
    middle = [
        _half(way if goes_straight else turned, a, b)
        for a, b, goes_straight in zip(first.tolist(), last.tolist(), straight.tolist(), strict=True)
    ]
    origin = np.where(entered, scene.strip[first], _neighbours(scene.site.lanes.preceding, scene.strip[first]))
    target = np.where(arrived, scene.strip[last], _neighbours(scene.site.lanes.following, scene.strip[last]))
    lights = scene.role[start] == ROLES.index(Role.SIGNALISED)
    roads = np.where(origin != NOWHERE, road_of[origin], NOWHERE)
    return Passages(first, last, arrived, np.array(middle, np.int64), turn, inside[start], lights, origin, target, roads)


def _same_track(scene: SceneRows, row: IntArray, step: int) -> BoolArray:
    """Whether the row before (step -1) or after (1) each row is of the same track."""
    other = row + step
    there = (other >= 0) & (other < len(scene.track))
    return there & (scene.track[np.where(there, other, 0)] == scene.track[row])


def _neighbours(links: list[list[int]], strip: IntArray) -> IntArray:
    """The strip that each one is linked to, or NOWHERE."""
    linked = np.array([found[0] if found else NOWHERE for found in links], np.int64)
    return np.where(strip != NOWHERE, linked[strip], NOWHERE)


def _junctions(scene: SceneRows) -> IntArray:
    """Number of the junction of each strip, NOWHERE for none."""
    network = scene.site.network
    numbers = {name: number for number, name in enumerate(network.junctions)}
    found = [numbers.get(network.roads[strip.road].junction_id or "", NOWHERE) for strip in scene.site.lanes.strips]
    return np.array(found, np.int64)


def _half(values: FloatArray, start: int, end: int) -> int:
    """The first row at which half of the change of a value from one row to another is done."""
    share = (values[start : end + 1] - values[start]) / (values[end] - values[start] or 1.0)
    return start + int(np.argmax(share >= 0.5))
