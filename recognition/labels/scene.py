"""Scene of a recording as the rules read it; hits of the rules and their precedence."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from recognition.labels.changes import (
    Exits,
    LaneChanges,
    Passages,
    SceneRows,
    Turns,
    constant,
    exits,
    lane_changes,
    passages,
    side_turns,
    smoothed,
    stays,
)
from recognition.labels.classes import CONDITIONS, Label, LabelledEvent, Rules
from recognition.scenes import LaneRole, Site, place
from recognition.scenes.lanes import NOWHERE, LaneGraph, Poses, Strip, on_driving_lanes
from recognition.scenes.ramps import by_traffic
from recognition.scenes.roles import ROLES
from runner.judging.measures.criticality import time_headway, time_to_collision
from runner.judging.measures.measure import Series
from runner.recording import Recording, Track
from schemas.common.array_types import BoolArray, FloatArray, IntArray
from xodr.graph.ways import DRIVABLE
from xodr.lookup.placing import Places

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
        follower: row of the nearest vehicle with this row as its lead; ABSENT for none.
    """

    row: IntArray
    gap: FloatArray
    thw: Series
    ttc: Series
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
    # By frame, then strip, then place: the next row of the same frame and strip is the lead.
    order = np.lexsort((along, strip, frame))
    order = order[strip[order] != NOWHERE]
    keys = frame[order] * len(lanes.strips) + strip[order]
    same = keys[1:] == keys[:-1]
    behind, ahead = order[:-1][same], order[1:][same]
    row[behind], gap[behind] = ahead, along[ahead] - along[behind]
    heads, starts = np.unique(keys, return_index=True)
    # Foremost vehicles have no lead on their strip: they look further, all at once, strip by strip.
    searching = order[np.append(starts[1:], len(order)) - 1] if len(order) else order
    passed = lanes.length[strip[searching]] - along[searching]
    strips = _own_next(lanes, track, strip)[searching]
    for _ in range(_MOST_STRIPS):
        on = (strips != NOWHERE) & (passed < sight)
        searching, passed, strips = searching[on], passed[on], strips[on]
        key = frame[searching] * len(lanes.strips) + strips
        # `heads` is sorted, so the hindmost vehicle of a frame on a strip is found by bisection.
        place = np.minimum(np.searchsorted(heads, key), len(heads) - 1)
        found = heads[place] == key if len(heads) else np.zeros(0, bool)
        lead = order[starts[place[found]]]
        row[searching[found]], gap[searching[found]] = lead, passed[found] + along[lead]
        searching, passed, strips = searching[~found], passed[~found], strips[~found]
        passed, strips = passed + lanes.length[strips], lanes.straight[strips]
    return _measured(row, gap, track, speed, front, rear, sight)


def _own_next(lanes: LaneGraph, track: IntArray, strip: IntArray) -> IntArray:
    """The strip that each row's track takes next, as far as the track shows it; else the
    straightest."""
    # Where a lane forks, a lead is one on the way that the vehicle takes, known from its later
    # rows.
    following = lanes.straight[strip]
    following[strip == NOWHERE] = NOWHERE
    leaving = np.flatnonzero((strip[1:] != strip[:-1]) & (track[1:] == track[:-1]))
    pairs, which = np.unique(
        np.stack([strip[leaving], strip[leaving + 1]], axis=1), axis=0, return_inverse=True
    )
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
    row: IntArray,
    gap: FloatArray,
    track: IntArray,
    speed: FloatArray,
    front: FloatArray,
    rear: FloatArray,
    sight: float,
) -> Leads:
    led = row != ABSENT
    led[led] = track[row[led]] != track[led]  # once round a ring, a vehicle would lead itself
    gap = np.where(led, gap - front + rear[row], 0.0)
    led &= gap <= sight
    row, gap = np.where(led, row, ABSENT), np.where(led, gap, 0.0)
    follower = np.full(len(row), ABSENT, np.int64)
    nearest_last = np.flatnonzero(led)[np.argsort(-gap[led], kind="stable")]
    # Farthest first: of several followers of one lead the nearest is written last and stays.
    follower[row[nearest_last]] = nearest_last
    closing = np.where(led, speed - speed[row], 0.0)
    thw, ttc = time_headway(gap, speed), time_to_collision(gap, closing)
    return Leads(
        row, gap, Series(thw.value, thw.valid & led), Series(ttc.value, ttc.valid & led), follower
    )


