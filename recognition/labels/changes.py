"""Lane changes and passages of junctions: the courses of tracks through the lanes of a site."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from recognition.labels.classes import Rules
from recognition.scenes import Site
from recognition.scenes.lanes import NOWHERE, LaneGraph
from recognition.scenes.roles import ROLES, LaneRole
from runner.recording import Recording
from schemas.common.array_types import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class SceneRows:
    """Rows of all vehicles.

    Attributes:
        names: of the tracks. egos: whether events may be about each of them.
        track: index of each row's track. frame: number of its time step. time: s.
        first, last: first and last row of the part without missing frames that each row is in.
        x, y, h, speed, acceleration: as in the recording; the acceleration is smoothed.
        strip: index of the lane strip. along: distance from its beginning, m. offset, aside:
            distance to the left of the lane's centre and of the road's reference line, m.
        role: index into `ROLES`. certain: whether that is sure. front, rear: distance of the box's
            ends ahead of the reference point, m. width: of the box, m.
    """

    recording: Recording
    site: Site
    rules: Rules
    step: float
    names: list[str]
    egos: BoolArray
    track: IntArray
    frame: IntArray
    time: FloatArray
    first: IntArray
    last: IntArray
    x: FloatArray
    y: FloatArray
    h: FloatArray
    speed: FloatArray
    acceleration: FloatArray
    strip: IntArray
    along: FloatArray
    offset: FloatArray
    aside: FloatArray
    role: IntArray
    certain: BoolArray
    front: FloatArray
    rear: FloatArray
    width: FloatArray

    def rows(self, seconds: float) -> int:
        """Number of time steps in a time, at least 1."""
        return max(1, round(seconds / self.step))

    def centred(self, row: IntArray) -> IntArray:
        """The nearest row to each one about which a whole window is there, if its part is as long
        as that."""
        half = self.rows(0.5 * self.rules.window)
        return np.maximum(
            np.minimum(np.maximum(row, self.first[row] + half), self.last[row] - half),
            self.first[row],
        )

    def has_role(self, *roles: LaneRole) -> BoolArray:
        """Rows on lanes of these roles."""
        return np.isin(self.role, [ROLES.index(role) for role in roles])

    def lane_width(self, row: IntArray) -> FloatArray:
        """Width (m) of the lanes of rows, `rules.width` at most, to compare displacements with."""
        return np.minimum(self.site.lanes.width[self.strip[row]], self.rules.width)


class Stays(NamedTuple):
    """First row and number of rows of each stay."""

    start: IntArray
    size: IntArray

    @property
    def end(self) -> IntArray:
        """The row after the last one of each."""
        return self.start + self.size


def stays(values: IntArray, group: IntArray) -> Stays:
    """Runs of equal values within runs of equal groups."""
    begins = np.ones(len(values), bool)
    begins[1:] = (values[1:] != values[:-1]) | (group[1:] != group[:-1])
    start = np.flatnonzero(begins)
    return Stays(start, np.diff(np.append(start, len(values))))


def held(values: IntArray, group: IntArray, least: int | IntArray) -> IntArray:
    """Values in which stays of fewer than `least` rows (of all, or of each) count to the last
    longer one in the same group."""
    start, size = stays(values, group)
    number = np.arange(len(start))
    # Index of the last stay that is long enough, carried forward; a short stay takes its value.
    last_long = np.maximum.accumulate(np.where(size >= least, number, -1))
    same = (last_long >= 0) & (group[start[last_long]] == group[start])
    return np.repeat(values[start[np.where(same, last_long, number)]], size)


def totals(
    values: NDArray, half: int, first: IntArray, last: IntArray
) -> tuple[FloatArray, IntArray]:
    """Return sum and number of the values within `half` rows of each row, inside its part."""
    here = np.arange(len(values))
    before, after = np.maximum(here - half, first), np.minimum(here + half, last)
    # Differences of running sums: the cost does not depend on the window's length.
    sums = np.concatenate([[0.0], np.cumsum(values, dtype=np.float64)])
    return sums[after + 1] - sums[before], after + 1 - before


def smoothed(values: FloatArray, half: int, first: IntArray, last: IntArray) -> FloatArray:
    """Mean over `half` rows to either side."""
    total, number = totals(values, half, first, last)
    return total / number


def deviation(values: FloatArray, half: int, first: IntArray, last: IntArray) -> FloatArray:
    """Standard deviation over `half` rows to either side."""
    centred = values - (
        values.mean() if len(values) else 0.0
    )  # small numbers: their squares lose no digits
    mean, square = (smoothed(one, half, first, last) for one in (centred, centred**2))
    return np.sqrt(np.maximum(square - mean**2, 0.0))


def always(flags: BoolArray, half: int, first: IntArray, last: IntArray) -> BoolArray:
    """Return a mask of rows whose neighbours from `half` before to `half` after all have a flag and
    exist."""
    total, _ = totals(flags, half, first, last)
    # A window cut by the ends of a part has fewer rows, and so never the full count.
    return total == 2 * half + 1


def constant(values: NDArray, half: int, first: IntArray, last: IntArray) -> BoolArray:
    """Return a mask of rows with one value from `half` before to `half` after,
    all of them present.
    """
    changed = np.zeros(len(values), bool)
    changed[1:] = values[1:] != values[:-1]
    here = np.arange(len(values))
    inside = (here - half >= first) & (here + half <= last)
    sums = np.concatenate([[0], np.cumsum(changed)])
    before, after = np.maximum(here - half, first), np.minimum(here + half, last)
    return inside & (sums[after + 1] == sums[before + 1])


def along_road(scene: SceneRows, row: IntArray) -> BoolArray:
    """Rows in which a vehicle drives along its road, at less than `rules.oblique` to the lane.

    Within `rules.turning_time` before and after, it turns by no more than `rules.turning` beyond
    what the road bends.
    """
    # Turns cross borders of lanes too: a change of lane goes along the road, and does not turn.
    headings = np.array([_lane_heading(scene, index) for index in row.tolist()], np.float64)
    oblique = np.abs(_wrapped(scene.h[row] - headings))
    reach = scene.rows(scene.rules.turning_time)
    turns = _turns(
        scene, np.maximum(row - reach, scene.first[row]), np.minimum(row + reach, scene.last[row])
    )
    return (oblique <= np.radians(scene.rules.oblique)) & (
        np.abs(turns) <= np.radians(scene.rules.turning)
    )


def _turned(scene: SceneRows) -> FloatArray:
    """Change of heading in all rows before each row, rad."""
    return np.cumsum(_wrapped(np.diff(scene.h, prepend=scene.h[:1])))


def _turns(scene: SceneRows, first: IntArray, last: IntArray) -> FloatArray:
    """Change of heading from rows to later ones, less what the roads outside of junctions bend on
    the way, rad."""
    turned, off_road = _turned(scene), _off_road(scene)
    bends = [
        _bend(scene, a, b, off_road) for a, b in zip(first.tolist(), last.tolist(), strict=True)
    ]
    return turned[last] - turned[first] - np.array(bends, np.float64)


def _off_road(scene: SceneRows) -> BoolArray:
    """Rows in junctions and roundabouts, or on no lane."""
    return scene.has_role(
        LaneRole.INSIDE, LaneRole.SIGNALISED, LaneRole.ENTRY, LaneRole.RING, LaneRole.EXIT
    ) | (scene.strip == NOWHERE)


def _bend(scene: SceneRows, first: int, last: int, off_road: BoolArray) -> float:
    """Return the total bend (rad) of the lanes below these rows, without junctions."""
    strips = scene.strip[first : last + 1]
    starts = np.append(0, np.flatnonzero(np.diff(strips)) + 1)
    ends = np.append(starts[1:] - 1, len(strips) - 1)
    stays = [
        (first + a, first + b)
        for a, b in zip(starts.tolist(), ends.tolist(), strict=True)
        # Lanes in junctions bend with every way through them; what the road bends is known outside
        # only.
        if not off_road[first + a]
    ]
    return sum(float(_wrapped(_lane_heading(scene, b) - _lane_heading(scene, a))) for a, b in stays)


def _lane_heading(scene: SceneRows, row: int) -> float:
    return scene.site.lanes.heading(int(scene.strip[row]), float(scene.along[row]))


def _wrapped(angle: FloatArray | float) -> FloatArray:
    """Angle between -π and π."""
    return np.remainder(np.asarray(angle) + np.pi, 2.0 * np.pi) - np.pi


class Exits(NamedTuple):
    """Rows at which vehicles leave their lane obliquely, or come into one so, outside of junctions.

    row: the first one beyond the lane, or on it. leaves: whether it leaves. beside: whether it is
    on no driving lane within `rules.beside`.
    """

    row: IntArray
    leaves: BoolArray
    beside: BoolArray


def exits(scene: SceneRows, course: IntArray) -> Exits:
    """Return where vehicles leave or enter lanes at more than `rules.oblique`, given the courses of
    rows.

    Near an end of a lane that no other one is linked to, the map ends, not the road.
    """
    on = _driving(scene)
    road, angle = on & ~_off_road(scene) & ~_at_open_end(scene), np.radians(scene.rules.oblique)
    other = (course[1:] != course[:-1]) | (on[1:] != on[:-1])
    crossed = np.flatnonzero(other & (scene.first[1:] == scene.first[:-1])) + 1
    # Standing vehicles have headings of noise.
    crossed = crossed[scene.speed[crossed] >= scene.rules.cut_speed]
    away = np.append(0, np.cumsum(~on))
    reach, found = scene.rows(scene.rules.beside), []
    for leaves in (True, False):
        lane = crossed - 1 if leaves else crossed
        row, lane = crossed[road[lane]], lane[road[lane]]
        headings = np.array([_lane_heading(scene, index) for index in lane.tolist()], np.float64)
        row = row[np.abs(_wrapped(scene.h[row] - headings)) > angle]
        first = row if leaves else np.maximum(row - reach, scene.first[row])
        last = np.minimum(row + reach, scene.last[row] + 1) if leaves else row
        found.append((row, np.full(len(row), leaves), away[last] > away[first]))
    return Exits(*(np.concatenate(columns) for columns in zip(*found, strict=True)))


def _driving(scene: SceneRows) -> BoolArray:
    """Rows on driving lanes."""
    return (scene.strip != NOWHERE) & scene.site.lanes.driving[scene.strip]


_OPEN = 10.0
"""Distance from the open end of a lane within which vehicles may come from, or drive to, roads that
the map lacks, m"""


def _at_open_end(scene: SceneRows) -> BoolArray:
    """Rows near an end of their lane that no other lane is linked to."""
    lanes, strip = scene.site.lanes, scene.strip
    last, first = (
        np.array([not linked for linked in links], bool)
        for links in (lanes.following, lanes.preceding)
    )
    ahead = lanes.length[strip] - scene.along
    return (strip != NOWHERE) & (
        (last[strip] & (ahead < _OPEN)) | (first[strip] & (scene.along < _OPEN))
    )


class Changes(NamedTuple):
    """Changes of lane: the first row in the new lane, whether it is to the left, and the lateral
    displacement towards it, m."""

    row: IntArray
    left: BoolArray
    shift: FloatArray


@dataclass(frozen=True, eq=False)
class LaneChanges:
    """All changes of lane that are held, and the lanes that they lead through.

    Attributes:
        lane: number of each row's lane within its course, counted to the left, short stays left
            out.
        step: how many lanes to the left each row is of the one before, short stays included.
        course: number of the course of each row: a part of a track that goes on along connected
            lanes without missing frames.
        side: distance of each row to the left of where its course begins, m, following the lanes.
        row: the first row in the new lane, one for each change; `row - 1` is the last one in the
            old lane.
        left: whether the change is to the left.
        shift: lateral displacement towards the new lane about the change, m.
        partial: changes of which only a part may have been recorded: the track begins or ends
            within `rules.shift_time`.
    """

    lane: IntArray
    step: IntArray
    course: IntArray
    side: FloatArray
    row: IntArray
    left: BoolArray
    shift: FloatArray
    partial: Changes


def lane_changes(scene: SceneRows) -> LaneChanges:
    """The lane changes of all tracks: one lane to the side, with both lanes held for `rules.hold`;
    partial ones apart.

    Borders that are crossed in a turn are none.
    """
    # A course is a stretch along connected lanes; only within one can lanes be counted to the left.
    steps, related = _steps(scene.site.lanes, scene.strip)
    steps = _beside(scene, steps)
    related |= _overlapping(scene, ~related)
    begins = np.ones(len(scene.track), bool)
    begins[1:] = (scene.first[1:] != scene.first[:-1]) | ~related
    course = np.cumsum(begins) - 1
    steps = np.where(begins, 0, np.concatenate([[0], steps]))
    raw = np.cumsum(steps)
    # Counted from the lane in which the course begins.
    raw -= raw[_first(begins)]
    hold, side = scene.rows(scene.rules.hold), _side(scene, steps, begins)
    lane = held(raw, course, hold)
    row, left = _sideways(scene, lane, begins)
    kept = _is_held(lane, course, row, hold) & along_road(scene, row)
    whole = _LaneStays(scene, lane, course, side).changes(row[kept], left[kept])
    return LaneChanges(
        lane, steps, course, side, *whole, _partial(scene, raw, course, side, begins)
    )


def _sideways(scene: SceneRows, lane: IntArray, begins: BoolArray) -> tuple[IntArray, BoolArray]:
    """Rows with which a stay in the lane beside begins, and whether that is the left one.

    Lanes of different roads may overlap; unless they touch side by side, the vehicle itself has to
    move aside by half a lane between them.
    """
    row = np.flatnonzero((np.abs(np.diff(lane)) == 1) & ~begins[1:]) + 1
    left = lane[row] > lane[row - 1]
    road = scene.site.lanes.road[scene.strip]
    enough = np.where(left, 1.0, -1.0) * _aside(scene, row) >= 0.5 * scene.lane_width(row)
    # Lanes of one road lie side by side: no motion has to show it.
    kept = (road[row] == road[row - 1]) | enough
    for index in np.flatnonzero(~kept).tolist():
        pair = scene.strip[row[index] - 1], scene.strip[row[index]]
        kept[index] = scene.site.lanes.side_by_side(*map(int, pair)) is not None
    return row[kept], left[kept]


def _aside(scene: SceneRows, row: IntArray) -> FloatArray:
    """Displacement to the left (m) from `rules.shift_time` before to as long after rows, beyond
    that of an arc."""
    reach = scene.rows(scene.rules.shift_time)
    first, last = (
        np.maximum(row - reach, scene.first[row]),
        np.minimum(row + reach, scene.last[row]),
    )
    x, y, heading = scene.x[last] - scene.x[first], scene.y[last] - scene.y[first], scene.h[first]
    # An arc that turns by φ over a chord of c leads c·φ/2 to its side: that is the bend, no change.
    arc = 0.5 * np.hypot(x, y) * _wrapped(scene.h[last] - heading)
    return y * np.cos(heading) - x * np.sin(heading) - arc


def _partial(
    scene: SceneRows, raw: IntArray, course: IntArray, side: FloatArray, begins: BoolArray
) -> Changes:
    """Changes about which not all is recorded that their displacement is measured in."""
    lane = _held_at_ends(scene, raw, course)
    row, left = _sideways(scene, lane, begins)
    reach = scene.rows(scene.rules.shift_time)
    near = (row - scene.first[row] < reach) | (scene.last[row] - row < reach)
    row, left = row[near], left[near]
    kept = along_road(scene, row)
    row, left, about = row[kept], left[kept], _LaneStays(scene, lane, course, side)
    seen = about.whole(row, left)
    return about.changes(row[seen], left[seen])


def _held_at_ends(scene: SceneRows, raw: IntArray, course: IntArray) -> IntArray:
    """Lanes; at the ends of a track, which may be cut, a lane need not be held for `rules.hold`."""
    return held(raw, course, at_ends(scene, raw, course, scene.rows(scene.rules.hold)))


def at_ends(scene: SceneRows, values: IntArray, group: IntArray, least: int) -> IntArray:
    """Least rows of each stay: `least`, or `rules.partial_hold` at the ends of tracks, which may be
    cut."""
    start, size = stays(values, group)
    last = start + size - 1
    at_end = (start == scene.first[start]) | (last == scene.last[last])
    return np.where(at_end, np.minimum(scene.rows(scene.rules.partial_hold), least), least)


def _steps(lanes: LaneGraph, strip: IntArray) -> tuple[IntArray, BoolArray]:
    """Return the lane offset to the left of each row from the one before, and whether these lanes
    are connected."""
    before, after = strip[:-1], strip[1:]
    steps, related = np.zeros(len(before), np.int64), np.ones(len(before), bool)
    moved = np.flatnonzero(before != after)
    # Tracks repeat few pairs of strips thousands of times: each pair is looked up once.
    pairs, which = np.unique(
        np.stack([before[moved], after[moved]], axis=1), axis=0, return_inverse=True
    )
    found = [lanes.lanes_left(a, b) if NOWHERE not in (a, b) else None for a, b in pairs.tolist()]
    steps[moved] = np.array([step or 0 for step in found], np.int64)[which.reshape(-1)]
    related[moved] = np.array([step is not None for step in found], bool)[which.reshape(-1)]
    return steps, related


def _beside(scene: SceneRows, steps: IntArray) -> IntArray:
    """Lane offsets from each row to the next, 0 between branches of a fork where the centre of one
    is nearer to that of the other than to the place beside it.

    Branches begin in one place: rows jump between them, and the vehicle goes on.
    """
    lanes, width, moved = scene.site.lanes, scene.site.lanes.width, np.diff(scene.offset)
    before, after = scene.strip[:-1], scene.strip[1:]
    beside = moved + steps * 0.5 * (width[before] + width[after])
    near = (steps != 0) & (np.abs(moved) < np.abs(beside))
    near &= lanes.road[before] != lanes.road[after]
    steps = steps.copy()
    for index in np.flatnonzero(near).tolist():
        if after[index] not in lanes.following[before[index]]:
            steps[index] = 0
    return steps


_SAME_LANE = 1.0
"""Greatest distance between the centres of lanes that count as one where they overlap, m"""


def _overlapping(scene: SceneRows, changed: BoolArray) -> BoolArray:
    """Mask of steps from a row to the next that lead to a lane which overlaps the one before, with
    nearly its centre and way."""
    near = (
        changed
        & (scene.strip[1:] != NOWHERE)
        & (scene.strip[:-1] != NOWHERE)
        & (scene.first[1:] == scene.first[:-1])
    )
    row = np.flatnonzero(near & (np.abs(np.diff(scene.offset)) < _SAME_LANE))
    bends = [
        float(_wrapped(_lane_heading(scene, index + 1) - _lane_heading(scene, index)))
        for index in row.tolist()
    ]
    near[:] = False
    near[row[np.abs(np.array(bends, np.float64)) < np.radians(scene.rules.oblique)]] = True
    return near


def _first(begins: BoolArray) -> IntArray:
    """The first row of each row's course."""
    return np.maximum.accumulate(np.where(begins, np.arange(len(begins)), 0))


