"""Rules 1 to 6: what happens on the through lanes of a motorway; lane changes count on other roads as well."""

from __future__ import annotations

import numpy as np

from recognition.labels import cuts
from recognition.labels.classes import Label
from recognition.labels.hits import Hits, alone
from recognition.labels.scene.changes import Changes
from recognition.labels.scene.leads import ABSENT
from recognition.labels.scene.rolling import always, constant, deviation
from recognition.labels.scene.scene import Scene
from recognition.labels.scene.spans import near, spaced
from recognition.sites import Role
from xodr.array_types import BoolArray, FloatArray, IntArray


def free_cruise(scene: Scene) -> Hits:
    """1: steady speed on one lane, without a lead or with one far ahead, in the window and its margins.

    Who stands has no headway, whoever stands ahead.
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
    found = _on_main(scene, cuts.cut_ins(scene))
    near = cuts.lateral_gap(scene, found) < scene.rules.lateral_gap
    return Hits(Label.CUT_IN, found.ego, found.other, {"gap": found.gap, "lateral_gap_below_2m": near})


def cut_out(scene: Scene) -> Hits:
    """4: ego's lead leaves the lane."""
    found = _on_main(scene, cuts.cut_outs(scene))
    return Hits(Label.CUT_OUT, found.ego, found.other, {"gap": found.gap, "ego_brakes": cuts.brakes(scene, found)})


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
    """Whether neither of the lanes that a change leads from and to is a ramp or lies in a junction, where lanes overlap."""
    through = scene.has_role(Role.MAIN, Role.URBAN, Role.APPROACH)
    return through[row] & through[row - 1]


def _of(changes: Changes, row: IntArray) -> FloatArray:
    return changes.shift[np.searchsorted(changes.row, row)]


def _steady_on_main(scene: Scene) -> BoolArray:
    """Rows of egos that keep one main lane through the window and its margins, with all frames there."""
    seconds = 0.5 * scene.rules.window + scene.rules.margin
    main = always(scene.has_role(Role.MAIN), scene.rows(seconds), scene.first, scene.last)
    return main & scene.steady(seconds) & scene.egos[scene.track]


def _on_main(scene: Scene, found: cuts.Cuts) -> cuts.Cuts:
    return found.where(scene.has_role(Role.MAIN)[found.ego])
