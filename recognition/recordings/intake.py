"""Intake of recordings: the report on reading one (gaps, cuts, exclusions), and checks of physics
with one verdict, reasons, and a number for the quality.

Each check looks at one property of all tracks: step of the clock, speeds by category, overlaps,
missing frames, jumps, sizes, headings, and (on a map) the share of places on lanes and against the
traffic. A check that fails refuses the recording; one that finds less lowers its quality. `inspect`
of `xosc-recognize` prints the outcome.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from runner.recording import Recording, Track
from schemas.common.array_types import BoolArray, FloatArray, IntArray

if TYPE_CHECKING:
    from numpy.typing import NDArray


class Gap(NamedTuple):
    """Frames that a track lacks between two rows that it has (at `start` and `end`, s)."""

    track: str
    start: float
    end: float
    missing: int


class Cut(NamedTuple):
    """Cut of a track in two: a jump by `distance` (m), or missing rows (distance 0), between two
    times (s).

    rest: name of the track that goes on; None where too little of it is left.
    """

    track: str
    start: float
    end: float
    distance: float
    rest: str | None


class Exclusion(NamedTuple):
    """A track or element of a source that is left out of its recording: name, rows and reason."""

    what: str
    rows: int
    reason: str


FIT, REPAIRED, REFUSED = "fit", "repaired", "refused"
"""Verdicts on a recording"""


class Check(NamedTuple):
    """Outcome of a check of a recording that found something.

    name: what was checked. verdict: `REFUSED`, `REPAIRED`, or None where it only lowers the
    quality. share: of rows or tracks that fail, in [0, 1]. reason: one sentence.
    """

    name: str
    verdict: str | None
    share: float
    reason: str


@dataclass
class Report:
    """Report on reading a source.

    Attributes:
        rows, tracks: how many the recording has.
        gaps: frames missing inside tracks; nothing is put in their place.
        cuts: where tracks were cut, because they jump or are not recorded for long.
        exclusions: what was left out.
        remarks: what was assumed, derived or corrected, one sentence each.
        checks: what the intake found (`recognition.recordings.intake`).
    """

    rows: int = 0
    tracks: int = 0
    gaps: list[Gap] = field(default_factory=list)
    cuts: list[Cut] = field(default_factory=list)
    exclusions: list[Exclusion] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)
    checks: list[Check] = field(default_factory=list)

    def add(self, other: Report) -> None:
        """Add the findings of another file of the same recording."""
        self.rows += other.rows
        self.tracks += other.tracks
        self.gaps += other.gaps
        self.cuts += other.cuts
        self.exclusions += other.exclusions
        self.checks += other.checks
        self.remarks += (remark for remark in other.remarks if remark not in self.remarks)

    @property
    def quality(self) -> float:
        """Quality in [0, 1]: the product of the shares that no check complains of."""
        return round(math.prod(1.0 - min(max(check.share, 0.0), 1.0) for check in self.checks), 4)

    @property
    def verdict(self) -> str:
        """`fit`, `repaired` or `refused`, whichever of the checks' is the worst."""
        verdicts = {check.verdict for check in self.checks}
        return REFUSED if REFUSED in verdicts else REPAIRED if REPAIRED in verdicts else FIT

    @property
    def missing(self) -> int:
        """Frames missing inside tracks."""
        return sum(gap.missing for gap in self.gaps)

    @property
    def excluded(self) -> int:
        """Rows that were left out."""
        return sum(exclusion.rows for exclusion in self.exclusions)


# checks ------------------------------------------------------------------------------------------

