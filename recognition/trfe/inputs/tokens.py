"""Tokens: the ego and the others about it over time, in lane coordinates: what the shipped encoder
reads of a scene."""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from recognition.labels.classes import Rules
from recognition.labels.scene import ABSENT, Scene, prepare
from recognition.scenes import Site
from recognition.scenes.lanes import NOWHERE, LaneGraph
from recognition.scenes.roles import ROLES, LaneRole
from runner.recording import Recording
from schemas.common.array_types import BoolArray, FloatArray, IntArray
from schemas.common.errors import UsageError
from xodr.graph.ways import DRIVABLE

MOTION = ("speed", "acceleration", "yaw_rate", "lateral_speed", "length", "width")
"""Of a participant by itself: m/s, m/s², rad/s, m/s to the left of its lane, m."""
RELATIVE = (
    "along", "aside", "ahead", "left", "closing_ahead", "closing_left", "cos", "sin", "lanes_left",
    "is_lead", "is_follower", "same_way", "merging",
)  # fmt: skip
"""Of a participant relative to the ego at the same time; of the ego relative to itself at the
middle of the window:

- `along`, `aside`: distance along the lanes, and to the left across them, m; 0 where lanes do not
  connect the two;
- `ahead`, `left`, `closing_ahead`, `closing_left`: place (m) and velocity (m/s) in the axes of the
  ego's heading;
- `cos`, `sin`: of the difference of headings; `lanes_left`: how many lanes to the left;
- `is_lead`, `is_follower`: whether it is the ego's lead or follower; `same_way`: whether one is on
  the way of the other, or beside it; `merging`: whether their ways lead to one lane, in which case
  `along` is by how much it is nearer to it.
"""
TRAFFIC = ("offset", "gap", "headway", "has_lead")
"""Of a participant in its lane: m to the left of the centre; gap (m) and time headway (s) to its
lead, which may be absent."""
ROAD = (
    "border_left",
    "border_right",
    "lanes_to_left",
    "lanes_to_right",
    "lane_behind",
    "lane_ahead",
    "limit",
    "has_limit",
)
"""Of the lane that a participant is in: distances from its box to the borders (m), lanes of the
same direction beside it, distances to the lane's beginning and end (m), speed limit (m/s)."""
FEATURES = (*MOTION, *RELATIVE, *TRAFFIC, *ROAD, *(f"role_{role}" for role in ROLES))
"""All features in the order of the last axis; a role is 1 where the lane has it. Lights do not
show: lanes through junctions with lights are `inside` as others are, and `signalised` stays 0.
Values are divided by `SCALES`."""
SCALES = {
    "speed": 15.0, "acceleration": 2.0, "yaw_rate": 0.3, "length": 8.0, "width": 2.5, "along": 30.0,
    "aside": 3.5, "ahead": 30.0,
    "left": 10.0, "closing_ahead": 8.0, "closing_left": 4.0, "gap": 40.0, "headway": 3.0,
    "border_left": 1.5, "border_right": 1.5,
    "lanes_to_left": 2.0, "lanes_to_right": 2.0, "lane_behind": 50.0, "lane_ahead": 50.0,
    "limit": 20.0,
}  # fmt: skip
"""Divisors that scale features to between -1 and 1, mostly; features not listed stay."""


@dataclass(frozen=True)
class Tokens:
    """Windows about an ego: rows of features for the ego, first, and for the others that matter
    most to it.

    Attributes:
        span, frames: length of a window, s, and how many equally long parts it has; a frame is the
            middle of each.
        others: most other participants: the ego's leads and followers, then the nearest.
        reach: greatest distance of participants that count, except leads, m.
        core: time about the middle for which the ego has to be there, s; beyond it a track may
            begin or end.
    """

    span: float = 6.4
    frames: int = 16
    others: int = 8
    reach: float = 120.0
    core: float = 1.5

    def __post_init__(self) -> None:
        if not 0.0 < self.core <= self.span < math.inf or self.frames < 2:
            raise UsageError(
                "a window of tokens needs two or more frames over a positive time, and a core no "
                "longer than that"
            )
        if self.others < 0 or not 0.0 < self.reach < math.inf:
            raise UsageError("a window of tokens has a number of others, within a positive reach")

    @property
    def shape(self) -> tuple[int, int, int]:
        """Shape of one window: participants, frames, features."""
        return 1 + self.others, self.frames, len(FEATURES)

    @property
    def offsets(self) -> tuple[float, ...]:
        """Times of the frames relative to the middle of the window, s."""
        return tuple(self.span * ((k + 0.5) / self.frames - 0.5) for k in range(self.frames))


