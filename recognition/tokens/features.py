"""Features of windows: motion, relations in lane coordinates, traffic and road, of all participants at once."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from recognition.labels.rules import Rules
from recognition.labels.scene.leads import ABSENT
from recognition.labels.scene.scene import Scene, prepare
from recognition.sites import Site
from recognition.sites.lanes import NOWHERE, LaneGraph
from recognition.sites.roles import ROLES, Role
from recognition.tokens.config import FEATURES, SCALES, Tokens
from recognition.tokens.rows import Moments, window_rows
from recognition.tokens.ways import relations
from runner.recording import Recording
from schemas.errors import UsageError
from xodr.array_types import BoolArray, FloatArray, IntArray
from xodr.graph.ways import DRIVABLE

_FAR = 200.0
"""Gaps and distances are cut to this, m."""
_SLOW = 1.0
"""Headways are over no less than this speed, m/s."""
_LONGEST_HEADWAY = 10.0
_BATCH = 4096
"""Windows at a time: what is made of them on the way stays within a GB."""
Values = dict[str, NDArray[np.floating]]


def tokenise(recording: Recording, moments: Moments, tokens: Tokens, site: Site) -> NDArray[np.float16]:
    """Windows of tokens about moments, from the frames nearest to the times, without interpolation.

    Returns:
        float16 (n, participants, frames, features), NaN where a participant is not there.

    Raises:
        UsageError: a moment names no vehicle of the recording.
    """
    return np.concatenate([np.zeros((0, *tokens.shape), np.float16), *in_parts(recording, moments, tokens, site)])


def in_parts(
    recording: Recording, moments: Moments, tokens: Tokens, site: Site, size: int = _BATCH
) -> Iterator[NDArray[np.float16]]:
    """The same, so many windows at a time.

    Raises:
        UsageError: a moment names no vehicle of the recording.
    """
    if not moments:
        return
    scene = prepare(recording, site, Rules())
    if not len(scene.track):
        raise UsageError(f"the recording has no vehicle {moments[0][0]!r}")
    of_rows = _rows(scene)
    for start in range(0, len(moments), size):
        yield _values(scene, of_rows, window_rows(scene, moments[start : start + size], tokens))


def _values(scene: Scene, of_rows: Values, rows: IntArray) -> NDArray[np.float16]:
    """Features of the rows of windows (n, participants, frames)."""
    there = rows != ABSENT
    found = {name: np.where(there, values[rows], np.nan) for name, values in of_rows.items()}
    found |= _relative(scene, rows, there)
    out = np.empty((*rows.shape, len(FEATURES)), np.float16)
    for number, name in enumerate(FEATURES):
        out[..., number] = found[name] / SCALES.get(name, 1.0)
    out[~there] = np.nan
    return out


def _rows(scene: Scene) -> Values:
    """Features of each row of a scene by itself."""
    lanes, strip = scene.site.lanes, scene.strip
    on = strip != NOWHERE
    place = np.where(on, strip, 0)
    left, right = _beside(lanes)
    leads, limit = scene.leads, lanes.speed_limit[place]
    led, half = leads.row != ABSENT, 0.5 * scene.width
    gap = np.where(led, np.clip(leads.gap, 0.0, _FAR), _FAR)
    found = {
        "speed": scene.speed, "acceleration": scene.acceleration, "width": scene.width, "length": scene.front - scene.rear,
        "yaw_rate": _rate(scene, np.cos(scene.h), np.sin(scene.h)), "lateral_speed": _change(scene, scene.changes.side),
        "offset": scene.offset, "gap": gap, "has_lead": led,
        "headway": np.where(led, np.minimum(gap / np.maximum(scene.speed, _SLOW), _LONGEST_HEADWAY), _LONGEST_HEADWAY),
        "border_left": np.where(on, 0.5 * lanes.width[place] - scene.offset - half, 0.0),
        "border_right": np.where(on, 0.5 * lanes.width[place] + scene.offset - half, 0.0),
        "lanes_to_left": np.where(on, left[place], 0), "lanes_to_right": np.where(on, right[place], 0),
        "lane_behind": np.where(on, np.clip(scene.along, 0.0, _FAR), 0.0),
        "lane_ahead": np.where(on, np.clip(lanes.length[place] - scene.along, 0.0, _FAR), 0.0),
        "limit": np.where(on & np.isfinite(limit), limit, 0.0), "has_limit": on & np.isfinite(limit),
    }  # fmt: skip
    role = np.where(scene.role == ROLES.index(Role.SIGNALISED), ROLES.index(Role.INSIDE), scene.role)
    found |= {f"role_{name}": role == code for code, name in enumerate(ROLES)}
    return {name: np.asarray(values, np.float32) for name, values in found.items()}


def _relative(scene: Scene, rows: IntArray, there: BoolArray) -> Values:
    """Features of rows relative to the ego's row of the same frame; the ego's own relative to the middle of its window."""
    frames = rows.shape[2]
    own = rows[:, :1]
    middle = own[:, :, frames // 2]
    middle = np.where(middle == ABSENT, own.max(axis=2), middle)
    ego = np.broadcast_to(own, rows.shape).copy()
    ego[:, 0] = middle
    both = there & (ego != ABSENT)
    a, b = ego[both], rows[both]
    found = _between(scene, a, b)
    is_ego = np.zeros(rows.shape, bool)
    is_ego[:, 0] = True
    mine = is_ego[both]
    lane, side = scene.changes.lane, scene.changes.side
    same = mine & (scene.changes.course[a] == scene.changes.course[b])
    found["lanes_left"] = np.where(mine, np.where(same, lane[b] - lane[a], 0), found["lanes_left"])
    found["aside"] = np.where(mine, np.where(same, side[b] - side[a], 0.0), found["aside"])
    out = {}
    for name, values in found.items():
        out[name] = np.zeros(rows.shape, np.float32)
        out[name][both] = values
    return out


def _between(scene: Scene, a: IntArray, b: IntArray) -> Values:
    """How the rows `b` lie to the rows `a`."""
    graph = scene.site.lanes
    lanes = relations(graph, scene.strip[a], scene.strip[b])
    related = lanes.same_way | lanes.merging
    width = 0.5 * (graph.width[scene.strip[a]] + graph.width[scene.strip[b]])
    aside = lanes.lanes * width + scene.offset[b] - scene.offset[a]
    along = lanes.base + scene.along[b] - scene.along[a]
    dx, dy, turn = scene.x[b] - scene.x[a], scene.y[b] - scene.y[a], scene.h[b] - scene.h[a]
    cos, sin = np.cos(scene.h[a]), np.sin(scene.h[a])
    leads = scene.leads
    return {
        "along": np.clip(np.where(related, along, 0.0), -_FAR, _FAR), "aside": np.where(lanes.same_way, aside, 0.0),
        "ahead": dx * cos + dy * sin, "left": dy * cos - dx * sin,
        "closing_ahead": scene.speed[b] * np.cos(turn) - scene.speed[a], "closing_left": scene.speed[b] * np.sin(turn),
        "cos": np.cos(turn), "sin": np.sin(turn), "lanes_left": lanes.lanes.astype(np.float64),
        "is_lead": (leads.row[a] == b).astype(np.float64), "is_follower": (leads.follower[a] == b).astype(np.float64),
        "same_way": lanes.same_way.astype(np.float64), "merging": lanes.merging.astype(np.float64),
    }  # fmt: skip


def _beside(lanes: LaneGraph) -> tuple[IntArray, IntArray]:
    """How many drivable lanes of its direction each strip has to the left and to the right."""
    places: dict[tuple[str, int, bool], list[int]] = {}
    for strip in lanes.strips:
        if strip.kind in DRIVABLE:
            places.setdefault((strip.road, strip.section, strip.forward), []).append(strip.place)
    found = [places.get((strip.road, strip.section, strip.forward), []) for strip in lanes.strips]
    left = [sum(one < strip.place for one in others) for strip, others in zip(lanes.strips, found, strict=True)]
    right = [sum(one > strip.place for one in others) for strip, others in zip(lanes.strips, found, strict=True)]
    return np.array(left, np.int64), np.array(right, np.int64)


def _neighbours(scene: Scene) -> tuple[IntArray, IntArray, FloatArray]:
    """Rows about 0.2 s before and after each one of the same part of its track, and the time between, s."""
    reach, here = scene.rows(0.2), np.arange(len(scene.track))
    before, after = np.maximum(here - reach, scene.first), np.minimum(here + reach, scene.last)
    return before, after, np.maximum((after - before) * scene.step, scene.step)


def _change(scene: Scene, values: FloatArray) -> FloatArray:
    """Rate of change, per s."""
    before, after, apart = _neighbours(scene)
    return (values[after] - values[before]) / apart


def _rate(scene: Scene, cos: FloatArray, sin: FloatArray) -> FloatArray:
    """Rate of change of an angle of this cosine and sine, rad/s."""
    before, after, apart = _neighbours(scene)
    return (
        np.arctan2(sin[after] * cos[before] - cos[after] * sin[before], cos[after] * cos[before] + sin[after] * sin[before])
        / apart
    )