def _is_held(lane: IntArray, course: IntArray, row: IntArray, least: int) -> BoolArray:
    """Whether the stays before and after each of the rows, with which a stay begins, are long
    enough."""
    starts, sizes = stays(lane, course)
    place = np.searchsorted(starts, row)
    return (sizes[place] >= least) & (sizes[place - 1] >= least)


def _side(scene: SceneRows, steps: IntArray, begins: BoolArray) -> FloatArray:
    """Lateral way to the left since each course began: changes of the lane offset, or of t where
    the lane changes."""
    lanes, before, after = scene.site.lanes, scene.strip[:-1], scene.strip[1:]
    # Between roads t is not comparable: half the widths of both lanes stand in for it.
    to_road = np.diff(scene.offset) + steps[1:] * 0.5 * (lanes.width[before] + lanes.width[after])
    to_lane = np.where(lanes.road[before] == lanes.road[after], np.diff(scene.aside), to_road)
    moved = np.concatenate([[0.0], np.where(steps[1:] == 0, np.diff(scene.offset), to_lane)])
    side = np.cumsum(np.where(begins, 0.0, moved))
    return side - side[_first(begins)]


class _LaneStays(NamedTuple):
    """Lanes, courses and lateral ways of all rows, as in `LaneChanges`."""

    scene: SceneRows
    lane: IntArray
    course: IntArray
    side: FloatArray

    def changes(self, row: IntArray, left: BoolArray) -> Changes:
        """Changes into the stays that begin with rows, of `rules.depth` at least."""
        deep = self._depths(row, left) >= self.scene.rules.depth
        row, left = row[deep], left[deep]
        return Changes(row, left, self._shifts(row, left))

    def whole(self, row: IntArray, left: BoolArray) -> BoolArray:
        """Whether boxes are seen whole in one of the lanes of each change, by `rules.depth` more:
        beside a border, boxes jitter and lanes of maps shift."""
        earliest, _ = self._about(row)
        scene, side, towards, last = self.scene, self.side, np.where(left, 1.0, -1.0), row - 1
        left_behind = 0.5 * scene.site.lanes.width[scene.strip[last]] - towards * scene.offset[last]
        before = left_behind + [
            (sign * (side[end] - side[start : end + 1])).max()
            for start, end, sign in zip(
                earliest.tolist(), last.tolist(), towards.tolist(), strict=True
            )
        ]
        deepest = np.maximum(before, self._depths(row, left))
        return deepest >= 0.5 * scene.width[row] + scene.rules.depth

    def _depths(self, rows: IntArray, left: BoolArray) -> FloatArray:
        """Greatest way (m) beyond the border that each change crosses, within its stay after it."""
        _, latest = self._about(rows)
        scene, side, towards = self.scene, self.side, np.where(left, 1.0, -1.0)
        # At the border the offset is half the width of the new lane, to the side that is left.
        entered = 0.5 * scene.site.lanes.width[scene.strip[rows]] + towards * scene.offset[rows]
        further = [
            (sign * (side[row:end] - side[row])).max()
            for row, end, sign in zip(rows.tolist(), latest.tolist(), towards.tolist(), strict=True)
        ]
        return entered + np.array(further, np.float64)

    def _shifts(self, rows: IntArray, left: BoolArray) -> FloatArray:
        """Displacement from the outermost place before to the outermost place after each change,
        within its two stays."""
        earliest, latest = self._about(rows)
        side, towards = self.side, np.where(left, 1.0, -1.0)
        # From the outermost place on one side to the outermost on the other: a vehicle that swings
        # out first covers more than from border to border.
        shifts = [
            (sign * side[row:end]).max() - (sign * side[start:row]).min()
            for row, start, end, sign in zip(
                rows.tolist(), earliest.tolist(), latest.tolist(), towards.tolist(), strict=True
            )
        ]
        return np.array(shifts, np.float64)

    def _about(self, rows: IntArray) -> tuple[IntArray, IntArray]:
        """First row, and the one after the last, of the two stays about each change, within
        `rules.shift_time`."""
        reach = self.scene.rows(self.scene.rules.shift_time)
        starts, sizes = stays(self.lane, self.course)
        place = np.searchsorted(starts, rows)
        earliest = np.maximum(rows - reach, starts[place - 1])
        return earliest, np.minimum(rows + reach, rows + sizes[place])


