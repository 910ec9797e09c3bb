"""Rules of the 17 classes: lanes and other vehicles on roads, then junctions and roundabouts."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from recognition.labels.changes import (
    Changes,
    always,
    at_ends,
    constant,
    deviation,
    held,
    smoothed,
    stays,
    totals,
)
from recognition.labels.classes import Label
from recognition.labels.scene import ABSENT, Hits, Scene, ahead_of, alone, near, spaced, spread
from recognition.scenes import LaneRole
from recognition.scenes.lanes import NOWHERE
from recognition.scenes.roles import ROLES
from schemas.common.array_types import BoolArray, FloatArray, IntArray

if TYPE_CHECKING:
    from shapely import LineString


class Cuts(NamedTuple):
    """Ego's row at t*, the row of the vehicle changing lane in that frame, and the gap (m) between
    them along the lane."""

    ego: IntArray
    other: IntArray
    gap: FloatArray

    def where(self, chosen: BoolArray) -> Cuts:
        """Return a subset of the rows."""
        return Cuts(self.ego[chosen], self.other[chosen], self.gap[chosen])


def cut_ins(scene: Scene) -> Cuts:
    """Return the vehicles from another lane that become the ego's lead within `rules.cut_gap` while
    the ego keeps its lane."""
    other, moves = _movers(scene)
    # `ego - 1` is the same track one frame earlier: `_concerned` keeps rows whose window is
    # complete.
    ego = scene.leads.follower[other]
    gap = scene.leads.gap[ego]
    new = (ego != ABSENT) & (_lead_track(scene, ego - 1) != scene.track[other])
    good = new & _concerned(scene, ego) & moves & (gap >= 0.0) & (gap <= scene.rules.cut_gap)
    found = Cuts(ego, other, gap).where(good)
    return found.where(_in_the_way(scene, found.ego, found, 1))


def cut_outs(scene: Scene) -> Cuts:
    """Ego's lead, within `rules.cut_gap`, leaves the lane; after that another vehicle or none is
    the lead.

    It changes to another lane, or turns off the road beside junctions.
    """
    other, moves = _movers(scene)
    # A leader that turns into a driveway leaves the lane without a change of lane.
    off = scene.exits.row[scene.exits.leaves & scene.exits.beside]
    other, moves = np.append(other, off), np.append(moves, np.ones(len(off), bool))
    before = scene.leads.follower[other - 1]
    ego, gap = before + 1, scene.leads.gap[before]
    seen = (before != ABSENT) & (ego <= scene.last[before])
    ego = np.where(seen, ego, 0)
    good = seen & (_lead_track(scene, ego) != scene.track[other])
    good &= _concerned(scene, ego) & moves & (gap >= 0.0) & (gap <= scene.rules.cut_gap)
    found = Cuts(ego, other, gap).where(good)
    return found.where(_in_the_way(scene, found.ego - 1, found, -1))


def _in_the_way(scene: Scene, row: IntArray, cuts: Cuts, step: int) -> BoolArray:
    """Whether the other, while it is the ego's lead, is ever in the way of the ego's box.

    A car in the lane always is. A bicycle at the edge of the lane is the lead on that lane, and yet
    beside the ego.

    Args:
        row: rows of the ego from which on the other is its lead, forwards (step 1) or backwards
            (-1) in time, within `rules.shift_time`.
    """
    steps = step * np.arange(scene.rows(scene.rules.shift_time) + 1)
    rows = np.clip(row[:, None] + steps, scene.first[row][:, None], scene.last[row][:, None])
    lead = scene.leads.row[rows]
    same = (lead != ABSENT) & (scene.track[lead] == scene.track[cuts.other][:, None])
    apart = np.abs(scene.offset[rows] - scene.offset[lead])
    narrow = np.array(
        [scene.recording.tracks[name].category in _TWO_WHEELERS for name in scene.names], bool
    )[scene.track[cuts.other]]
    return ~narrow | (same & (apart < 0.5 * (scene.width[rows] + scene.width[lead]))).any(axis=1)


_TWO_WHEELERS = ("bicycle", "motorbike")
"""Categories of vehicles that may be beside another one in its lane"""


def lateral_gap(scene: Scene, cuts: Cuts) -> FloatArray:
    """Distance between the sides of ego's and the other's box across the lane at t*, m."""
    apart = np.abs(scene.offset[cuts.ego] - scene.offset[cuts.other])
    return np.maximum(apart - 0.5 * (scene.width[cuts.ego] + scene.width[cuts.other]), 0.0)


def least_ttc(scene: Scene, cuts: Cuts) -> FloatArray:
    """Least TTC with the other within `rules.reaction` from t*, s; infinite where it is never
    defined."""
    rows = ahead_of(scene, cuts.ego, scene.rules.reaction)
    leads = scene.leads
    same = (leads.row[rows] != ABSENT) & (
        scene.track[leads.row[rows]] == scene.track[cuts.other][:, None]
    )
    return np.where(same & leads.ttc.valid[rows], leads.ttc.value[rows], np.inf).min(
        axis=1, initial=np.inf
    )


def brakes(scene: Scene, cuts: Cuts) -> BoolArray:
    """Whether ego brakes harder than `rules.braking` within `rules.reaction` from t*."""
    rows = ahead_of(scene, cuts.ego, scene.rules.reaction)
    return scene.acceleration[rows].min(axis=1, initial=np.inf) <= scene.rules.braking


def _lead_track(scene: Scene, row: IntArray) -> IntArray:
    lead = scene.leads.row[row]
    return np.where(lead == ABSENT, ABSENT, scene.track[lead])


def _concerned(scene: Scene, row: IntArray) -> BoolArray:
    """Rows of driving egos that change lane neither then nor within `rules.reaction`; a standing
    ego has no headway."""
    # If the ego changes lanes itself, the lead is new because of that.
    own = np.append(scene.changes.row, scene.changes.partial.row)
    kept = scene.steady(0.5 * scene.rules.window)[row] & ~near(
        scene, row, own, scene.rules.reaction
    )
    return kept & scene.complete[row] & (scene.speed[row] >= scene.rules.cut_speed)


def _movers(scene: Scene) -> tuple[IntArray, BoolArray]:
    """Rows of changes of lane, also of those recorded in part outside of junctions.

    Returns:
        The rows; whether the vehicle drives, with as much of a displacement as changes recorded in
        part need.
    """
    changes, part = scene.changes, scene.changes.partial
    # In junctions lanes overlap: a partial change there may be a jump between lanes.
    only = (
        ~np.isin(part.row, changes.row)
        & _between_through(scene, part.row)
        & ~scene.in_junction[scene.strip[part.row]]
    )
    row, shift = np.append(changes.row, part.row[only]), np.append(changes.shift, part.shift[only])
    return row, (shift >= scene.least_shift(row)) & (scene.speed[row] >= scene.rules.cut_speed)


def free_cruise(scene: Scene) -> Hits:
    """1: steady speed on one lane, without a lead or with one far ahead, in the window and its
    margins.

    A standing vehicle has no headway.
    """
    rules = scene.rules
    near, _ = _followed(scene)
    calm = (np.abs(scene.acceleration) < rules.cruise_acceleration) & (
        scene.speed >= rules.cruise_speed
    )
    seconds = 0.5 * rules.window + rules.margin
    half = scene.rows(seconds)
    flags = _steady_on(scene, seconds, LaneRole.MAIN)
    flags &= always(~near & calm, half, scene.first, scene.last)
    # Small accelerations of one sign add up to another speed: the deviation bounds their sum.
    flags &= deviation(scene.speed, half, scene.first, scene.last) < rules.cruise_speed_deviation
    # Hours of cruising would outnumber all other events: windows are taken apart, and a few of a
    # track.
    row = spaced(scene, flags, rules.spacing, rules.most_windows)
    return alone(Label.FREE_CRUISE, row, speed=scene.speed[row])


def car_following(scene: Scene) -> Hits:
    """2: the same lead on one lane of a motorway, at a headway of at most
    `rules.following_headway` or a gap of a queue, in the window and its margins."""
    rules, leads = scene.rules, scene.leads
    seconds = 0.5 * rules.window + rules.following_margin
    half = scene.rows(seconds)
    near, lead = _followed(scene)
    queue = (leads.row != ABSENT) & (leads.gap > 0.0) & (leads.gap <= rules.queue_gap)
    near |= held(queue.astype(np.int64), scene.first, scene.rows(rules.flicker)).astype(bool)
    speed = smoothed(scene.speed, half, scene.first, scene.last)
    seen = leads.row != ABSENT
    gaps, number = (totals(each, half, scene.first, scene.last)[0] for each in (leads.gap, seen))
    flags = (
        _steady_on(scene, seconds, *_MOTORWAY)
        & always(near, half, scene.first, scene.last)
        & constant(lead, half, scene.first, scene.last)
        & (speed >= rules.queue_speed)
        & (gaps <= rules.following_headway * speed * number)
        & (lead != ABSENT)
    )
    row = spread(scene, flags, lead, rules.spacing, rules.most_windows)
    # Another lead may flicker just then: the row before it has the partner.
    here = np.arange(len(lead))
    row = np.maximum.accumulate(np.where(lead == _lead_track(scene, here), here, 0))[row]
    closing = leads.ttc.valid[row] & (leads.ttc.value[row] < rules.following_ttc)
    return Hits(
        Label.CAR_FOLLOWING,
        row,
        leads.row[row],
        {"gap": leads.gap[row], "thw": leads.thw.value[row], "ttc_below_4s": closing},
    )


_MOTORWAY = (LaneRole.MAIN, LaneRole.ON_RAMP, LaneRole.OFF_RAMP, LaneRole.WEAVING)
"""Roles of the lanes of motorways"""


def _followed(scene: Scene) -> tuple[BoolArray, IntArray]:
    """Return whether a lead is within `rules.following_headway`, and its track (ABSENT for none).

    Leads for less than `rules.flicker` are left out: sensors see vehicles for single frames.
    """
    leads, rules = scene.leads, scene.rules
    near = leads.thw.valid & (leads.thw.value > 0.0) & (leads.thw.value <= rules.following_headway)
    lead, least = _lead_track(scene, np.arange(len(leads.row))), scene.rows(rules.flicker)
    steady = held(lead, scene.first, least)
    # While another vehicle flickers in between, the headway is as it was.
    return held(near.astype(np.int64), scene.first, least).astype(bool), steady


def cut_in(scene: Scene) -> Hits:
    """3: another vehicle changes into ego's lane and becomes its lead."""
    found = _on_main(scene, cut_ins(scene))
    near = lateral_gap(scene, found) < scene.rules.lateral_gap
    return Hits(
        Label.CUT_IN, found.ego, found.other, {"gap": found.gap, "lateral_gap_below_2m": near}
    )