_CREDIBLE = 1.25
"""Greatest ratio of two speeds of the same motion, from the places and as stated, whichever is
greater: smoothing and noise give a few percent"""
_SPREAD = 0.1
"""Quartiles of that ratio are within this share of its median where one factor (a wrong step or
unit) explains it"""
MOVED = 1.0
"""Least way (m) of motion that is compared"""
_FACING = 3.0
"""Least way (m) whose direction is compared with headings"""
_UNITS = {"km/h": 3.6, "mph": 2.23694, "ft/s": 3.28084, "knots": 1.94384}
"""Speeds in other units than m/s are so many times as high"""
_ALIKE = 0.02
"""Relative difference below which a ratio is that of a unit"""
_FASTEST = {
    "car": 70.0, "van": 60.0, "truck": 45.0, "trailer": 45.0, "bus": 45.0, "tram": 35.0,
    "motorbike": 80.0, "bicycle": 16.0,
    "pedestrian": 7.0,
}  # fmt: skip
"""Speed (m/s) above which hardly any of a category moves: a bicycle downhill, a sprinting
pedestrian"""
_HARDEST = 12.0
"""Change of speed over time, m/s², that no road vehicle reaches: dry tyres transmit 10"""
_SHARE = 0.2
"""Greatest share of rows or tracks that may fail a check in a recording that is not refused"""
_SOME = 0.5
"""Share of its rows from which a track that is too fast for its category is left out"""
_MOMENTS = 25
"""Moments at which boxes are compared"""
_SHRUNK, _INSIDE = 0.9, 0.1
"""Share of the sides of boxes that is compared, as sizes are rough; least share of the smaller box
that another one covers"""
_OVERLAPPING = 0.05
"""Greatest share of vehicles inside others in a scene: trailers, loads, and vehicles that were
tracked twice for a while"""
_FEWEST = 3
"""Fewest vehicles at which overlaps say something of the whole recording: two may collide"""
_OWN_CLOCK = 0.8
"""Share of tracks that begin at one instant where each vehicle may have its own clock"""
_MISSING, _JUMPING = 0.5, 0.3
"""Greatest share of missing frames, and of tracks that jump"""
_BOXES = {
    "car": ((2.0, 8.0), (1.0, 3.2)),
    "truck": ((3.0, 30.0), (1.3, 4.2)),
    "bus": ((4.0, 30.0), (1.5, 4.2)),
}
"""Least and greatest length and width (m) of most of a category; the limits of units, not of
vehicles"""
_SKEWED = math.radians(20.0)
"""Median angle between heading and motion above which headings are of another convention"""
_BACKWARDS = math.radians(120.0)
"""Angle between heading and motion above which a vehicle goes backwards"""


class _RecordedRows(NamedTuple):
    """Rows of the tracks of a recording as they were recorded: number of the track, time (s), place
    (m), heading, speed."""

    track: IntArray
    time: FloatArray
    x: FloatArray
    y: FloatArray
    h: FloatArray
    speed: FloatArray

    @classmethod
    def of(cls, tracks: Sequence[Track]) -> _RecordedRows:
        """Rows of all tracks, raw where they were smoothed."""
        listed = [track.columns for track in tracks]
        track = np.repeat(
            np.arange(len(listed)), np.array([len(one["time"]) for one in listed], np.int64)
        )

        def joined(name: str) -> FloatArray:
            return np.concatenate(
                [np.zeros(0), *(one.get(f"raw_{name}", one[name]) for one in listed)]
            )

        return cls(track, joined("time"), *(joined(name) for name in ("x", "y", "h", "speed")))


class _Second(NamedTuple):
    """Motion within about a second (`steps_compared`) from rows (n,): row, row
    at the end, time (s), way (m).
    """

    here: IntArray
    there: IntArray
    time: FloatArray
    way: FloatArray


def steps_compared(step: float, longest: int) -> int:
    """Steps (of `step` s) over which motion is compared: a second, or the longest track if that is
    shorter (steps)."""
    return max(min(round(1.0 / step), longest), 1)


def _seconds(rows: _RecordedRows, step: float) -> _Second:
    """The motion of each row for a second, of those that have rows for that long."""
    ahead = steps_compared(step, int(np.bincount(rows.track, minlength=1).max()) - 1)
    here = np.arange(max(len(rows.track) - ahead, 0))
    there = here + ahead
    time = rows.time[there] - rows.time[here]
    # By the clock too: where frames are missing, so many rows are more than a second.
    kept = (rows.track[there] == rows.track[here]) & (np.abs(time - ahead * step) < 0.5 * step)
    here, there, time = here[kept], there[kept], time[kept]
    return _Second(
        here, there, time, np.hypot(rows.x[there] - rows.x[here], rows.y[there] - rows.y[here])
    )