@dataclass(frozen=True, eq=False)
class Passages:
    """Ways through junctions, in the order of their rows; also of tracks that begin or end inside.

    Attributes:
        first, last: first and last row: those beside the junction, or those inside where the track
            begins or ends.
        arrived: whether the last row is behind the junction.
        row: the middle: half of the turn is done there, or, of a straight way, half of the way; if
            the track begins or ends too near to that of a turn for a whole window, the nearest row
            of the passage that has one.
        turn: change of heading, rad, positive to the left, see `_heading_changes`; nan where too
            little of it was recorded.
        junction: number of the junction.
        signalised: whether it has traffic lights.
        origin, target: strips before and behind the junction, NOWHERE where neither track nor map
            tell.
        origin_road: number of the road of the origin, NOWHERE likewise.
    """

    first: IntArray
    last: IntArray
    arrived: BoolArray
    row: IntArray
    turn: FloatArray
    junction: IntArray
    signalised: BoolArray
    origin: IntArray
    target: IntArray
    origin_road: IntArray

    def __len__(self) -> int:
        return len(self.row)

    def rows(self, index: int) -> IntArray:
        """All rows of one of them."""
        return np.arange(self.first[index], self.last[index] + 1)


def passages(scene: SceneRows) -> Passages:
    """The ways of all tracks through junctions, of `rules.passage` at least, or half of it in
    turns.

    Whatever lanes they are on: those for bicycles overlap others.
    """
    junction_of, road_of = _junctions(scene), scene.site.lanes.road
    crossings = junction_of[scene.strip[scene.has_role(LaneRole.INSIDE, LaneRole.SIGNALISED)]]
    # Only junctions with crossing traffic: direct junctions of ramps are `junction` elements as
    # well.
    inside = np.where(np.isin(junction_of, crossings), junction_of, NOWHERE)
    inside = np.where(scene.strip != NOWHERE, inside[scene.strip], NOWHERE)
    inside = held(inside, scene.track, scene.rows(scene.rules.flicker))
    start, size = stays(inside, scene.track)
    way = np.cumsum(
        np.hypot(np.diff(scene.x, prepend=scene.x[:1]), np.diff(scene.y, prepend=scene.y[:1]))
    )
    length = way[start + size - 1] - way[start]
    chosen = (inside[start] != NOWHERE) & (length >= 0.5 * scene.rules.passage)
    start, end, length = start[chosen], (start + size - 1)[chosen], length[chosen]
    entered, arrived = _same_track(scene, start, -1), _same_track(scene, end, 1)
    # One row outside on either side, so that the whole turn, and the roads it leads from and to,
    # count.
    first, last = start - entered, end + arrived
    turned = _turned(scene)
    turn = _heading_changes(scene, turned, first, last, entered, arrived)
    counting = (length >= scene.rules.passage) | (np.abs(turn) >= np.radians(scene.rules.turn[0]))
    kept = (start, first, last, entered, arrived, turn)
    start, first, last, entered, arrived, turn = (column[counting] for column in kept)
    straight = np.abs(turn) < np.radians(scene.rules.turn[0])
    # Half of the turn, or of the way where nothing turns.
    middle = [
        _half(way if goes_straight else turned, a, b)
        for a, b, goes_straight in zip(
            first.tolist(), last.tolist(), straight.tolist(), strict=True
        )
    ]
    row = np.array(middle, np.int64)
    # A turn near the edge of a recording takes the nearest row with a whole window.
    row = np.where(straight, row, np.clip(scene.centred(row), first, last))
    origin = np.where(
        entered, scene.strip[first], _neighbours(scene.site.lanes.preceding, scene.strip[first])
    )
    target = np.where(
        arrived, scene.strip[last], _neighbours(scene.site.lanes.following, scene.strip[last])
    )
    lights = np.isin(inside[start], junction_of[scene.strip[scene.has_role(LaneRole.SIGNALISED)]])
    roads = np.where(origin != NOWHERE, road_of[origin], NOWHERE)
    return Passages(first, last, arrived, row, turn, inside[start], lights, origin, target, roads)