def cut_out(scene: Scene) -> Hits:
    """4: ego's lead leaves the lane."""
    found = _on_main(scene, cut_outs(scene))
    return Hits(
        Label.CUT_OUT,
        found.ego,
        found.other,
        {"gap": found.gap, "ego_brakes": brakes(scene, found)},
    )


def lane_change_left(scene: Scene) -> Hits:
    """5: ego changes to the lane on its left."""
    return _lane_change(scene, Label.LANE_CHANGE_LEFT, left=True)


def lane_change_right(scene: Scene) -> Hits:
    """6: ego changes to the lane on its right."""
    return _lane_change(scene, Label.LANE_CHANGE_RIGHT, left=False)


def _lane_change(scene: Scene, label: Label, *, left: bool) -> Hits:
    """Lane changes to one side; those that were recorded in part have their window where it is
    complete."""
    changes, rules = scene.changes, scene.rules
    row, shift = changes.row, changes.shift
    # By default a share of the lane's width, since widths differ by half; a strict value in m is an
    # option.
    least = (
        rules.shift * scene.lane_width(row) if rules.strict_shift is None else rules.strict_shift
    )
    whole = _between_through(scene, row) & (shift >= least) & scene.complete[row]
    part = changes.partial
    enough = (
        _between_through(scene, part.row)
        & (part.shift >= scene.least_shift(part.row))
        & (part.left == left)
    )
    partial = part.row[enough & ~near(scene, part.row, row[whole], rules.hold)]
    centre = scene.centred(partial)
    fits = scene.complete[centre]
    chosen = whole & (changes.left == left)
    rows, shifts = (
        np.append(row[chosen], centre[fits]),
        np.append(shift[chosen], _of(part, partial[fits])),
    )
    return alone(
        label, rows, shift=shifts, partial=np.arange(len(rows)) >= np.count_nonzero(chosen)
    )


