"""Rules for lanes: free cruise, car following, lane changes, cut-ins and cut-outs on motorways and in town, and ramps."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from recognition.labels.changes import Changes, always, constant, deviation
from recognition.labels.classes import Label
from recognition.labels.scene import ABSENT, Hits, Scene, ahead_of, alone, near, spaced
from recognition.sites import Role
from schemas.common.array_types import BoolArray, FloatArray, IntArray


class Cuts(NamedTuple):
    """Ego's row at t*, the row of the vehicle changing lane in that frame, and the gap (m) between them along the lane."""

    ego: IntArray
    other: IntArray
    gap: FloatArray

    def where(self, chosen: BoolArray) -> Cuts:
        """Some of them."""
        return Cuts(self.ego[chosen], self.other[chosen], self.gap[chosen])


def cut_ins(scene: Scene) -> Cuts:
    """Return the vehicles from another lane that become the ego's lead within `rules.cut_gap` while the ego keeps its lane."""
    other = scene.changes.row
    ego = scene.leads.follower[other]
    gap = scene.leads.gap[ego]
    new = (ego != ABSENT) & (_lead_track(scene, ego - 1) != scene.track[other])
    good = new & _concerned(scene, ego) & _leaves(scene) & (gap >= 0.0) & (gap <= scene.rules.cut_gap)
    return Cuts(ego, other, gap).where(good)


def cut_outs(scene: Scene) -> Cuts:
    """Ego's lead, within `rules.cut_gap`, changes to another lane; after that another vehicle or none is the lead."""
    other = scene.changes.row
    before = scene.leads.follower[other - 1]
    ego, gap = before + 1, scene.leads.gap[before]
    seen = (before != ABSENT) & (ego <= scene.last[before])
    ego = np.where(seen, ego, 0)
    good = seen & (_lead_track(scene, ego) != scene.track[other])
    good &= _concerned(scene, ego) & _leaves(scene) & (gap >= 0.0) & (gap <= scene.rules.cut_gap)
    return Cuts(ego, other, gap).where(good)


def lateral_gap(scene: Scene, cuts: Cuts) -> FloatArray:
    """Distance between the sides of ego's and the other's box across the lane at t*, m."""
    apart = np.abs(scene.offset[cuts.ego] - scene.offset[cuts.other])
    return np.maximum(apart - 0.5 * (scene.width[cuts.ego] + scene.width[cuts.other]), 0.0)


def least_ttc(scene: Scene, cuts: Cuts) -> FloatArray:
    """Least TTC with the other within `rules.reaction` from t*, s; infinite where it is never defined."""
    rows = ahead_of(scene, cuts.ego, scene.rules.reaction)
    leads = scene.leads
    same = (leads.row[rows] != ABSENT) & (scene.track[leads.row[rows]] == scene.track[cuts.other][:, None])
    return np.where(same & leads.ttc.valid[rows], leads.ttc.value[rows], np.inf).min(axis=1, initial=np.inf)


def brakes(scene: Scene, cuts: Cuts) -> BoolArray:
    """Whether ego brakes harder than `rules.braking` within `rules.reaction` from t*."""
    rows = ahead_of(scene, cuts.ego, scene.rules.reaction)
    return scene.acceleration[rows].min(axis=1, initial=np.inf) <= scene.rules.braking


def _lead_track(scene: Scene, row: IntArray) -> IntArray:
    lead = scene.leads.row[row]
    return np.where(lead == ABSENT, ABSENT, scene.track[lead])


def _concerned(scene: Scene, row: IntArray) -> BoolArray:
    """Rows of driving egos that change lane neither then nor within `rules.reaction`; a standing ego has no headway."""
    own = np.append(scene.changes.row, scene.changes.partial.row)
    kept = scene.steady(0.5 * scene.rules.window)[row] & ~near(scene, row, own, scene.rules.reaction)
    return kept & scene.complete[row] & (scene.speed[row] >= scene.rules.cut_speed)


def _leaves(scene: Scene) -> BoolArray:
    """Which changes of lane are of vehicles that drive, with as much of a displacement as those recorded in part need."""
    row = scene.changes.row
    return (scene.changes.shift >= scene.least_shift(row)) & (scene.speed[row] >= scene.rules.cut_speed)