def examine(recording: Recording, report: Report) -> Recording:
    """Check a recording; the checks join the report.

    Returns:
        The recording, without tracks that are impossible for their category.
    """
    tracks = [track for track in recording.tracks.values() if len(track.columns["time"])]
    rows = _RecordedRows.of(tracks)
    seconds = _seconds(rows, recording.timestep)
    known = any(
        check.name == "step" for check in report.checks
    )  # raw speeds were examined before they were smoothed
    speeds, wrong = _plausible(rows, seconds, tracks)
    found = (
        None if known else _step(rows, seconds, recording.timestep),
        _overlaps(tracks),
        _clock(report),
        _jumps(report),
        _sizes(tracks),
        _headings(rows, seconds, tracks),
        speeds,
    )
    report.checks += [check for check in found if check is not None]
    for number in wrong:
        name, size = tracks[number].name, len(tracks[number].columns["time"])
        report.exclusions.append(Exclusion(name, size, f"too fast for a {tracks[number].category}"))
    kept = [track for number, track in enumerate(tracks) if number not in wrong]
    return recording if not wrong else Recording(kept, recording.timestep, recording.network)


def _step(rows: _RecordedRows, seconds: _Second, step: float) -> Check | None:
    """Compare the speeds of the places with those stated; one ratio for all is that of a wrong step
    or unit."""
    moving = seconds.way >= MOVED
    here, there, time, way = (
        seconds.here[moving],
        seconds.there[moving],
        seconds.time[moving],
        seconds.way[moving],
    )
    return check_ratio(ratio_of_speeds(np.abs(rows.speed), here, there, time, way), step)


def ratio_of_speeds(
    speed: FloatArray, here: IntArray, there: IntArray, time: FloatArray, way: FloatArray
) -> FloatArray:
    """Speeds of the places over the mean of those stated in the rows of ways (n,)."""
    # All rows count: under a wrong step, what is taken for a second is several, and speeds change.
    total = np.concatenate([[0.0], np.cumsum(speed)])
    stated = (total[there + 1] - total[here]) / (there - here + 1)
    # Stated speeds of 0 give a huge ratio, not a division by 0.
    return way / time / np.maximum(stated, 1e-6)


def check_ratio(ratio: FloatArray, step: float) -> Check | None:
    """Say which step would fit, or in which unit speeds are, where places do not move at the stated
    speeds."""
    if not len(ratio):
        return None
    low, middle, high = (float(quartile) for quartile in np.quantile(ratio, (0.25, 0.5, 0.75)))
    if 1.0 / _CREDIBLE <= middle <= _CREDIBLE:
        return None
    places = f"the places move at {middle:.2f} times the stated speeds"
    if one_factor(ratio) is None:
        return Check(
            "step",
            REFUSED,
            1.0,
            f"{places} (half of them at {low:.2f} to {high:.2f} times): clock, "
            "places or speeds are wrong",
        )
    unit = next(
        (name for name, factor in _UNITS.items() if abs(middle * factor - 1.0) < _ALIKE), None
    )
    fits = f"a step of {step * middle:.4g} s would fit, it is {step:.4g} s"
    return Check(
        "step",
        REFUSED,
        1.0,
        f"{places}: {f'the speeds may be in {unit}, or ' if unit else ''}{fits}",
    )


def one_factor(ratio: FloatArray) -> float | None:
    """Return the median of ratios (n,) of speeds if it explains nearly all of them, and they
    differ; else None."""
    low, middle, high = (
        (float(quartile) for quartile in np.quantile(ratio, (0.25, 0.5, 0.75)))
        if len(ratio)
        else (1.0, 1.0, 1.0)
    )
    differs = not 1.0 / _CREDIBLE <= middle <= _CREDIBLE
    return middle if differs and high - low <= _SPREAD * middle else None