def _between_through(scene: Scene, row: IntArray) -> BoolArray:
    """Whether neither of the lanes that a change leads from and to is a ramp or turns in a
    junction, where lanes overlap.

    A turn through a junction may end on another lane: that is no lane change.
    """
    return scene.through[row] & scene.through[row - 1] & ~scene.turning[row]


def _of(changes: Changes, row: IntArray) -> FloatArray:
    return changes.shift[np.searchsorted(changes.row, row)]


def _steady_on(scene: Scene, seconds: float, *roles: LaneRole) -> BoolArray:
    """Rows of egos that keep one lane of these roles from `seconds` before to `seconds` after, with
    all frames there."""
    kept = always(scene.has_role(*roles), scene.rows(seconds), scene.first, scene.last)
    return kept & scene.steady(seconds) & scene.egos[scene.track]


def _on_main(scene: Scene, found: Cuts) -> Cuts:
    return found.where(scene.has_role(LaneRole.MAIN)[found.ego])


_ROUNDING = 0.01
"""Files round speed limits by less than this, m/s."""


def urban_cut_in(scene: Scene) -> Hits:
    """9: another vehicle changes into ego's lane and becomes its lead; 0 < TTC < `rules.urban_ttc`
    soon after is a tag."""
    found = _on_urban(scene, cut_ins(scene))
    ttc = least_ttc(scene, found)
    near = lateral_gap(scene, found) < scene.rules.lateral_gap
    tags = {"gap": found.gap, "ttc": ttc, "lateral_gap_below_2m": near}
    tags["ttc_below_3s"] = (ttc > 0.0) & (ttc < scene.rules.urban_ttc)
    return Hits(Label.URBAN_CUT_IN, found.ego, found.other, tags)