_CHANGING = (
    "speed", "acceleration", "yaw_rate", "lateral_speed", "along", "aside", "ahead", "left", "cos",
    "sin", "offset", "gap", "headway", "has_lead", "border_left", "border_right",
)  # fmt: skip
_ROLES = tuple(name for name in FEATURES if name.startswith("role_"))
MOTION_CHANGES = 2 * len(_CHANGING)
"""Numbers of a window, the first ones, that are of motion, gap and borders; those of roles follow.
"""
CHANGES = MOTION_CHANGES + 2 * len(_ROLES)
"""Numbers of a window"""


def changes(inputs: NDArray[np.float16]) -> NDArray[np.float32]:
    """Return the changes of the ego's motion, gap and lane in windows, and the roles of its lanes.

    The difference of end and start characterises a scenario. Levels, such as of speed or the number
    of lanes, show where it is, and are left out, but for the roles.

    Args:
        inputs: windows (n, participants, frames, features).

    Returns:
        (n, CHANGES): changes from the first third to the last, and deviations in the window, of
        motion, gap and distances to the
        borders; then changes and means of the roles. A change is 0 where the ego isn't there in the
        first or the last third.
    """
    moving, roles = _ego(inputs, _CHANGING), _ego(inputs, _ROLES)
    return np.concatenate(
        [_difference(moving), _deviation(moving), _difference(roles), np.nan_to_num(_mean(roles))],
        axis=1,
    )


def _ego(inputs: NDArray[np.float16], names: tuple[str, ...]) -> NDArray[np.float32]:
    """Features (n, frames, names) of the ego; NaN where it isn't there."""
    return np.asarray(inputs[:, 0][:, :, [FEATURES.index(name) for name in names]], np.float32)


def _difference(values: NDArray[np.float32]) -> NDArray[np.float32]:
    third = values.shape[1] // 3
    return np.nan_to_num(_mean(values[:, -third:]) - _mean(values[:, :third]))