def _heading_changes(
    scene: SceneRows,
    turned: FloatArray,
    first: IntArray,
    last: IntArray,
    entered: BoolArray,
    arrived: BoolArray,
) -> FloatArray:
    """Change of heading (rad) in passages, given that in all rows before each row.

    One of less than `rules.turn` counts from the heading of its lane's start, or to that of its
    end, where the track begins or ends inside, if it turns by `rules.partial_turn` itself. Vehicles
    begin turns before junctions and end them behind: what is turned beyond the bends of the roads
    within `rules.turning_time` before and after, up to other passages, counts if that makes it a
    turn.
    """
    rules = scene.rules
    recorded, least, turning = (
        turned[last] - turned[first],
        np.radians(rules.straight),
        np.radians(rules.turn[0]),
    )
    missing = np.zeros(len(first))
    for number in np.flatnonzero(~(entered & arrived) & (np.abs(recorded) < turning)).tolist():
        begin, end = int(first[number]), int(last[number])
        if not entered[number]:
            missing[number] += _lane_turn(scene, begin, at_end=False)
        if not arrived[number]:
            missing[number] += _lane_turn(scene, end, at_end=True)
    turn = recorded + missing
    around, partial = np.zeros(len(first)), np.radians(rules.partial_turn)
    near = (np.abs(turn) < turning) | (np.abs(recorded) < partial)
    reach, off_road = scene.rows(rules.turning_time), _off_road(scene)
    for number in np.flatnonzero((np.abs(recorded) >= least) & near).tolist():
        begin, end = int(first[number]), int(last[number])
        earliest, latest = (
            max(begin - reach, int(scene.first[begin])),
            min(end + reach, int(scene.last[end])),
        )
        # Up to the neighbouring passages: a turn counts once.
        if number and scene.track[last[number - 1]] == scene.track[begin]:
            earliest = max(earliest, min(int(last[number - 1]), begin))
        if number + 1 < len(first) and scene.track[first[number + 1]] == scene.track[end]:
            latest = min(latest, max(int(first[number + 1]), end))
        around[number] = turned[begin] - turned[earliest] + turned[latest] - turned[end]
        around[number] -= _bend(scene, earliest, begin, off_road)
        around[number] -= _bend(scene, end, latest, off_road)
    more = (np.abs(turn) < turning) & (np.abs(turn + around) >= turning)
    turn = np.where(more, turn + around, turn)
    # A turn by the map, of which the vehicle has shown little, is not known.
    turn[(np.abs(turn) >= turning) & (np.abs(recorded + around) < partial)] = np.nan
    return turn


