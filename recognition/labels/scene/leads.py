"""Who drives ahead of whom in each frame: on the same lane, and on the lanes that it leads to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from recognition.sites.lanes import NOWHERE, LaneGraph
from runner.measures.criticality import Measure, time_headway, time_to_collision
from xodr.array_types import FloatArray, IntArray

ABSENT = -1
"""Row (or track) of a lead, follower or partner that is absent."""
_MOST_STRIPS = 12
"""Most strips ahead that are searched for a lead."""


@dataclass(frozen=True, eq=False)
class Leads:
    """The lead of each row.

    Attributes:
        row: the lead's row in the same frame, ABSENT without one in sight.
        gap: between the boxes along the lane, m, negative where they overlap; 0 without a lead.
        thw, ttc: time headway and time to collision, where they are defined.
        follower: row of who has this row as the lead, the nearest of several; ABSENT for none.
    """

    row: IntArray
    gap: FloatArray
    thw: Measure
    ttc: Measure
    follower: IntArray


def leads(
    lanes: LaneGraph,
    track: IntArray,
    frame: IntArray,
    strip: IntArray,
    along: FloatArray,
    speed: FloatArray,
    front: FloatArray,
    rear: FloatArray,
    sight: float,
) -> Leads:
    """The leads of all rows (in the order of tracks and time), as far ahead as `sight` (m)."""
    row = np.full(len(track), ABSENT, np.int64)
    gap = np.zeros(len(track))
    order = np.lexsort((along, strip, frame))
    order = order[strip[order] != NOWHERE]
    keys = frame[order] * len(lanes.strips) + strip[order]
    same = keys[1:] == keys[:-1]
    behind, ahead = order[:-1][same], order[1:][same]
    row[behind], gap[behind] = ahead, along[ahead] - along[behind]
    heads, starts = np.unique(keys, return_index=True)
    searching = order[np.append(starts[1:], len(order)) - 1] if len(order) else order
    passed = lanes.length[strip[searching]] - along[searching]
    strips = _own_next(lanes, track, strip)[searching]
    for _ in range(_MOST_STRIPS):
        on = (strips != NOWHERE) & (passed < sight)
        searching, passed, strips = searching[on], passed[on], strips[on]
        key = frame[searching] * len(lanes.strips) + strips
        place = np.minimum(np.searchsorted(heads, key), len(heads) - 1)
        found = heads[place] == key if len(heads) else np.zeros(0, bool)
        lead = order[starts[place[found]]]
        row[searching[found]], gap[searching[found]] = lead, passed[found] + along[lead]
        searching, passed, strips = searching[~found], passed[~found], strips[~found]
        passed, strips = passed + lanes.length[strips], lanes.straight[strips]
    return _measured(row, gap, track, speed, front, rear, sight)


def _own_next(lanes: LaneGraph, track: IntArray, strip: IntArray) -> IntArray:
    """The strip that each row's track takes next, as far as the track shows it; else the straightest."""
    following = lanes.straight[strip]
    following[strip == NOWHERE] = NOWHERE
    leaving = np.flatnonzero((strip[1:] != strip[:-1]) & (track[1:] == track[:-1]))
    pairs, which = np.unique(np.stack([strip[leaving], strip[leaving + 1]], axis=1), axis=0, return_inverse=True)
    linked = np.array([a != NOWHERE and b in lanes.following[a] for a, b in pairs.tolist()], bool)
    leaving = leaving[linked[which.reshape(-1)]] if len(pairs) else leaving
    begins = np.ones(len(strip), bool)
    begins[1:] = (strip[1:] != strip[:-1]) | (track[1:] != track[:-1])
    stay = np.cumsum(begins) - 1
    taken = np.full(stay[-1] + 1 if len(stay) else 0, NOWHERE, np.int64)
    taken[stay[leaving]] = strip[leaving + 1]
    own = taken[stay]
    return np.where(own != NOWHERE, own, following)


def _measured(
    row: IntArray, gap: FloatArray, track: IntArray, speed: FloatArray, front: FloatArray, rear: FloatArray, sight: float
) -> Leads:
    led = row != ABSENT
    led[led] = track[row[led]] != track[led]  # once round a ring, a vehicle would lead itself
    gap = np.where(led, gap - front + rear[row], 0.0)
    led &= gap <= sight
    row, gap = np.where(led, row, ABSENT), np.where(led, gap, 0.0)
    follower = np.full(len(row), ABSENT, np.int64)
    nearest_last = np.flatnonzero(led)[np.argsort(-gap[led], kind="stable")]
    follower[row[nearest_last]] = nearest_last
    closing = np.where(led, speed - speed[row], 0.0)
    thw, ttc = time_headway(gap, speed), time_to_collision(gap, closing)
    return Leads(row, gap, Measure(thw.value, thw.valid & led), Measure(ttc.value, ttc.valid & led), follower)