def urban_cut_out(scene: Scene) -> Hits:
    """10: ego's lead leaves the lane."""
    found = _on_urban(scene, cut_outs(scene))
    return Hits(
        Label.URBAN_CUT_OUT,
        found.ego,
        found.other,
        {"gap": found.gap, "ego_brakes": brakes(scene, found)},
    )


def _on_urban(scene: Scene, found: Cuts) -> Cuts:
    """Return the cuts on urban lanes with a low or unknown limit."""
    limit = scene.site.lanes.speed_limit[scene.strip[found.ego]]
    slow = (limit <= scene.rules.urban_speed_limit + _ROUNDING) | np.isinf(limit)
    return found.where((scene.through & ~scene.has_role(LaneRole.MAIN))[found.ego] & slow)


def ramp_entering(scene: Scene) -> Hits:
    """7: from a ramp, along which ego drove `rules.ramp_length` or more, onto a main lane."""
    ramp = scene.has_role(LaneRole.ON_RAMP, LaneRole.WEAVING)
    row, shift = _transitions(scene, ramp, scene.has_role(LaneRole.MAIN))
    way, begin = _way_on(scene, ramp), _course_ends(scene)[0][row]
    return _hits(scene, Label.RAMP_ENTERING, row, way[row] - way[begin], shift, cut=ramp[begin])