class Turns(NamedTuple):
    """Turns beside junctions: the row at which half of it is done, and the change of heading, rad,
    positive to the left."""

    row: IntArray
    turn: FloatArray


def side_turns(scene: SceneRows, crossed: Exits, ways: Passages) -> Turns:
    """Turns between a lane and a place beside the road, such as a driveway, and those that cut a
    corner between lanes, within `rules.shift_time` of the lane's border.

    Bends of the lanes are no turns; turns in junctions before or behind are others, and those
    between a lane and a parking place beside it are none.
    """
    turned, reach = _turned(scene), scene.rows(scene.rules.shift_time)
    found: list[tuple[int, float]] = []
    beside = crossed.row[crossed.beside & ~_parking(scene, crossed)]
    for row in np.union1d(beside, _corners(scene)).tolist():
        first, last = (
            max(row - reach, int(scene.first[row])),
            min(row + reach, int(scene.last[row])),
        )
        mine = scene.track[ways.first] == scene.track[row]
        if (mine & (ways.first < row) & (row < ways.last)).any():
            continue
        first = max([first, *ways.last[mine & (ways.last <= row)].tolist()])
        last = min([last, *ways.first[mine & (ways.first >= row)].tolist()])
        middle = _half(turned, first, last)
        if (
            not found
            or scene.track[found[-1][0]] != scene.track[middle]
            or middle - found[-1][0] > reach
        ):
            found.append((middle, float(_turns(scene, np.array([first]), np.array([last]))[0])))
    rows, angles = (
        (np.array(column) for column in zip(*found, strict=True))
        if found
        else (np.zeros(0, np.int64), np.zeros(0))
    )
    return Turns(scene.centred(rows), angles)


