"""Roles of lanes against the observed traffic: a lane that carries through traffic is no ramp."""

from __future__ import annotations

import numpy as np

from recognition.scenes.lanes import NOWHERE, LaneGraph
from recognition.scenes.roles import ROLES, LaneRole
from schemas.common.array_types import IntArray

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
                    each
                    for each in (*lanes.following[strip], *lanes.preceding[strip])
                    if each in among
                ]
        count += 1
    return group