def free_cruise(scene: Scene) -> Hits:
    """1: steady speed on one lane, without a lead or with one far ahead, in the window and its margins.

    A standing vehicle has no headway.
    """
    rules = scene.rules
    far = ~scene.leads.thw.valid | (scene.leads.thw.value > rules.following_headway)
    calm = (np.abs(scene.acceleration) < rules.cruise_acceleration) & (scene.speed >= rules.cruise_speed)
    half = scene.rows(0.5 * rules.window + rules.margin)
    flags = _steady_on_main(scene) & always(far & calm, half, scene.first, scene.last)
    flags &= deviation(scene.speed, half, scene.first, scene.last) < rules.cruise_speed_deviation
    row = spaced(scene, flags, rules.spacing, rules.most_windows)
    return alone(Label.FREE_CRUISE, row, speed=scene.speed[row])


def car_following(scene: Scene) -> Hits:
    """2: the same lead on one lane, at a headway of at most `rules.following_headway`, in the window and its margins."""
    rules, leads = scene.rules, scene.leads
    half = scene.rows(0.5 * rules.window + rules.margin)
    near = leads.thw.valid & (leads.thw.value > 0.0) & (leads.thw.value <= rules.following_headway)
    lead = np.where(leads.row == ABSENT, ABSENT, scene.track[leads.row])
    flags = _steady_on_main(scene) & always(near, half, scene.first, scene.last) & constant(lead, half, scene.first, scene.last)
    row = spaced(scene, flags, rules.spacing, rules.most_windows)
    closing = leads.ttc.valid[row] & (leads.ttc.value[row] < rules.following_ttc)
    return Hits(
        Label.CAR_FOLLOWING,
        row,
        leads.row[row],
        {"gap": leads.gap[row], "thw": leads.thw.value[row], "ttc_below_4s": closing},
    )


def cut_in(scene: Scene) -> Hits:
    """3: another vehicle comes into ego's lane and becomes its lead."""
    found = _on_main(scene, cut_ins(scene))
    near = lateral_gap(scene, found) < scene.rules.lateral_gap
    return Hits(Label.CUT_IN, found.ego, found.other, {"gap": found.gap, "lateral_gap_below_2m": near})


def cut_out(scene: Scene) -> Hits:
    """4: ego's lead leaves the lane."""
    found = _on_main(scene, cut_outs(scene))
    return Hits(Label.CUT_OUT, found.ego, found.other, {"gap": found.gap, "ego_brakes": brakes(scene, found)})


def lane_change_left(scene: Scene) -> Hits:
    """5: ego changes to the lane on its left."""
    return _lane_change(scene, Label.LANE_CHANGE_LEFT, left=True)


def lane_change_right(scene: Scene) -> Hits:
    """6: ego changes to the lane on its right."""
    return _lane_change(scene, Label.LANE_CHANGE_RIGHT, left=False)


def _lane_change(scene: Scene, label: Label, *, left: bool) -> Hits:
    """Lane changes to one side; those that were recorded in part have their window where it is complete."""
    changes, rules = scene.changes, scene.rules
    row, shift = changes.row, changes.shift
    width, least = scene.site.lanes.width[scene.strip], rules.strict_shift
    whole = _between_through(scene, row) & (shift >= (rules.shift * width[row] if least is None else least)) & scene.complete[row]
    part = changes.partial
    enough = _between_through(scene, part.row) & (part.shift >= scene.least_shift(part.row)) & (part.left == left)
    partial = part.row[enough & ~near(scene, part.row, row[whole], rules.hold)]
    half = scene.rows(0.5 * rules.window)
    centre = np.clip(partial, scene.first[partial] + half, np.maximum(scene.last[partial] - half, 0))
    fits = scene.complete[centre] & (scene.track[centre] == scene.track[partial])
    chosen = whole & (changes.left == left)
    rows, shifts = np.append(row[chosen], centre[fits]), np.append(shift[chosen], _of(part, partial[fits]))
    return alone(label, rows, shift=shifts, partial=np.arange(len(rows)) >= np.count_nonzero(chosen))


def _between_through(scene: Scene, row: IntArray) -> BoolArray:
    """Whether neither of the lanes that a change leads from and to is a ramp or turns in a junction, where lanes overlap."""
    return scene.through[row] & scene.through[row - 1]


def _of(changes: Changes, row: IntArray) -> FloatArray:
    return changes.shift[np.searchsorted(changes.row, row)]