def _parking(scene: SceneRows, crossed: Exits) -> BoolArray:
    """Whether each vehicle stands on no lane, and gets no further than `rules.parking` from the
    border that it crosses, after it leaves its lane or before it enters one."""
    on, found = _driving(scene), []
    for row, leaves in zip(crossed.row.tolist(), crossed.leaves.tolist(), strict=True):
        end = int(scene.last[row] if leaves else scene.first[row])
        away = np.arange(row, end + 1) if leaves else np.arange(row - 1, end - 1, -1)
        away = away[np.logical_and.accumulate(~on[away])]
        apart = np.hypot(scene.x[away] - scene.x[row], scene.y[away] - scene.y[row])
        stands = (scene.speed[away] < scene.rules.cut_speed).any()
        found.append(bool(stands and apart.max() < scene.rules.parking))
    return np.array(found, bool)


def _corners(scene: SceneRows) -> IntArray:
    """Rows at which vehicles leave a lane for one that leads elsewhere, by `rules.turn`, with no
    lane in between for less than twice `rules.beside`: they cut a corner."""
    start, size = stays(scene.strip, scene.first)
    # Between two stays of one track, on lanes.
    off = np.flatnonzero(scene.strip[start] == NOWHERE)
    off = off[(off > 0) & (off + 1 < len(start))]
    before, after = start[off] - 1, start[off] + size[off]
    kept = (
        (scene.first[before] == scene.first[start[off]])
        & (scene.first[after] == scene.first[start[off]])
        & (size[off] < 2 * scene.rows(scene.rules.beside))
    )
    off, before, after = off[kept], before[kept], after[kept]
    bends = [
        abs(float(_wrapped(_lane_heading(scene, b) - _lane_heading(scene, a))))
        for a, b in zip(before.tolist(), after.tolist(), strict=True)
    ]
    return start[off][np.array(bends, np.float64) >= np.radians(scene.rules.turn[0])]