def ramp_exiting(scene: Scene) -> Hits:
    """8: from a main lane onto a ramp, along which ego drives `rules.ramp_length` or more."""
    ramp = scene.has_role(LaneRole.OFF_RAMP, LaneRole.WEAVING)
    row, shift = _transitions(scene, scene.has_role(LaneRole.MAIN), ramp)
    way, end = _way_on(scene, ramp), _course_ends(scene)[1][row]
    return _hits(scene, Label.RAMP_EXITING, row, way[end] - way[row], shift, cut=ramp[end])


def _hits(
    scene: Scene, label: Label, row: IntArray, length: FloatArray, shift: FloatArray, cut: BoolArray
) -> Hits:
    """Transitions with enough way on the ramp, and enough shift; less of both where the recording
    is cut on the ramp."""
    rules = scene.rules
    # The length counts along the ramp: no lateral shift is that long.
    whole = (length >= rules.ramp_length) & (shift >= rules.ramp_shift)
    partial = (
        cut
        & (length >= rules.partial_ramp)
        & (shift >= rules.partial_shift * scene.lane_width(row))
        & ~whole
    )
    row = np.where(partial, scene.centred(row), row)
    good = scene.complete[row] & (whole | partial)
    return alone(label, row[good], ramp_way=length[good], partial=partial[good])


def _transitions(scene: Scene, before: BoolArray, after: BoolArray) -> tuple[IntArray, FloatArray]:
    """First rows after each transition, and the lateral shift of those by a change of lane;
    infinite for the others."""
    changes, part = scene.changes, scene.changes.partial
    # A ramp may turn into a main lane without a change of lane: the course goes on along linked
    # lanes.
    onwards = (
        np.flatnonzero((changes.step[1:] == 0) & (changes.course[1:] == changes.course[:-1])) + 1
    )
    only = ~np.isin(part.row, changes.row)
    rows = np.concatenate([changes.row, part.row[only], onwards])
    shifts = np.concatenate([changes.shift, part.shift[only], np.full(len(onwards), np.inf)])
    good = before[rows - 1] & after[rows]
    return rows[good], shifts[good]


def _way_on(scene: Scene, flags: BoolArray) -> FloatArray:
    """Distance driven so far on rows with a flag, m, summed over all rows."""
    step = np.hypot(np.diff(scene.x, prepend=scene.x[:1]), np.diff(scene.y, prepend=scene.y[:1]))
    inside = np.zeros(len(step), bool)
    inside[1:] = scene.changes.course[1:] == scene.changes.course[:-1]
    return np.cumsum(np.where(inside & flags, step, 0.0))


def _course_ends(scene: Scene) -> tuple[IntArray, IntArray]:
    """First and last row of the course that each row is in."""
    course = scene.changes.course
    return np.searchsorted(course, course, side="left"), np.searchsorted(
        course, course, side="right"
    ) - 1


# junctions and roundabouts ----------------------------------------------------------------------


REACH = 2.0
"""Places less than this apart (m) are the same place."""