_IN_LANE = 0.2
"""Greatest distance from the centre of the lane, in lane widths, of a still vehicle that queues;
others are parked."""
_SLOWEST = 0.5
"""Least mean speed of a vehicle that drives, by the area in which it moves, m/s"""
EGOS = ("car", "van", "truck", "bus", "motorbike")
"""Categories of vehicles that events are about; the others are only partners."""


class Scene(SceneRows):
    """Rows of all vehicles, with what all rules ask for prepared once."""

    @cached_property
    def numbers(self) -> dict[str, int]:
        """Numbers of the tracks by their names."""
        return {name: number for number, name in enumerate(self.names)}

    @cached_property
    def begin(self) -> float:
        """Time (s) of frame 0."""
        return float(self.time.min())

    @cached_property
    def passages(self) -> Passages:
        """Ways through junctions."""
        return passages(self)

    @cached_property
    def in_junction(self) -> BoolArray:
        """Strips on roads of junctions."""
        roads = self.site.network.roads
        return np.array(
            [roads[strip.road].junction_id is not None for strip in self.site.lanes.strips], bool
        )

    @cached_property
    def turning(self) -> BoolArray:
        """Rows of passages in which the vehicle turns by `rules.turn` at least."""
        ways, inside = self.passages, np.zeros(len(self.track), bool)
        for number in np.flatnonzero(
            np.abs(ways.turn) >= math.radians(self.rules.turn[0])
        ).tolist():
            inside[ways.rows(number)] = True
        return inside

    @cached_property
    def vulnerable(self) -> tuple[FloatArray, FloatArray, FloatArray, IntArray]:
        """x, y, time and a number of the track for all rows of pedestrians (with numbers below 0)
        and cyclists."""
        cyclists = [
            name for name in self.names if self.recording.tracks[name].category == "bicycle"
        ]
        walkers = [
            track.name for track in self.recording.tracks.values() if track.kind == "pedestrian"
        ]
        tracks = [self.recording.tracks[name] for name in (*cyclists, *walkers)]
        numbers = [
            *map(self.numbers.__getitem__, cyclists),
            *(-1 - number for number in range(len(walkers))),
        ]
        sizes = [len(track.columns["time"]) for track in tracks]
        x, y, time = (_joined(tracks, name) for name in ("x", "y", "time"))
        return x, y, time, np.repeat(np.array(numbers, np.int64), sizes)

    @cached_property
    def complete(self) -> BoolArray:
        """Rows of egos about which the whole window is there."""
        half, here = self.rows(0.5 * self.rules.window), np.arange(len(self.track))
        return self.egos[self.track] & (here - half >= self.first) & (here + half <= self.last)

    @cached_property
    def leads(self) -> Leads:
        """Lead of each vehicle."""
        return leads(
            self.site.lanes,
            self.track,
            self.frame,
            self.strip,
            self.along,
            self.speed,
            self.front,
            self.rear,
            self.rules.sight,
        )

    @cached_property
    def changes(self) -> LaneChanges:
        """Changes of lane."""
        return lane_changes(self)

    @cached_property
    def exits(self) -> Exits:
        """Borders of lanes that vehicles cross obliquely."""
        return exits(self, self.changes.course)

    @cached_property
    def side_turns(self) -> Turns:
        """Turns between lanes and places beside the road."""
        return side_turns(self, self.exits, self.passages)

    @cached_property
    def through(self) -> BoolArray:
        """Rows on lanes that lead past ramps and junctions, or straight through a junction with
        another lane beside them."""
        lanes, roads = self.site.lanes, self.site.network.roads
        beside = Counter(
            (strip.road, strip.section, strip.forward)
            for strip in lanes.strips
            if strip.kind in DRIVABLE
        )
        limit = math.radians(self.rules.straight)

        def wide(strip: Strip) -> bool:
            line = roads[strip.road].line
            bend = math.remainder(line.at(strip.end)[2] - line.at(strip.start)[2], math.tau)
            several = beside[strip.road, strip.section, strip.forward] > 1
            return strip.kind in DRIVABLE and several and abs(bend) < limit

        inside = np.append([wide(strip) for strip in lanes.strips], False)[self.strip]
        return self.has_role(LaneRole.MAIN, LaneRole.URBAN, LaneRole.APPROACH) | (
            self.has_role(LaneRole.INSIDE, LaneRole.SIGNALISED) & inside
        )

    def least_shift(self, row: IntArray) -> FloatArray:
        """Least lateral displacement (m) of a partly recorded change into the lane of each row."""
        share = np.where(
            self.role[row] == ROLES.index(LaneRole.MAIN),
            self.rules.partial_shift,
            self.rules.partial_urban_shift,
        )
        return share * self.lane_width(row)

    def steady(self, seconds: float) -> BoolArray:
        """Mask of rows whose track keeps its lane, without missing frames, from `seconds` before to
        `seconds` after."""
        half = self.rows(seconds)
        kept = (
            constant(values, half, self.first, self.last)
            for values in (self.changes.lane, self.changes.course)
        )
        return np.logical_and(*kept)