def _plausible(
    rows: _RecordedRows, seconds: _Second, tracks: Sequence[Track]
) -> tuple[Check | None, list[int]]:
    """Check speeds and their changes by category; with the numbers of tracks that are too fast
    throughout."""
    if not len(seconds.here):
        return None, []
    # Categories without a limit are never too fast.
    fastest = np.array([_FASTEST.get(track.category, math.inf) for track in tracks])
    motor = np.array([track.kind == "vehicle" for track in tracks], bool)
    track, speed = rows.track[seconds.here], seconds.way / seconds.time
    fast = speed > fastest[track]
    share = float(fast.mean())
    total = np.bincount(track, minlength=len(tracks))
    own = np.bincount(track, fast, minlength=len(tracks)) / np.maximum(total, 1)
    wrong = np.flatnonzero(own > _SOME).tolist()
    hard = _hard(rows, seconds, motor)
    # Fewer wrong tracks are faults of their own; of one or two tracks, all have to be wrong.
    several = len(wrong) >= min(_FEWEST, len(tracks))
    if several and (share > _SHARE or len(wrong) > _SHARE * len(tracks)):
        worst = int(np.argmax(own))
        top = float(np.median(speed[fast]))
        named = f"{tracks[worst].category} {tracks[worst].name} at {top:.0f} m/s"
        reason = f"{len(wrong)} of {len(tracks)} tracks are too fast for their category, as {named}"
        return Check("speeds", REFUSED, share, f"{reason}: places, step or units are wrong"), []
    if hard > _SHARE:
        reason = (
            f"at {hard:.0%} of the times speeds change by more than {_HARDEST:g} m/s in a second"
        )
        return Check("speeds", REFUSED, hard, f"{reason}: places, step or units are wrong"), []
    if not wrong:
        return (
            Check("speeds", None, share, f"{share:.1%} of the rows are too fast for their category")
            if share > 0
            else None
        ), []
    named = ", ".join(f"{tracks[number].category} {tracks[number].name}" for number in wrong[:3])
    more = f" and {len(wrong) - 3} more" if len(wrong) > 3 else ""
    return Check(
        "speeds",
        REPAIRED,
        len(wrong) / len(tracks),
        f"too fast for their category, left out: {named}{more}",
    ), wrong


def _hard(rows: _RecordedRows, seconds: _Second, motor: BoolArray) -> float:
    """Share of a vehicle's seconds, of those that another second follows, in which its speed
    changes too hard."""
    # NaN where a row begins no second: a change from or to there is not known.
    speed = np.full(len(rows.track), np.nan)
    speed[seconds.here] = seconds.way / seconds.time
    change = np.abs(speed[seconds.there] - speed[seconds.here]) / seconds.time
    known = np.isfinite(change) & motor[rows.track[seconds.here]]
    return float((change[known] > _HARDEST).mean()) if known.any() else 0.0


def _overlaps(tracks: Sequence[Track]) -> Check | None:
    """Compare boxes of vehicles at some moments."""
    vehicles = [track for track in tracks if track.kind == "vehicle"]
    if len(vehicles) < 2:
        return None
    starts = np.array([float(track.columns["time"][0]) for track in vehicles])
    end = max(float(track.columns["time"][-1]) for track in vehicles)
    inside = there = pairs = most = 0
    # Some moments: what is wrong with a whole table shows in most of them, and boxes are costly.
    for time in np.linspace(float(starts.min()), end, _MOMENTS).tolist():
        found, present = overlapping(vehicles, time)
        inside, there, pairs = (
            inside + len(set(found.ravel().tolist())),
            there + present,
            pairs + len(found),
        )
        most = max(most, len(set(found.ravel().tolist())))
    share = inside / max(there, 1)
    if not pairs:
        return None
    reason = (
        f"{share:.1%} of the vehicles are inside another one ({pairs} pairs at {_MOMENTS} moments)"
    )
    if share <= _OVERLAPPING or most < _FEWEST:
        return Check("overlaps", None, share, reason)
    # Vehicles of one place enter one after the other, however long it is recorded.
    together = float((np.abs(starts - starts.min()) < 1e-6).mean())
    own = (
        "each vehicle has a clock of its own, as all begin at once"
        if together >= _OWN_CLOCK
        else "tracks are of different times"
    )
    return Check(
        "overlaps",
        REFUSED,
        share,
        f"{reason}: {own}, or vehicles were tracked several times; a table with one clock and one "
        "track a vehicle is needed",
    )


def overlapping(tracks: Sequence[Track], time: float) -> tuple[IntArray, int]:
    """Pairs (n, 2) of tracks whose boxes overlap at a time (s), and the number
    of tracks present.
    """
    from shapely import STRtree, area, intersection, polygons

    there, corners = [], []
    for number, track in enumerate(tracks):
        columns = track.columns
        if not columns["time"][0] <= time <= columns["time"][-1]:
            continue
        row = int(np.abs(columns["time"] - time).argmin())
        there.append(number)
        corners.append(_corners(track, row))
    if len(there) < 2:
        return np.zeros((0, 2), np.int64), len(there)
    boxes = polygons(np.array(corners))
    one, other = STRtree(boxes).query(boxes, predicate="intersects")
    # Each pair once, and no box with itself.
    one, other = one[one < other], other[one < other]
    # Of the smaller box: a motorbike covers little of a lorry that it is inside of.
    shared = area(intersection(boxes[one], boxes[other])) / np.minimum(
        area(boxes[one]), area(boxes[other])
    )
    chosen = shared > _INSIDE
    numbers: NDArray[np.int64] = np.array(there, np.int64)
    return np.stack([numbers[one[chosen]], numbers[other[chosen]]], axis=1), len(there)


