"""Rules for junctions and roundabouts: turns, crossings, mergings, entering, circulating, exiting."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from recognition.labels.changes import always, held, stays
from recognition.labels.classes import Label
from recognition.labels.scene import ABSENT, Hits, Scene, alone, spaced
from recognition.sites import Role
from recognition.sites.lanes import NOWHERE
from recognition.sites.roles import ROLES
from schemas.common.array_types import BoolArray, FloatArray, IntArray

if TYPE_CHECKING:
    from shapely import LineString

REACH = 2.0
"""Places less than this apart (m) are the same place."""


def time_apart(
    x: FloatArray, y: FloatArray, time: FloatArray, track: IntArray, others: tuple[FloatArray, FloatArray, FloatArray, IntArray]
) -> FloatArray:
    """Least time between each of n visits and one of another track at the same place, s; infinite without such a visit.

    Args:
        x, y, time, track: of the visits (n,).
        others: the same of all rows that count.
    """
    from scipy.spatial import cKDTree

    there_x, there_y, then, who = others
    apart = np.full(len(x), np.inf)
    if not len(x) or not len(there_x):
        return apart
    here, there = (cKDTree(np.stack(points, axis=1)) for points in ((x, y), (there_x, there_y)))
    near = here.sparse_distance_matrix(there, REACH, output_type="ndarray")
    visit, other = near["i"], near["j"]
    foreign = who[other] != track[visit]
    visit, other = visit[foreign], other[foreign]
    np.minimum.at(apart, visit, np.abs(time[visit] - then[other]))
    return apart


_OPPOSITE = -0.87
"""Cosine of the least angle between headings from opposite sides: 150 degrees."""


def left_turn(scene: Scene) -> Hits:
    """14: the heading changes to the left as `rules.turn` says."""
    least, greatest = np.radians(scene.rules.turn)
    turn = scene.passages.turn
    return _turn(scene, Label.LEFT_TURN, (turn >= least) & (turn <= greatest))


def right_turn(scene: Scene) -> Hits:
    """15: the heading changes to the right as `rules.turn` says."""
    least, greatest = np.radians(scene.rules.turn)
    turn = -scene.passages.turn
    return _turn(scene, Label.RIGHT_TURN, (turn >= least) & (turn <= greatest))


def straight_cross(scene: Scene) -> Hits:
    """16: the heading hardly changes, and the way crosses one that another participant took in this recording."""
    straight = np.abs(scene.passages.turn) < np.radians(scene.rules.straight)
    return _turn(scene, Label.STRAIGHT_CROSS, straight & crosses(scene))


def merging(scene: Scene) -> Hits:
    """17: a vehicle from elsewhere comes into the same lane behind the junction shortly before or after ego."""
    passages = scene.passages
    gap, partner = _arrivals(scene)
    chosen = np.flatnonzero(_merges(scene, gap))
    return Hits(Label.MERGING, passages.last[chosen], passages.last[partner[chosen]], {"arrival_gap": gap[chosen]})


def _merges(scene: Scene, gap: FloatArray) -> BoolArray:
    """Passages that are events of merging, given the times between arrivals."""
    return _counting(scene) & (gap < scene.rules.merging_gap) & scene.complete[scene.passages.last]


def _arrivals(scene: Scene) -> tuple[FloatArray, IntArray]:
    """Return the time to the nearest arrival from another road in the same lane, for each passage, and that passage.

    Returns:
        Least time between the arrivals (n,), s, infinite for none; index of the other passage (n,), ABSENT for none.
    """
    passages, time = scene.passages, scene.time[scene.passages.last]
    gap, partner = np.full(len(passages), np.inf), np.full(len(passages), ABSENT, np.int64)
    arriving = passages.arrived & (passages.origin_road != NOWHERE)
    for target in np.unique(passages.target[arriving]).tolist():
        mine = np.flatnonzero(arriving & (passages.target == target))
        apart = np.abs(time[mine][:, None] - time[mine])
        apart[passages.origin_road[mine][:, None] == passages.origin_road[mine]] = np.inf
        if (apart < scene.rules.merging_gap).any():
            apart[_same_way(scene, mine)] = np.inf
        nearest = apart.argmin(axis=1)
        gap[mine], partner[mine] = apart[np.arange(len(mine)), nearest], mine[nearest]
    return gap, partner


def _same_way(scene: Scene, which: IntArray) -> BoolArray:
    """Which pairs of passages come the same way, whatever roads overlap there: one begins on the way of the other."""
    from shapely import distance, points

    first = scene.passages.first[which]
    begins = points(scene.x[first], scene.y[first])
    on_way = distance(begins[:, None], np.array(_lines(scene, which))) < REACH
    return on_way | on_way.T


def _lines(scene: Scene, which: IntArray) -> list[LineString]:
    """The ways of passages."""
    from shapely import LineString

    rows = map(scene.passages.rows, which.tolist())
    return [LineString(np.stack([scene.x[each], scene.y[each]], axis=1)) for each in rows]


def _turn(scene: Scene, label: Label, chosen: BoolArray) -> Hits:
    passages = scene.passages
    merges = _merges(scene, _arrivals(scene)[0])
    found = np.flatnonzero(chosen & _counting(scene) & ~merges & scene.complete[passages.row])
    tags = {"opposing": _opposing(scene)[found], "vru_conflict": _vru_conflict(scene, found)}
    return alone(label, passages.row[found], turn=np.degrees(passages.turn[found]), **tags)


def _counting(scene: Scene) -> BoolArray:
    return ~scene.passages.signalised | scene.rules.signalised


def crosses(scene: Scene) -> BoolArray:
    """Passages whose way crosses one from another road to another road: the longest passage of each stands for all."""
    from shapely import STRtree

    passages = scene.passages
    lines = _lines(scene, np.arange(len(passages)))
    longest: dict[tuple[int, int], int] = {}
    for index, way in enumerate(zip(passages.origin_road.tolist(), passages.target.tolist(), strict=True)):
        if NOWHERE not in way and (way not in longest or lines[index].length > lines[longest[way]].length):
            longest[way] = index
    found = np.zeros(len(passages), bool)
    if not longest:
        return found
    used = np.array(list(longest.values()), np.int64)
    mine, theirs = STRtree([lines[index] for index in used]).query(lines, predicate="intersects")
    theirs = used[theirs]
    target_road = np.where(passages.target != NOWHERE, scene.site.lanes.road[passages.target], NOWHERE)
    other = (passages.origin_road[mine] != passages.origin_road[theirs]) & (target_road[mine] != target_road[theirs])
    found[mine[other & (passages.origin_road[mine] != NOWHERE)]] = True
    return found


def _opposing(scene: Scene) -> BoolArray:
    """Passages during which a vehicle comes through the same junction from the other side."""
    passages = scene.passages
    time, heading = scene.time[passages.row], scene.h[passages.first]
    found = np.zeros(len(passages), bool)
    for junction in np.unique(passages.junction).tolist():
        mine = np.flatnonzero(passages.junction == junction)
        near = np.abs(time[mine][:, None] - time[mine]) <= scene.rules.opposing_time
        found[mine] = (near & (np.cos(heading[mine][:, None] - heading[mine]) < _OPPOSITE)).any(axis=1)
    return found


def _vru_conflict(scene: Scene, found: IntArray) -> BoolArray:
    """Passages on whose way a pedestrian or cyclist was shortly before or after ego."""
    rows = [scene.passages.rows(index) for index in found.tolist()]
    passage = np.repeat(np.arange(len(rows)), [len(one) for one in rows])
    visit = np.concatenate([np.arange(0), *rows])
    apart = time_apart(scene.x[visit], scene.y[visit], scene.time[visit], scene.track[visit], scene.vulnerable)
    least = np.full(len(rows), np.inf)
    np.minimum.at(least, passage, apart)
    return least < scene.rules.vru_pet


def roundabout_entering(scene: Scene) -> Hits:
    """11: from an entry lane into the ring."""
    row = _transitions(scene, Role.ENTRY, Role.RING)
    return alone(Label.ROUNDABOUT_ENTERING, row, yields=_yields(scene, row))


def roundabout_exiting(scene: Scene) -> Hits:
    """12: from the ring into an exit lane."""
    row = _transitions(scene, Role.RING, Role.EXIT)
    return alone(Label.ROUNDABOUT_EXITING, row, speed=scene.speed[row])


def roundabout_circulating(scene: Scene) -> Hits:
    """13: in the ring for the whole window and half a window before and after, so that it is apart from entering and exiting."""
    rules = scene.rules
    inside = scene.complete & always(_roles(scene) == ROLES.index(Role.RING), scene.rows(rules.window), scene.first, scene.last)
    row = spaced(scene, inside, rules.ring_spacing, rules.most_windows)
    return alone(Label.ROUNDABOUT_CIRCULATING, row, speed=scene.speed[row])


def _roles(scene: Scene) -> IntArray:
    """Roles without short stays: where lanes of a junction overlap, rows may jump between them."""
    return held(scene.role, scene.first, scene.rows(scene.rules.flicker))


def _transitions(scene: Scene, before: Role, after: Role) -> IntArray:
    roles = _roles(scene)
    start, _ = stays(roles, scene.first)
    row = start[1:][scene.first[start[1:]] == scene.first[start[1:] - 1]]
    row = row[(roles[row - 1] == ROLES.index(before)) & (roles[row] == ROLES.index(after))]
    return row[scene.complete[row]]


def _yields(scene: Scene, row: IntArray) -> BoolArray:
    """Whether ego was slow before it entered, or a vehicle in the ring was soon before or after it at the same place."""
    rules = scene.rules
    earlier = np.maximum(row[:, None] - np.arange(scene.rows(rules.yield_time) + 1), scene.first[row][:, None])
    slow = scene.speed[earlier].min(axis=1, initial=np.inf) < rules.yield_speed
    ring = np.flatnonzero(scene.has_role(Role.RING))
    others = scene.x[ring], scene.y[ring], scene.time[ring], scene.track[ring]
    apart = time_apart(scene.x[row], scene.y[row], scene.time[row], scene.track[row], others)
    return slow | (apart < rules.yield_time)
