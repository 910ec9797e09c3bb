"""Whether a vehicle turns where it crosses the border of a lane, or goes along the road.

Turns into a junction and out of it cross borders of lanes as well, and are no changes of lane.
"""

from __future__ import annotations

import numpy as np

from recognition.labels.scene.rows import SceneRows
from recognition.sites import Role
from recognition.sites.lanes import NOWHERE
from xodr.array_types import BoolArray, FloatArray, IntArray


def along_road(scene: SceneRows, row: IntArray) -> BoolArray:
    """Rows about which a vehicle goes along its road, less than `rules.oblique` to the lane there.

    Within `rules.turning_time` before and after, it turns by no more than `rules.turning` beyond what the road bends.
    """
    headings = np.array([_lane_heading(scene, each) for each in row.tolist()], np.float64)
    oblique = np.abs(_wrapped(scene.h[row] - headings))
    return (oblique <= np.radians(scene.rules.oblique)) & (np.abs(_turns(scene, row)) <= np.radians(scene.rules.turning))


def _turns(scene: SceneRows, row: IntArray) -> FloatArray:
    """Change of heading about each row, less what the roads outside of junctions bend on the way, rad."""
    reach = scene.rows(scene.rules.turning_time)
    first, last = np.maximum(row - reach, scene.first[row]), np.minimum(row + reach, scene.last[row])
    turned = np.cumsum(_wrapped(np.diff(scene.h, prepend=scene.h[:1])))
    off_road = scene.has_role(Role.INSIDE, Role.SIGNALISED, Role.ENTRY, Role.RING, Role.EXIT) | (scene.strip == NOWHERE)
    bends = [_bend(scene, a, b, off_road) for a, b in zip(first.tolist(), last.tolist(), strict=True)]
    return turned[last] - turned[first] - np.array(bends, np.float64)


def _bend(scene: SceneRows, first: int, last: int, off_road: BoolArray) -> float:
    """How much the lanes below these rows bend, those of junctions left out, rad."""
    strips = scene.strip[first : last + 1]
    starts = np.append(0, np.flatnonzero(np.diff(strips)) + 1)
    ends = np.append(starts[1:] - 1, len(strips) - 1)
    stays = [(first + a, first + b) for a, b in zip(starts.tolist(), ends.tolist(), strict=True) if not off_road[first + a]]
    return sum(float(_wrapped(_lane_heading(scene, b) - _lane_heading(scene, a))) for a, b in stays)


def _lane_heading(scene: SceneRows, row: int) -> float:
    return scene.site.lanes.heading(int(scene.strip[row]), float(scene.along[row]))


def _wrapped(angle: FloatArray | float) -> FloatArray:
    """Between -π and π."""
    return np.remainder(np.asarray(angle) + np.pi, 2.0 * np.pi) - np.pi