def prepare(recording: Recording, site: Site, rules: Rules) -> Scene:
    """Rows of all vehicles of a recording, which gets its road coordinates where it lacks them.

    Rows beside their lane or beyond the ends of their road are on no strip, as are all rows of
    parked vehicles.
    """
    place(recording, site.network)
    tracks = [
        track
        for track in recording.tracks.values()
        if track.kind == "vehicle" and len(track.columns["time"])
    ]
    sizes = np.array([len(track.columns["time"]) for track in tracks], np.int64)
    track = np.repeat(np.arange(len(tracks)), sizes)
    time = _joined(tracks, "time")
    frame = np.rint((time - (time.min() if len(time) else 0.0)) / recording.timestep).astype(
        np.int64
    )
    first, last = _parts(track, frame, rules.gap / recording.timestep)
    lanes, places = site.lanes, _places(tracks)
    strip = lanes.find(places.road_id, places.lane_id, places.s)
    motor = np.repeat(np.array([track.category in EGOS for track in tracks], bool), sizes)
    aside = np.flatnonzero(motor & (strip != NOWHERE) & ~lanes.driving[strip])
    if len(aside):
        x, y, z, h = (_joined(tracks, name)[aside] for name in ("x", "y", "z", "h"))
        moved = Places._make(column[aside] for column in places)
        # Maps have bicycle lanes and shoulders that overlap driving lanes; motor vehicles are on
        # the latter.
        on_driving_lanes(lanes, site.network, moved, Poses(x, y, z, h))
        for column, values in zip(places, moved, strict=True):
            column[aside] = values
        strip = lanes.find(places.road_id, places.lane_id, places.s)
    s, offset = places.s, places.offset
    strip = np.where(lanes.contains(strip, s, offset), strip, NOWHERE)
    still = np.array([is_parked(track, rules) for track in tracks], bool)
    beside = np.abs(offset) > _IN_LANE * lanes.width[strip]
    # A still vehicle in the middle of its lane queues; one at the edge is parked.
    strip = np.where(still[track] & beside, NOWHERE, strip)
    left = np.where(lanes.forward[strip], 1.0, -1.0)
    boxes = [track.box for track in tracks]
    half = max(1, round(0.5 * rules.smoothing / recording.timestep))
    return Scene(
        recording=recording,
        site=site,
        rules=rules,
        step=recording.timestep,
        names=[track.name for track in tracks],
        egos=np.array([track.category in EGOS for track in tracks], bool) & ~still,
        track=track,
        frame=frame,
        time=time,
        first=first,
        last=last,
        x=_joined(tracks, "x"),
        y=_joined(tracks, "y"),
        h=_joined(tracks, "h"),
        speed=_joined(tracks, "speed"),
        # Accelerations of recordings are differences of speeds, and noisy; thresholds need their
        # mean.
        acceleration=smoothed(_joined(tracks, "acceleration"), half, first, last),
        strip=strip,
        along=np.where(strip == NOWHERE, 0.0, lanes.along(strip, s)),
        offset=offset * left,
        aside=places.t * left,
        role=by_traffic(lanes, track, strip, site.roles.codes(lanes, strip, s)),
        certain=site.roles.certain(lanes, strip, s),
        front=np.repeat([box.x + 0.5 * box.length for box in boxes], sizes),
        rear=np.repeat([box.x - 0.5 * box.length for box in boxes], sizes),
        width=np.repeat([box.width for box in boxes], sizes),
    )