def _corners(track: Track, row: int) -> FloatArray:
    """Corners (4, 2) of a track's box, made smaller, at a row."""
    columns, box = track.columns, track.box
    h = float(columns["h"][row])
    ahead, left = np.array([math.cos(h), math.sin(h)]), np.array([-math.sin(h), math.cos(h)])
    centre = np.array([columns["x"][row], columns["y"][row]]) + box.x * ahead + box.y * left
    long, wide = 0.5 * _SHRUNK * box.length * ahead, 0.5 * _SHRUNK * box.width * left
    return np.array(
        [centre + long + wide, centre - long + wide, centre - long - wide, centre + long - wide]
    )


def _clock(report: Report) -> Check | None:
    share = report.missing / max(report.rows + report.missing, 1)
    if not report.missing:
        return None
    reason = f"frames are missing inside tracks: {report.missing} ({share:.1%})"
    return Check("clock", REFUSED if share > _MISSING else None, share, reason)


def _jumps(report: Report) -> Check | None:
    """Tracks that jump: an id that was used twice, or tracks that were swapped."""
    jumping = {cut.track for cut in report.cuts if cut.distance > 0.0}
    if not jumping:
        return None
    share = len(jumping) / max(report.tracks, 1)
    reason = (
        "ids were used twice or places are wrong: tracks are cut where they jump, "
        f"{len(jumping)} in number"
    )
    return Check(
        "ids",
        REFUSED if share > _JUMPING and len(jumping) >= _FEWEST else REPAIRED,
        min(share, 1.0),
        reason,
    )


def _sizes(tracks: Sequence[Track]) -> Check | None:
    measured = [track for track in tracks if track.category in _BOXES]
    wrong = [track for track in measured if not _fits(track)]
    if not wrong:
        return None
    share = len(wrong) / len(measured)
    first = wrong[0]
    named = f"{first.category} {first.name}, {first.box.length:g} m by {first.box.width:g} m"
    reason = f"{len(wrong)} of {len(measured)} vehicles have sizes of other ones, as {named}"
    refused = share > 0.5 and len(measured) >= _FEWEST
    return Check(
        "sizes",
        REFUSED if refused else None,
        share,
        f"{reason}: sizes may be in other units" if refused else reason,
    )


def _fits(track: Track) -> bool:
    (shortest, longest), (narrowest, widest) = _BOXES[track.category]
    return shortest <= track.box.length <= longest and narrowest <= track.box.width <= widest


def _headings(rows: _RecordedRows, seconds: _Second, tracks: Sequence[Track]) -> Check | None:
    """Compare headings with motion: vehicles in reverse throughout have another convention."""
    moving = (seconds.way >= _FACING) & np.array(
        [track.kind == "vehicle" for track in tracks], bool
    )[rows.track[seconds.here]]
    here, there = seconds.here[moving], seconds.there[moving]
    if not len(here):
        return None
    way = np.arctan2(rows.y[there] - rows.y[here], rows.x[there] - rows.x[here])
    angle = np.abs(np.remainder(rows.h[here] - way + math.pi, math.tau) - math.pi)
    aside = float((angle > math.radians(45.0)).mean())
    # The median tells of all headings: it is near 0 as long as most vehicles drive forwards.
    usual = float(np.median(angle))
    if usual > _SKEWED and aside <= 0.5:
        # Half of all motion is not along the box: no vehicle drifts for so long.
        reason = (
            f"vehicles move {math.degrees(usual):.0f}° off their headings in the median: headings "
            "have another zero or unit, or the axes are exchanged"
        )
        return Check("headings", REFUSED, 1.0, reason)
    if aside <= 0.02:
        return None
    back = float((angle > _BACKWARDS).mean())
    reason = (
        f"at {aside:.0%} of the times vehicles move aside of their headings or backwards "
        f"({back:.0%})"
    )
    refused = aside > 0.5
    return Check(
        "headings",
        REFUSED if refused else None,
        aside,
        f"{reason}: headings have another zero or unit" if refused else reason,
    )