def _steady_on_main(scene: Scene) -> BoolArray:
    """Rows of egos that keep one main lane through the window and its margins, with all frames there."""
    seconds = 0.5 * scene.rules.window + scene.rules.margin
    main = always(scene.has_role(Role.MAIN), scene.rows(seconds), scene.first, scene.last)
    return main & scene.steady(seconds) & scene.egos[scene.track]


def _on_main(scene: Scene, found: Cuts) -> Cuts:
    return found.where(scene.has_role(Role.MAIN)[found.ego])


_ROUNDING = 0.01
"""Files round speed limits by less than this, m/s."""


def urban_cut_in(scene: Scene) -> Hits:
    """9: another vehicle comes into ego's lane and becomes its lead, with 0 < TTC < `rules.urban_ttc` soon after."""
    found = _on_urban(scene, cut_ins(scene))
    ttc = least_ttc(scene, found)
    critical = (ttc > 0.0) & (ttc < scene.rules.urban_ttc)
    found, ttc = found.where(critical), ttc[critical]
    near = lateral_gap(scene, found) < scene.rules.lateral_gap
    return Hits(Label.URBAN_CUT_IN, found.ego, found.other, {"gap": found.gap, "ttc": ttc, "lateral_gap_below_2m": near})


def urban_cut_out(scene: Scene) -> Hits:
    """10: ego's lead leaves the lane."""
    found = _on_urban(scene, cut_outs(scene))
    return Hits(Label.URBAN_CUT_OUT, found.ego, found.other, {"gap": found.gap, "ego_brakes": brakes(scene, found)})


def _on_urban(scene: Scene, found: Cuts) -> Cuts:
    """Return the cuts on urban lanes with a low or unknown limit."""
    limit = scene.site.lanes.speed_limit[scene.strip[found.ego]]
    slow = (limit <= scene.rules.urban_speed_limit + _ROUNDING) | np.isinf(limit)
    return found.where((scene.through & ~scene.has_role(Role.MAIN))[found.ego] & slow)


def ramp_entering(scene: Scene) -> Hits:
    """7: from a ramp, along which ego drove `rules.ramp_length` or more, onto a main lane."""
    ramp = scene.has_role(Role.ON_RAMP, Role.WEAVING)
    row, shift = _transitions(scene, ramp, scene.has_role(Role.MAIN))
    way, begin = _way_on(scene, ramp), _course_ends(scene)[0][row]
    return _hits(scene, Label.RAMP_ENTERING, row, way[row] - way[begin], shift, cut=ramp[begin])


def ramp_exiting(scene: Scene) -> Hits:
    """8: from a main lane onto a ramp, along which ego drives `rules.ramp_length` or more."""
    ramp = scene.has_role(Role.OFF_RAMP, Role.WEAVING)
    row, shift = _transitions(scene, scene.has_role(Role.MAIN), ramp)
    way, end = _way_on(scene, ramp), _course_ends(scene)[1][row]
    return _hits(scene, Label.RAMP_EXITING, row, way[end] - way[row], shift, cut=ramp[end])


def _hits(scene: Scene, label: Label, row: IntArray, length: FloatArray, shift: FloatArray, cut: BoolArray) -> Hits:
    """Transitions with enough way on the ramp, and enough shift; less of both where the recording is cut on the ramp."""
    rules = scene.rules
    whole = (length >= rules.ramp_length) & (shift >= rules.ramp_shift)
    width = scene.site.lanes.width[scene.strip[row]]
    partial = cut & (length >= rules.partial_ramp) & (shift >= rules.partial_shift * width) & ~whole
    good = scene.complete[row] & (whole | partial)
    return alone(label, row[good], ramp_way=length[good], partial=partial[good])


def _transitions(scene: Scene, before: BoolArray, after: BoolArray) -> tuple[IntArray, FloatArray]:
    """First rows after each transition, and the lateral shift of those by a change of lane; infinite for the others."""
    changes = scene.changes
    onwards = np.flatnonzero((changes.step[1:] == 0) & (changes.course[1:] == changes.course[:-1])) + 1
    rows, shifts = np.append(changes.row, onwards), np.append(changes.shift, np.full(len(onwards), np.inf))
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
    return np.searchsorted(course, course, side="left"), np.searchsorted(course, course, side="right") - 1