def is_parked(track: Track, rules: Rules) -> bool:
    """Whether the reference point of a track stays within `rules.parked`, or half a metre for each
    second of a short track."""
    extent = math.hypot(*(float(np.ptp(track.columns[name])) for name in ("x", "y")))
    # A track of a second covers little even if the vehicle drives: the limit grows with its length.
    return extent < min(rules.parked, _SLOWEST * float(np.ptp(track.columns["time"])))


def _places(tracks: list[Track]) -> Places:
    """Road coordinates of all rows of tracks, copied."""
    road_id, lane_id, s, t, offset = (
        _joined(tracks, name) for name in ("road_id", "lane_id", "s", "t", "lane_offset")
    )
    return Places(road_id, lane_id.astype(np.int64), s, t, offset)


def _joined(tracks: list[Track], name: str) -> NDArray:
    return np.concatenate([track.columns[name] for track in tracks]) if tracks else np.zeros(0)


def _parts(track: IntArray, frame: IntArray, gap: float) -> tuple[IntArray, IntArray]:
    """First and last row of each row's part, without gaps of more missing frames than `gap`."""
    begins = np.ones(len(track), bool)
    begins[1:] = (np.diff(track) != 0) | (np.diff(frame) > 1.0 + gap)
    ends = np.append(np.flatnonzero(begins), len(track))
    sizes = np.diff(ends)
    return np.repeat(ends[:-1], sizes), np.repeat(ends[1:] - 1, sizes)


def ahead_of(scene: Scene, rows: IntArray, seconds: float) -> IntArray:
    """Indices (n, k) of the rows from each given one to `seconds` later; missing rows are the last
    present one."""
    steps = np.arange(scene.rows(seconds) + 1)
    return np.minimum(rows[:, None] + steps, scene.last[rows][:, None])


def spaced(scene: Scene, flags: BoolArray, seconds: float, most: int) -> IntArray:
    """Rows of each track at which a flag holds, the first and then each at least `seconds` after
    the one before."""
    candidates = np.flatnonzero(flags)
    ends = np.searchsorted(scene.track[candidates], np.arange(len(scene.names) + 1))
    apart = scene.rows(seconds)
    chosen: list[int] = []
    for start, end in zip(ends[:-1].tolist(), ends[1:].tolist(), strict=True):
        mine = candidates[start:end]
        frames, place = scene.frame[mine], 0
        for _ in range(most):
            if place == len(mine):
                break
            chosen.append(int(mine[place]))
            place = int(np.searchsorted(frames, frames[place] + apart))
    return np.array(chosen, np.int64)