def _deviation(values: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.sqrt(np.nan_to_num(_mean(np.square(values - _mean(values)[:, None]))))


def _mean(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Mean (n, names) over the frames that are there; NaN where none is."""
    there = np.isfinite(values)
    total, count = np.where(there, values, 0.0).sum(axis=1), there.sum(axis=1)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan).astype(np.float32)


_REACH = 250.0
"""Ways are followed so far, m."""


class StripRelations(NamedTuple):
    """Relations of pairs of strips.

    Attributes:
        base: distance from where the first begins to where the second does, m; of ways that merge,
            by how much farther the first is from where they do. `base` + place along the second -
            place along the first is the distance along the lanes.
        lanes: how many lanes to the left the second is. same_way, merging: see
            `recognition.trfe.inputs.tokens.RELATIVE`.
    """

    base: FloatArray
    lanes: IntArray
    same_way: BoolArray
    merging: BoolArray


def relations(graph: LaneGraph, one: IntArray, other: IntArray) -> StripRelations:
    """Relations of pairs of strips; of NOWHERE there is none."""
    ways, side = _ways(graph), len(graph.strips) + 1
    pairs = (one - NOWHERE) * side + other - NOWHERE
    there = np.zeros(side * side, bool)
    there[pairs] = True
    which = (np.cumsum(there) - 1)[pairs]
    found = [
        ways.relation(pair // side + NOWHERE, pair % side + NOWHERE)
        for pair in np.flatnonzero(there).tolist()
    ]
    base, lanes, same, merging = (
        (np.array(values) for values in zip(*found, strict=True)) if found else ([], [], [], [])
    )
    return StripRelations(
        np.asarray(base, np.float64)[which], np.asarray(lanes, np.int64)[which],
        np.asarray(same, bool)[which], np.asarray(merging, bool)[which],
    )  # fmt: skip


class _Ways:
    """The strips ahead of each, found once and kept."""

    def __init__(self, graph: LaneGraph) -> None:
        self._graph = graph
        self._beside: dict[tuple[str, int, bool], list[int]] = {}
        for number, strip in enumerate(graph.strips):
            if strip.kind in DRIVABLE:
                self._beside.setdefault((strip.road, strip.section, strip.forward), []).append(
                    number
                )
        self._ahead: dict[int, dict[int, tuple[float, int]]] = {}

    def relation(self, one: int, other: int) -> tuple[float, int, bool, bool]:
        """Base, lanes to the left, whether one is on the way of the other, and
        whether they merge.
        """
        if NOWHERE in (one, other):
            return 0.0, 0, False, False
        ahead, behind = self.ahead(one), self.ahead(other)
        there, here = ahead.get(other), behind.get(one)
        if there is not None and (here is None or there[0] <= here[0]):
            return there[0], there[1], True, False
        if here is not None:
            return -here[0], -here[1], True, False
        both = [
            (ahead[strip][0] + behind[strip][0], strip)
            for strip in ahead.keys() & behind.keys()
            if not ahead[strip][1]
        ]
        both = [one for one in both if not behind[one[1]][1]]
        if not both:
            return 0.0, 0, False, False
        meeting = min(both)[1]
        return ahead[meeting][0] - behind[meeting][0], 0, False, True

    def ahead(self, start: int) -> dict[int, tuple[float, int]]:
        """Strips on the way from one, itself included, and those beside them: distance between
        their beginnings, and lanes to the left. What is on the way itself counts before what is
        beside it."""
        if start not in self._ahead:
            self._ahead[start] = self._search(start)
        return self._ahead[start]

    def _search(self, start: int) -> dict[int, tuple[float, int]]:
        graph = self._graph
        found: dict[int, tuple[float, int]] = {}
        waiting = [(0, 0.0, start, 0)]
        while waiting:
            _, distance, number, lanes = heapq.heappop(waiting)
            if number in found:
                continue
            found[number] = distance, lanes
            strip = graph.strips[number]
            # Ordered by lanes aside first: a lane on the way is told from the
            # same lane reached by a change.
            for other in self._beside.get((strip.road, strip.section, strip.forward), ()):
                aside = lanes + strip.place - graph.strips[other].place
                heapq.heappush(waiting, (abs(aside), distance, other, aside))
            beyond = distance + strip.length
            if beyond < _REACH:
                for after in graph.following[number]:
                    heapq.heappush(waiting, (abs(lanes), beyond, after, lanes))
        return found


@lru_cache(maxsize=8)
def _ways(graph: LaneGraph) -> _Ways:
    return _Ways(graph)


Moments = Sequence[tuple[str, float]]
"""Names of ego tracks and times, s."""
_ANCHORS = 5
"""Frames of a window in which others are looked for."""
_ASIDE = 2.5
"""Weight of lateral distance: vehicles in the same lane matter from farther away."""


class _SceneIndex:
    """The rows of a scene by track and frame, and by frame alone."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._frames = int(scene.frame.max(initial=0)) + 2
        # One ascending number for track and frame. `find` refuses frames outside, whose numbers are
        # those of another track.
        self._keys = scene.track * self._frames + scene.frame
        self.by_frame = np.argsort(scene.frame, kind="stable")
        self.starts = np.searchsorted(scene.frame[self.by_frame], np.arange(self._frames + 1))

    def find(self, track: IntArray, frame: IntArray) -> IntArray:
        """The row of each track (ABSENT for none) in each frame, ABSENT where there is none."""
        key = track * self._frames + frame
        # Rows are sorted by track and frame, so that one search finds all.
        place = np.minimum(np.searchsorted(self._keys, key), len(self._keys) - 1)
        there = (
            (self._keys[place] == key) & (track != ABSENT) & (frame >= 0) & (frame < self._frames)
        )
        return np.where(there, place, ABSENT)


def window_rows(scene: Scene, moments: Moments, tokens: Tokens) -> IntArray:
    """Rows (n, participants, frames) of windows, ABSENT where a participant is not there.

    Raises:
        UsageError: a moment names no track.
    """
    numbers = {name: number for number, name in enumerate(scene.names)}
    unknown = next((ego for ego, _ in moments if ego not in numbers), None)
    if unknown is not None:
        raise UsageError(f"the recording has no vehicle {unknown!r}")
    index, begin = _SceneIndex(scene), scene.time.min(initial=np.inf) if len(scene.time) else 0.0
    egos = np.array([numbers[ego] for ego, _ in moments], np.int64)
    middle = np.array([time for _, time in moments], float) - begin
    # To the nearest frame: recordings of 10 and 30 Hz give windows of the same offsets.
    frame = np.rint((middle[:, None] + np.array(tokens.offsets)) / scene.step).astype(np.int64)
    own = index.find(np.broadcast_to(egos[:, None], frame.shape), frame)
    others = _others(scene, index, own, egos, tokens)
    rows = index.find(
        np.broadcast_to(others[:, :, None], (*others.shape, tokens.frames)), frame[:, None, :]
    )
    return np.concatenate([own[:, None], rows], axis=1)


def _others(
    scene: Scene, index: _SceneIndex, own: IntArray, egos: IntArray, tokens: Tokens
) -> IntArray:
    """Tracks (n, others) of those that matter most in each window, ABSENT where there are fewer."""
    # A few frames show whoever is near; all of them would cost time and find the same.
    anchors = np.unique(np.linspace(0, tokens.frames - 1, _ANCHORS).round().astype(np.int64))
    window, track, distance = _near(scene, index, own[:, anchors], tokens.reach)
    order = np.lexsort((distance, track, window))
    window, track, distance = window[order], track[order], distance[order]
    # In this order the first row of a track in a window is its nearest.
    nearest = np.ones(len(window), bool)
    nearest[1:] = (window[1:] != window[:-1]) | (track[1:] != track[:-1])
    nearest &= track != egos[window]
    window, track, distance = window[nearest], track[nearest], distance[nearest]
    order = np.lexsort((distance, window))
    window, track = window[order], track[order]
    rank = np.arange(len(window)) - np.searchsorted(window, window)
    chosen = np.full((len(own), tokens.others), ABSENT, np.int64)
    kept = rank < tokens.others
    chosen[window[kept], rank[kept]] = track[kept]
    return chosen


def _near(
    scene: Scene, index: _SceneIndex, own: IntArray, reach: float
) -> tuple[IntArray, IntArray, FloatArray]:
    """Windows, tracks and distances of participants near to egos' rows (n, anchors); leads and
    followers at distance 0."""
    window = np.repeat(np.arange(len(own)), own.shape[1])[own.ravel() != ABSENT]
    ego = own.ravel()[own.ravel() != ABSENT]
    start, end = index.starts[scene.frame[ego]], index.starts[scene.frame[ego] + 1]
    sizes = end - start
    # All participants in the frames of the egos' rows: ranges of different lengths, one after the
    # other.
    first = np.repeat(start - np.concatenate([[0], np.cumsum(sizes)[:-1]]), sizes)
    other = index.by_frame[np.arange(len(first)) + first]
    window, ego = np.repeat(window, sizes), np.repeat(ego, sizes)
    dx, dy = scene.x[other] - scene.x[ego], scene.y[other] - scene.y[ego]
    cos, sin = np.cos(scene.h[ego]), np.sin(scene.h[ego])
    distance = np.hypot(dx * cos + dy * sin, _ASIDE * (dy * cos - dx * sin))
    leads = scene.leads
    close = (leads.row[ego] == other) | (leads.follower[ego] == other)
    kept = close | (np.hypot(dx, dy) < reach)
    return window[kept], scene.track[other[kept]], np.where(close, 0.0, distance)[kept]


_FAR = 200.0
"""Gaps and distances are cut to this, m."""
_SLOW = 1.0
"""Headways are over no less than this speed, m/s."""
_LONGEST_HEADWAY = 10.0
_BATCH = 4096
"""Windows at a time: what is made of them on the way stays within a GB."""
Values = dict[str, NDArray[np.floating]]


def tokenise(
    recording: Recording, moments: Moments, tokens: Tokens, site: Site
) -> NDArray[np.float16]:
    """Windows of tokens about moments, from the frames nearest to the times, without interpolation.

    Returns:
        float16 (n, participants, frames, features), NaN where a participant is not there.

    Raises:
        UsageError: a moment names no vehicle of the recording.
    """
    return np.concatenate(
        [np.zeros((0, *tokens.shape), np.float16), *in_parts(recording, moments, tokens, site)]
    )


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
        "speed": scene.speed, "acceleration": scene.acceleration, "width": scene.width,
        "length": scene.front - scene.rear,
        "yaw_rate": _rate(scene, np.cos(scene.h), np.sin(scene.h)),
        "lateral_speed": _change(scene, scene.changes.side),
        "offset": scene.offset, "gap": gap, "has_lead": led,
        "headway": np.where(led, np.minimum(gap / np.maximum(scene.speed, _SLOW), _LONGEST_HEADWAY),
            _LONGEST_HEADWAY),
        "border_left": np.where(on, 0.5 * lanes.width[place] - scene.offset - half, 0.0),
        "border_right": np.where(on, 0.5 * lanes.width[place] + scene.offset - half, 0.0),
        "lanes_to_left": np.where(on, left[place], 0),
        "lanes_to_right": np.where(on, right[place], 0),
        "lane_behind": np.where(on, np.clip(scene.along, 0.0, _FAR), 0.0),
        "lane_ahead": np.where(on, np.clip(lanes.length[place] - scene.along, 0.0, _FAR), 0.0),
        "limit": np.where(on & np.isfinite(limit), limit, 0.0),
        "has_limit": on & np.isfinite(limit),
    }  # fmt: skip
    role = np.where(
        scene.role == ROLES.index(LaneRole.SIGNALISED), ROLES.index(LaneRole.INSIDE), scene.role
    )
    found |= {f"role_{name}": role == code for code, name in enumerate(ROLES)}
    return {name: np.asarray(values, np.float32) for name, values in found.items()}


def _relative(scene: Scene, rows: IntArray, there: BoolArray) -> Values:
    """Features of rows relative to the ego's row of the same frame; the ego's own relative to the
    middle of its window."""
    frames = rows.shape[2]
    own = rows[:, :1]
    middle = own[:, :, frames // 2]
    # An ego that is absent in the middle is seen from its last row.
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
    """Return the relations of the rows `b` to the rows `a`."""
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
        "along": np.clip(np.where(related, along, 0.0), -_FAR, _FAR),
        "aside": np.where(lanes.same_way, aside, 0.0),
        "ahead": dx * cos + dy * sin, "left": dy * cos - dx * sin,
        "closing_ahead": scene.speed[b] * np.cos(turn) - scene.speed[a],
        "closing_left": scene.speed[b] * np.sin(turn),
        "cos": np.cos(turn), "sin": np.sin(turn), "lanes_left": lanes.lanes.astype(np.float64),
        "is_lead": (leads.row[a] == b).astype(np.float64),
        "is_follower": (leads.follower[a] == b).astype(np.float64),
        "same_way": lanes.same_way.astype(np.float64), "merging": lanes.merging.astype(np.float64),
    }  # fmt: skip


def _beside(lanes: LaneGraph) -> tuple[IntArray, IntArray]:
    """Return the numbers of drivable lanes in each strip's direction to its left and right."""
    places: dict[tuple[str, int, bool], list[int]] = {}
    for strip in lanes.strips:
        if strip.kind in DRIVABLE:
            places.setdefault((strip.road, strip.section, strip.forward), []).append(strip.place)
    found = [places.get((strip.road, strip.section, strip.forward), []) for strip in lanes.strips]
    left = [
        sum(one < strip.place for one in others)
        for strip, others in zip(lanes.strips, found, strict=True)
    ]
    right = [
        sum(one > strip.place for one in others)
        for strip, others in zip(lanes.strips, found, strict=True)
    ]
    return np.array(left, np.int64), np.array(right, np.int64)


def _neighbours(scene: Scene) -> tuple[IntArray, IntArray, FloatArray]:
    """Rows about 0.2 s before and after each one of the same part of its track, and the time
    between, s."""
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
        np.arctan2(
            sin[after] * cos[before] - cos[after] * sin[before],
            cos[after] * cos[before] + sin[after] * sin[before],
        )
        / apart
    )