def time_apart(
    x: FloatArray,
    y: FloatArray,
    time: FloatArray,
    track: IntArray,
    others: tuple[FloatArray, FloatArray, FloatArray, IntArray],
) -> FloatArray:
    """Least time between each of n visits and one of another track at the same place, s; infinite
    without such a visit.

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
    # Pairs within reach only: the full matrix grows with the square of the rows.
    near = here.sparse_distance_matrix(there, REACH, output_type="ndarray")
    visit, other = near["i"], near["j"]
    foreign = who[other] != track[visit]
    visit, other = visit[foreign], other[foreign]
    # `minimum.at`, since a visit is in several pairs; plain indexing would keep the last one.
    np.minimum.at(apart, visit, np.abs(time[visit] - then[other]))
    return apart


_MOST_INSIDE = 8
"""Most lanes that are followed through a junction."""
_OPPOSITE = -0.87
"""Cosine of the least angle between headings from opposite sides: 150 degrees."""


def left_turn(scene: Scene) -> Hits:
    """14: the heading changes to the left as `rules.turn` says."""
    return _turning(scene, Label.LEFT_TURN, 1.0)


def right_turn(scene: Scene) -> Hits:
    """15: the heading changes to the right as `rules.turn` says."""
    return _turning(scene, Label.RIGHT_TURN, -1.0)


def _turning(scene: Scene, label: Label, side: float) -> Hits:
    """Turns to one side (1: left, -1: right) in junctions, and between lanes and places beside the
    road."""
    least, greatest = np.radians(scene.rules.turn)
    turn, beside = side * scene.passages.turn, scene.side_turns
    found = _turn(scene, label, (turn >= least) & (turn <= greatest))
    off = (
        (side * beside.turn >= least)
        & (side * beside.turn <= greatest)
        & scene.complete[beside.row]
    )
    row, turns = beside.row[off], np.append(found.tags["turn"], np.degrees(beside.turn[off]))
    none = np.zeros(len(row), bool)
    tags = {key: np.append(found.tags[key], none) for key in ("opposing", "vru_conflict")}
    return alone(
        label,
        np.append(found.row, row),
        turn=turns,
        **tags,
        off_road=np.append(np.zeros(len(found.row), bool), ~none),
    )


def straight_cross(scene: Scene) -> Hits:
    """16: the heading hardly changes, or as the road does, and the way crosses that of another
    participant of the recording."""
    turn = np.abs(scene.passages.turn)
    straight = (turn < np.radians(scene.rules.straight)) | (
        (turn < np.radians(scene.rules.turn[0])) & _goes_on(scene)
    )
    return _turn(scene, Label.STRAIGHT_CROSS, straight & crosses(scene))


def _goes_on(scene: Scene) -> BoolArray:
    """Passages that lead to the road to which the straightest lanes lead from where they come."""
    lanes, passages = scene.site.lanes, scene.passages
    ahead = passages.origin
    # A main road may bend inside the junction: "straight" is where its straightest lanes lead.
    for _ in range(_MOST_INSIDE):
        inside = (ahead != NOWHERE) & ((ahead == passages.origin) | scene.in_junction[ahead])
        ahead = np.where(inside, lanes.straight[ahead], ahead)
    known = (ahead != NOWHERE) & (passages.target != NOWHERE) & (passages.origin != NOWHERE)
    return known & (lanes.road[ahead] == lanes.road[passages.target])


def merging(scene: Scene) -> Hits:
    """17: a vehicle from another road enters the same lane behind the junction shortly before or
    after ego."""
    passages = scene.passages
    gap, partner = _arrivals(scene)
    chosen = np.flatnonzero(_merges(scene, gap))
    return Hits(
        Label.MERGING,
        passages.last[chosen],
        passages.last[partner[chosen]],
        {"arrival_gap": gap[chosen]},
    )


def _merges(scene: Scene, gap: FloatArray) -> BoolArray:
    """Passages that are events of merging, given the times between arrivals."""
    return _counting(scene) & (gap < scene.rules.merging_gap) & scene.complete[scene.passages.last]


def _arrivals(scene: Scene) -> tuple[FloatArray, IntArray]:
    """Return the time to the nearest arrival from another road in the same lane, for each passage,
    and that passage.

    Returns:
        Least time between the arrivals (n,), s, infinite for none; index of the other passage (n,),
        ABSENT for none.
    """
    passages, time = scene.passages, scene.time[scene.passages.last]
    gap, partner = np.full(len(passages), np.inf), np.full(len(passages), ABSENT, np.int64)
    arriving = passages.arrived & (passages.origin_road != NOWHERE)
    for target in np.unique(passages.target[arriving]).tolist():
        mine = np.flatnonzero(arriving & (passages.target == target))
        apart = np.abs(time[mine][:, None] - time[mine])
        # From one road they followed each other into the junction already: that is no merging.
        apart[passages.origin_road[mine][:, None] == passages.origin_road[mine]] = np.inf
        # Geometry is compared only where the times allow a merge.
        if (apart < scene.rules.merging_gap).any():
            apart[_same_way(scene, mine)] = np.inf
        nearest = apart.argmin(axis=1)
        gap[mine], partner[mine] = apart[np.arange(len(mine)), nearest], mine[nearest]
    return gap, partner


def _same_way(scene: Scene, which: IntArray) -> BoolArray:
    """Mask of pairs of passages on one way, on any roads that overlap there: one begins on the way
    of the other."""
    from shapely import distance, points

    first = scene.passages.first[which]
    begins = points(scene.x[first], scene.y[first])
    on_way = distance(begins[:, None], np.array(_lines(scene, which))) < REACH
    return on_way | on_way.T


def _lines(scene: Scene, which: IntArray) -> list[LineString]:
    """The ways of passages."""
    from shapely import LineString

    rows = map(scene.passages.rows, which.tolist())
    return [LineString(np.stack([scene.x[way], scene.y[way]], axis=1)) for way in rows]


def _turn(scene: Scene, label: Label, chosen: BoolArray) -> Hits:
    passages = scene.passages
    # Merging wins over turns and crossing, as in `PRECEDENCE`.
    merges = _merges(scene, _arrivals(scene)[0])
    found = np.flatnonzero(chosen & _counting(scene) & ~merges & scene.complete[passages.row])
    tags = {"opposing": _opposing(scene)[found], "vru_conflict": _vru_conflict(scene, found)}
    return alone(label, passages.row[found], turn=np.degrees(passages.turn[found]), **tags)


def _counting(scene: Scene) -> BoolArray:
    return ~scene.passages.signalised | scene.rules.signalised


def crosses(scene: Scene) -> BoolArray:
    """Passages that cross a way between two other roads, at `rules.straight` or
    more: of each way its longest passage is compared."""
    from shapely import STRtree

    passages = scene.passages
    lines = _lines(scene, np.arange(len(passages)))
    # One way for each pair of roads: hundreds of vehicles take the same one.
    longest: dict[tuple[int, int], int] = {}
    for index, way in enumerate(
        zip(passages.origin_road.tolist(), passages.target.tolist(), strict=True)
    ):
        if NOWHERE not in way and (
            way not in longest or lines[index].length > lines[longest[way]].length
        ):
            longest[way] = index
    found = np.zeros(len(passages), bool)
    if not longest:
        return found
    used = np.array(list(longest.values()), np.int64)
    mine, theirs = STRtree([lines[index] for index in used]).query(lines, predicate="intersects")
    theirs = used[theirs]
    target_road = np.where(
        passages.target != NOWHERE, scene.site.lanes.road[passages.target], NOWHERE
    )
    other = (
        (passages.origin_road[mine] != passages.origin_road[theirs])
        & (target_road[mine] != target_road[theirs])
        & (passages.origin_road[mine] != NOWHERE)
    )
    mine, theirs = mine[other], theirs[other]
    across = [
        _angle(lines[a], lines[b]) for a, b in zip(mine.tolist(), theirs.tolist(), strict=True)
    ]
    # Ways that touch at a small angle join or part, or go on as one another: through two junctions,
    # a vehicle meets its own way where the first one ends.
    found[mine[np.sin(across) >= np.sin(np.radians(scene.rules.straight))]] = True
    return found


def _angle(mine: LineString, theirs: LineString) -> float:
    """Angle between two ways where they first meet, rad, from 0 to π."""
    from shapely import Point, get_coordinates

    met = Point(get_coordinates(mine.intersection(theirs))[0])
    headings = []
    for line in (mine, theirs):
        at = line.project(met)
        a, b = line.interpolate(max(at - _CHORD, 0.0)), line.interpolate(at + _CHORD)
        headings.append(np.arctan2(b.y - a.y, b.x - a.x))
    return abs(float(np.remainder(headings[0] - headings[1] + np.pi, 2.0 * np.pi) - np.pi))


_CHORD = 1.0
"""Way (m) before and behind a place over which the direction of a way is taken"""


def _opposing(scene: Scene) -> BoolArray:
    """Mask of passages during which a vehicle crosses the same junction from the opposite side."""
    passages = scene.passages
    time, heading = scene.time[passages.row], scene.h[passages.first]
    found = np.zeros(len(passages), bool)
    for junction in np.unique(passages.junction).tolist():
        mine = np.flatnonzero(passages.junction == junction)
        near = np.abs(time[mine][:, None] - time[mine]) <= scene.rules.opposing_time
        found[mine] = (near & (np.cos(heading[mine][:, None] - heading[mine]) < _OPPOSITE)).any(
            axis=1
        )
    return found


def _vru_conflict(scene: Scene, found: IntArray) -> BoolArray:
    """Passages of a place where a pedestrian or cyclist was shortly before or after ego."""
    rows = [scene.passages.rows(index) for index in found.tolist()]
    passage = np.repeat(np.arange(len(rows)), [len(one) for one in rows])
    visit = np.concatenate([np.arange(0), *rows])
    apart = time_apart(
        scene.x[visit], scene.y[visit], scene.time[visit], scene.track[visit], scene.vulnerable
    )
    least = np.full(len(rows), np.inf)
    np.minimum.at(least, passage, apart)
    return least < scene.rules.vru_pet


def roundabout_entering(scene: Scene) -> Hits:
    """11: from an entry lane into the ring."""
    row = _passages_between(scene, LaneRole.ENTRY, LaneRole.RING)
    return alone(Label.ROUNDABOUT_ENTERING, row, yields=_yields(scene, row))


def roundabout_exiting(scene: Scene) -> Hits:
    """12: from the ring into an exit lane."""
    row = _passages_between(scene, LaneRole.RING, LaneRole.EXIT)
    return alone(Label.ROUNDABOUT_EXITING, row, speed=scene.speed[row])


def roundabout_circulating(scene: Scene) -> Hits:
    """13: in the ring for the whole window and half a window before and after, so that it is apart
    from entering and exiting."""
    rules = scene.rules
    inside = scene.complete & always(
        _roles(scene) == ROLES.index(LaneRole.RING),
        scene.rows(rules.window),
        scene.first,
        scene.last,
    )
    row = spaced(scene, inside, rules.ring_spacing, rules.most_windows)
    return alone(Label.ROUNDABOUT_CIRCULATING, row, speed=scene.speed[row])


def _roles(scene: Scene) -> IntArray:
    """Roles without short stays: where lanes of a junction overlap, rows may jump between them. At
    the ends of a track, which may be cut, `rules.partial_hold` is long enough."""
    least = scene.rows(scene.rules.flicker)
    return held(scene.role, scene.first, at_ends(scene, scene.role, scene.first, least))


def _passages_between(scene: Scene, before: LaneRole, after: LaneRole) -> IntArray:
    roles = _roles(scene)
    start, _ = stays(roles, scene.first)
    row = start[1:][scene.first[start[1:]] == scene.first[start[1:] - 1]]
    row = row[(roles[row - 1] == ROLES.index(before)) & (roles[row] == ROLES.index(after))]
    # Near the ends of a track the window is the nearest whole one.
    row = scene.centred(row)
    return row[scene.complete[row]]


def _yields(scene: Scene, row: IntArray) -> BoolArray:
    """Whether ego was slow before it entered, or a vehicle in the ring was soon before or after it
    at the same place."""
    rules = scene.rules
    earlier = np.maximum(
        row[:, None] - np.arange(scene.rows(rules.yield_time) + 1), scene.first[row][:, None]
    )
    slow = scene.speed[earlier].min(axis=1, initial=np.inf) < rules.yield_speed
    ring = np.flatnonzero(scene.has_role(LaneRole.RING))
    others = scene.x[ring], scene.y[ring], scene.time[ring], scene.track[ring]
    apart = time_apart(scene.x[row], scene.y[row], scene.time[row], scene.track[row], others)
    return slow | (apart < rules.yield_time)