def spread(scene: Scene, flags: BoolArray, group: IntArray, seconds: float, most: int) -> IntArray:
    """Rows that stand for the stays in which a flag holds within one group: the middle of each, or
    of equal parts of `seconds` or more; at most so many of a track, the first."""
    start, size = stays(np.where(flags, group, ABSENT), scene.first)
    inside = flags[start]
    parts = np.maximum(size[inside] // scene.rows(seconds), 1)
    chosen = [
        begin + (2 * part + 1) * length // (2 * number)
        for begin, length, number in zip(
            start[inside].tolist(), size[inside].tolist(), parts.tolist(), strict=True
        )
        for part in range(number)
    ]
    row = np.array(chosen, np.int64)
    tracks = scene.track[row]
    # Rows are in the order of tracks: the number within a track is that since its first row.
    return row[np.arange(len(row)) - np.searchsorted(tracks, tracks) < most]


def near(scene: Scene, row: IntArray, others: IntArray, seconds: float) -> BoolArray:
    """Whether another row of the same track is less than `seconds` away from each row."""
    apart = np.abs(scene.time[row][:, None] - scene.time[others]) < seconds
    return (apart & (scene.track[row][:, None] == scene.track[others])).any(axis=1)


PRECEDENCE = (
    Label.ROUNDABOUT_ENTERING,
    Label.ROUNDABOUT_EXITING,
    Label.MERGING,
    Label.LEFT_TURN,
    Label.RIGHT_TURN,
    Label.STRAIGHT_CROSS,
    Label.RAMP_ENTERING,
    Label.RAMP_EXITING,
    Label.LANE_CHANGE_LEFT,
    Label.LANE_CHANGE_RIGHT,
    Label.CUT_IN,
    Label.URBAN_CUT_IN,
    Label.CUT_OUT,
    Label.URBAN_CUT_OUT,
    Label.ROUNDABOUT_CIRCULATING,
    Label.CAR_FOLLOWING,
    Label.FREE_CRUISE,
)
"""Of two events of one ego less than a window apart the one whose class comes first here stays; of
equal ones the earlier."""
_DIGITS = 6


class Hits(NamedTuple):
    """Events of one class: ego's row at t*, a row of the partner or ABSENT, and values of the tags,
    all equally long."""

    label: Label
    row: IntArray
    partner: IntArray
    tags: Mapping[str, NDArray]


def alone(label: Label, row: IntArray, **tags: NDArray) -> Hits:
    """Hits without partners."""
    return Hits(label, row, np.full(len(row), ABSENT, np.int64), tags)


def events(scene: Scene, name: str, found: Iterable[Hits]) -> list[LabelledEvent]:
    """The events that stay, in the order of egos' names and time."""
    candidates = [
        (PRECEDENCE.index(hits.label), row, hits, index)
        for hits in found
        for index, row in enumerate(hits.row.tolist())
    ]
    taken: dict[int, list[float]] = {}
    kept: list[LabelledEvent] = []
    # Greedy by precedence, then by row: what is taken first blocks all others less than a window
    # away.
    for _, row, hits, index in sorted(candidates, key=lambda one: one[:2]):
        time, times = float(scene.time[row]), taken.setdefault(int(scene.track[row]), [])
        if all(abs(time - other) >= scene.rules.window for other in times):
            times.append(time)
            kept.append(_event(scene, name, hits, index))
    return sorted(kept, key=lambda event: (event.ego, event.time))


def _event(scene: Scene, name: str, hits: Hits, index: int) -> LabelledEvent:
    row, partner = int(hits.row[index]), int(hits.partner[index])
    other = scene.names[scene.track[partner]] if partner != ABSENT else None
    tags = {
        key: _plain(values[index])
        for key, values in hits.tags.items()
        if np.isfinite(values[index])
    }
    why = _why(scene, hits.label, row, partner, tags)
    return LabelledEvent(
        name,
        scene.names[scene.track[row]],
        round(float(scene.time[row]), _DIGITS),
        hits.label,
        other,
        tags,
        why,
    )


def _why(
    scene: Scene, label: Label, row: int, partner: int, tags: Mapping[str, bool | float]
) -> str:
    """Conditions of a class, values of an event, and lanes of its participants before and after."""
    parts = [CONDITIONS[label].format_map(vars(scene.rules))]
    values = [
        f"{key.replace('_', ' ')} {value if isinstance(value, bool) else f'{value:.2f}'}"
        for key, value in tags.items()
    ]
    parts += [", ".join(values)] if values else []
    parts += [f"ego {_lanes(scene, row)}"]
    parts += [f"partner {_lanes(scene, partner)}"] if partner != ABSENT else []
    return "; ".join(parts)


def _lanes(scene: Scene, row: int) -> str:
    """Lanes about a row: those where the track is `rules.hold` before and after it."""
    reach = scene.rows(scene.rules.hold)
    around = max(row - reach, int(scene.first[row])), min(row + reach, int(scene.last[row]))
    before, after = (_lane(scene, end) for end in around)
    return f"on {before}" if before == after else f"from {before} to {after}"


def _lane(scene: Scene, row: int) -> str:
    if scene.strip[row] == NOWHERE:
        return "no lane"
    strip = scene.site.lanes.strips[scene.strip[row]]
    return f"road {strip.road} lane {strip.lane} ({ROLES[scene.role[row]]})"


def _plain(value: np.generic) -> bool | float:
    return bool(value) if isinstance(value, np.bool_) else round(float(value), _DIGITS)
