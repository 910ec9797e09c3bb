"""Others' changes of lane as their followers see them: cutting in before an ego, and out of its way."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from recognition.labels.scene.leads import ABSENT
from recognition.labels.scene.scene import Scene
from recognition.labels.scene.spans import ahead_of, near
from xodr.array_types import BoolArray, FloatArray, IntArray


class Cuts(NamedTuple):
    """Ego's row at t*, and the row of who changes lane in the same frame; gap between them along the lane, m."""

    ego: IntArray
    other: IntArray
    gap: FloatArray

    def where(self, chosen: BoolArray) -> Cuts:
        """Some of them."""
        return Cuts(self.ego[chosen], self.other[chosen], self.gap[chosen])


def cut_ins(scene: Scene) -> Cuts:
    """Who comes from another lane becomes ego's lead within `rules.cut_gap`, while ego keeps its lane."""
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
    """Rows of egos that drive, and change lane neither then nor within `rules.reaction`: who stands has no headway."""
    own = np.append(scene.changes.row, scene.changes.partial.row)
    kept = scene.steady(0.5 * scene.rules.window)[row] & ~near(scene, row, own, scene.rules.reaction)
    return kept & scene.complete[row] & (scene.speed[row] >= scene.rules.cut_speed)


def _leaves(scene: Scene) -> BoolArray:
    """Which changes of lane have as much of a displacement as those that are recorded in part need."""
    return scene.changes.shift >= scene.least_shift(scene.changes.row)
