"""One recording as arrays, with what all rules ask for prepared once."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from recognition.labels.rules import Rules
from recognition.labels.scene.changes import LaneChanges, lane_changes
from recognition.labels.scene.leads import Leads, leads
from recognition.labels.scene.passages import Passages, passages
from recognition.labels.scene.rolling import constant, smoothed
from recognition.labels.scene.rows import SceneRows
from recognition.sites import Role, Site
from recognition.sites.lanes import NOWHERE
from recognition.sites.placing import place
from recognition.sites.roles import ROLES
from runner.recording import Recording, Track
from xodr.array_types import BoolArray, FloatArray, IntArray

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
    def vulnerable(self) -> tuple[FloatArray, FloatArray, FloatArray, IntArray]:
        """x, y, time and a number of the track for all rows of pedestrians (with numbers below 0) and cyclists."""
        cyclists = [name for name in self.names if self.recording.tracks[name].category == "bicycle"]
        walkers = [track.name for track in self.recording.tracks.values() if track.kind == "pedestrian"]
        tracks = [self.recording.tracks[name] for name in (*cyclists, *walkers)]
        numbers = [*map(self.numbers.__getitem__, cyclists), *(-1 - number for number in range(len(walkers)))]
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
        """Who drives ahead of whom."""
        return leads(
            self.site.lanes, self.track, self.frame, self.strip, self.along, self.speed, self.front, self.rear, self.rules.sight
        )

    @cached_property
    def changes(self) -> LaneChanges:
        """Changes of lane."""
        return lane_changes(self)

    def least_shift(self, row: IntArray) -> FloatArray:
        """Least lateral displacement (m) of a change into the lane of each row of which not all need be recorded."""
        share = np.where(self.role[row] == ROLES.index(Role.MAIN), self.rules.partial_shift, self.rules.partial_urban_shift)
        return share * self.site.lanes.width[self.strip[row]]

    def steady(self, seconds: float) -> BoolArray:
        """Rows whose track keeps its lane, with all frames there, from so much before to so much after."""
        half = self.rows(seconds)
        kept = (constant(values, half, self.first, self.last) for values in (self.changes.lane, self.changes.course))
        return np.logical_and(*kept)


def prepare(recording: Recording, site: Site, rules: Rules) -> Scene:
    """Rows of all vehicles of a recording, which gets its road coordinates where it lacks them."""
    place(recording, site.network)
    tracks = [track for track in recording.tracks.values() if track.kind == "vehicle" and len(track.columns["time"])]
    sizes = np.array([len(track.columns["time"]) for track in tracks], np.int64)
    track = np.repeat(np.arange(len(tracks)), sizes)
    time = _joined(tracks, "time")
    frame = np.rint((time - (time.min() if len(time) else 0.0)) / recording.timestep).astype(np.int64)
    first, last = _parts(track, frame)
    lane_id, s, lanes = _joined(tracks, "lane_id").astype(np.int64), _joined(tracks, "s"), site.lanes
    strip = lanes.find(_joined(tracks, "road_id"), lane_id, s)
    left = np.where(lanes.forward[strip], 1.0, -1.0)
    boxes = [track.box for track in tracks]
    half = max(1, round(0.5 * rules.smoothing / recording.timestep))
    return Scene(
        recording=recording,
        site=site,
        rules=rules,
        step=recording.timestep,
        names=[track.name for track in tracks],
        egos=np.array([track.category in EGOS for track in tracks], bool),
        track=track,
        frame=frame,
        time=time,
        first=first,
        last=last,
        x=_joined(tracks, "x"),
        y=_joined(tracks, "y"),
        h=_joined(tracks, "h"),
        speed=_joined(tracks, "speed"),
        acceleration=smoothed(_joined(tracks, "acceleration"), half, first, last),
        strip=strip,
        along=np.where(strip == NOWHERE, 0.0, lanes.along(strip, s)),
        offset=_joined(tracks, "lane_offset") * left,
        aside=_joined(tracks, "t") * left,
        role=site.roles.codes(lanes, strip, s),
        front=np.repeat([box.x + 0.5 * box.length for box in boxes], sizes),
        rear=np.repeat([box.x - 0.5 * box.length for box in boxes], sizes),
        width=np.repeat([box.width for box in boxes], sizes),
    )


def _joined(tracks: list[Track], name: str) -> NDArray:
    return np.concatenate([track.columns[name] for track in tracks]) if tracks else np.zeros(0)


def _parts(track: IntArray, frame: IntArray) -> tuple[IntArray, IntArray]:
    """First and last row of the part without missing frames that each row is in."""
    begins = np.ones(len(track), bool)
    begins[1:] = (np.diff(track) != 0) | (np.diff(frame) != 1)
    ends = np.append(np.flatnonzero(begins), len(track))
    sizes = np.diff(ends)
    return np.repeat(ends[:-1], sizes), np.repeat(ends[1:] - 1, sizes)