def _lane_turn(scene: SceneRows, row: int, *, at_end: bool) -> float:
    """Return the change of heading (rad) from the start of a row's lane to the vehicle, or from
    there to the end of the lane.

    Vehicles that cut the corner are ahead of the bend of their lane: their own heading counts.
    """
    lanes, strip = scene.site.lanes, int(scene.strip[row])
    if strip == NOWHERE:
        return 0.0
    if at_end:
        return float(_wrapped(lanes.heading(strip, float(lanes.length[strip])) - scene.h[row]))
    return float(_wrapped(scene.h[row] - lanes.heading(strip, 0.0)))


def _same_track(scene: SceneRows, row: IntArray, step: int) -> BoolArray:
    """Whether the row before (step -1) or after (1) each row is of the same track."""
    other = row + step
    there = (other >= 0) & (other < len(scene.track))
    return there & (scene.track[np.where(there, other, 0)] == scene.track[row])


def _neighbours(links: list[list[int]], strip: IntArray) -> IntArray:
    """The strip that each one is linked to, or NOWHERE."""
    linked = np.array([found[0] if found else NOWHERE for found in links], np.int64)
    return np.where(strip != NOWHERE, linked[strip], NOWHERE)


def _junctions(scene: SceneRows) -> IntArray:
    """Number of the junction of each strip, NOWHERE for none."""
    network = scene.site.network
    numbers = {name: number for number, name in enumerate(network.junctions)}
    junctions = [
        numbers.get(network.roads[strip.road].junction_id or "", NOWHERE)
        for strip in scene.site.lanes.strips
    ]
    return np.array(junctions, np.int64)


def _half(values: FloatArray, start: int, end: int) -> int:
    """The first row at which half of the change of a value from one row to another is done."""
    share = (values[start : end + 1] - values[start]) / (values[end] - values[start] or 1.0)
    return start + int(np.argmax(share >= 0.5))
