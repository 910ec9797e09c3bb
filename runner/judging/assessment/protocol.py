"""Parts of a profile of a test protocol: tests, their criteria, and points where the protocol
states a rule.

A profile is data: a module in `runner.judging.assessment.profiles` that assigns an
`AssessmentProfile` to `PROFILE`, and a line about it to `SUMMARY`. A rule that is not public has no
points: its test has the criterion `Unassessed`, or no points.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import prod
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

if TYPE_CHECKING:
    from pathlib import Path

    from runner.judging.result import RunResult

KMH = 3.6
"""km/h in a m/s"""
COLOURS = {"green": 1.0, "yellow": 0.75, "orange": 0.5, "brown": 0.25, "red": 0.0}
"""Share of the points of a grid point by its colour, as Euro NCAP scales them"""
_ROUNDING = 1e-6
"""Differences (km/h) that come of units"""


class FirstContact(NamedTuple):
    """First contact of the ego in a run.

    Attributes:
        other: the participant touched.
        time: s.
        relative: relative speed of the two, km/h.
        own: speed of the ego, km/h.
    """

    other: str
    time: float
    relative: float
    own: float


@dataclass(frozen=True)
class AssessedRun:
    """A run that a criterion judges.

    Attributes:
        values: values of its parameters, those that the scenario declares included.
        contact: the first contact of the ego; None without one.
        folder: with the results of the run.
        load: reads the run in such a folder.
    """

    values: Mapping[str, float | str]
    contact: FirstContact | None
    folder: Path
    load: Callable[[Path], RunResult]

    def number(self, name: str) -> float | None:
        """A parameter's value, where it is a number."""
        value = self.values.get(name)
        return value if isinstance(value, float) else None

    def result(self) -> RunResult:
        """The run with its recording.

        Raises:
            InvalidFile: its results are damaged.
        """
        return self.load(self.folder)


class Judgement(NamedTuple):
    """Result of a criterion.

    Attributes:
        score: share of the points, 0 to 1; None where the run is not assessed.
        reason: measured value, or the reason for not assessing.
        colour: one of `COLOURS`; empty where the protocol uses none.
    """

    score: float | None
    reason: str
    colour: str = ""

    @property
    def result(self) -> str:
        """`met`, `partly met`, `not met`, or `not assessed`."""
        if self.score is None:
            return "not assessed"
        return "met" if self.score == 1.0 else "partly met" if self.score > 0.0 else "not met"


class ProtocolCriterion(Protocol):
    """Criterion of a test; `text` states it for the report."""

    @property
    def text(self) -> str:
        """The criterion in words."""
        ...

    def judge(self, drive: AssessedRun) -> Judgement:
        """Hold a run against the criterion."""
        ...


@dataclass(frozen=True)
class Unassessed:
    """No criterion: the outcome is listed without a result.

    Args:
        reason: why the test cannot be assessed.
    """

    reason: str

    @property
    def text(self) -> str:
        """The criterion in words."""
        return "not assessed"

    def judge(self, drive: AssessedRun) -> Judgement:
        """The reason, for every run."""
        return Judgement(None, self.reason)


@dataclass(frozen=True)
class NoContact:
    """The ego touches no other participant."""

    text: str = "no contact of the ego"

    def judge(self, drive: AssessedRun) -> Judgement:
        """Met without a contact."""
        return (
            Judgement(1.0, "no contact")
            if drive.contact is None
            else Judgement(0.0, _told(drive.contact))
        )


@dataclass(frozen=True)
class SpeedBands:
    """Colour of the speed at contact, by bands for each test speed.

    Args:
        bands: by test speed (km/h) the upper limits (km/h, exclusive) of the colours.
        speed: parameter with the test speed.
        relative: rate the relative speed instead of the ego's own.
        elsewhere: why other test speeds have no bands; `{}` stands for the speed.
    """

    bands: Mapping[float, tuple[tuple[float, str], ...]]
    speed: str
    relative: bool = False
    elsewhere: str = "the colour bands of tests at {} are published as a figure only"

    @property
    def text(self) -> str:
        """The criterion in words."""
        return (
            f"colour of the {'relative ' if self.relative else ''}impact speed; no contact is green"
        )

    def judge(self, drive: AssessedRun) -> Judgement:
        """Green without a contact; else by the bands of the test speed, where these are public."""
        if drive.contact is None:
            return Judgement(1.0, "no contact", "green")
        test, impact = (
            drive.number(self.speed),
            drive.contact.relative if self.relative else drive.contact.own,
        )
        if test is None or test not in self.bands:
            at = "an unknown speed" if test is None else f"{test:g} km/h"
            return Judgement(None, f"{_told(drive.contact)}; {self.elsewhere.format(at)}")
        colour = next(
            # Limits are exclusive; km/h made of m/s miss a limit by rounding.
            (colour for limit, colour in self.bands[test] if impact < limit - _ROUNDING),
            "red",
        )
        return Judgement(COLOURS[colour], _told(drive.contact), colour)


@dataclass(frozen=True)
class SpeedReduction:
    """Reduction of the ego's speed before the contact.

    Args:
        steps: least reductions (km/h) with their shares of the points, the greatest first.
        speed: parameter with the test speed.
    """

    steps: tuple[tuple[float, float], ...]
    speed: str

    @property
    def text(self) -> str:
        """The criterion in words."""
        return "speed reduced before the contact: " + ", ".join(
            f"{share:.0%} from {least:g} km/h" for least, share in self.steps
        ).replace("%", " %")

    def judge(self, drive: AssessedRun) -> Judgement:
        """The share of the greatest step that is reached."""
        test = drive.number(self.speed)
        if drive.contact is None or test is None:
            return Judgement(
                None, "no contact, and the rule rates the reduction of speed before one"
            )
        reduction = abs(test) - drive.contact.own
        share = next((share for least, share in self.steps if reduction >= least - _ROUNDING), 0.0)
        return Judgement(share, f"speed reduced by {reduction:.1f} km/h; {_told(drive.contact)}")


@dataclass(frozen=True)
class CutIn:
    """A contact is a failure if the other vehicle cut in early enough: TTC > Δv/(2·`deceleration`)
    + `reaction`.

    The TTC is that of the instant at which the other vehicle is `depth` inside the ego's lane.

    Args:
        deceleration: m/s².
        reaction: s.
        depth: m.
    """

    # UN R157, 5.2.5.2: v_rel / (2 · 6 m/s²) + 0.35 s, 0.3 m beyond the lane marking.
    deceleration: float = 6.0
    reaction: float = 0.35
    depth: float = 0.3

    @property
    def text(self) -> str:
        """The criterion in words."""
        return (
            f"no contact, if the TTC is above Δv / (2·{self.deceleration:g} m/s²) + "
            f"{self.reaction:g} s when the other vehicle "
            f"is {self.depth:g} m inside the lane"
        )

    def judge(self, drive: AssessedRun) -> Judgement:
        """Met without a contact; not required where the other vehicle cut in too late."""
        if drive.contact is None:
            return Judgement(1.0, "no contact")
        found = self._intrusion(drive.result(), drive.contact)
        if isinstance(found, str):
            return Judgement(None, f"{_told(drive.contact)}; {found}")
        ttc, closing = found
        limit = closing / (2.0 * self.deceleration) + self.reaction
        told = f"{_told(drive.contact)}; TTC {ttc:.2f} s at the intrusion, limit {limit:.2f} s"
        return (
            Judgement(0.0, told)
            # UN R157, 5.2.5.2 requires to avoid the cut-in above the limit only.
            if ttc > limit
            else Judgement(None, f"{told}: the rule does not require to avoid it")
        )

    def _intrusion(self, run: RunResult, contact: FirstContact) -> tuple[float, float] | str:
        """TTC (s) and closing speed (m/s) when the other vehicle intrudes into the ego's lane; or
        why there are none."""
        recording = run.recording.locate()
        network, ego, other = (
            recording.network,
            recording.tracks[run.ego or ""],
            recording.tracks[contact.other],
        )
        if network is None:
            return "there is no lane that the other vehicle cuts into"
        times, mine, its = np.intersect1d(
            ego.columns["time"], other.columns["time"], return_indices=True
        )
        own, theirs = (
            {name: track.columns[name][rows] for name in track.columns}
            for track, rows in ((ego, mine), (other, its))
        )
        # Each road has t from its own line: across roads they can't be compared.
        if (own["road_id"] != theirs["road_id"]).any() or len({*own["road_id"]}) > 1:
            return "the two are on different roads, where no intrusion is measured"
        road = network.road(str(own["road_id"][0]))
        width = np.array(
            [
                road.lane_width(float(s), int(lane))
                for s, lane in zip(own["s"], own["lane_id"], strict=True)
            ]
        )
        # From the ego's lane centre, at t minus the offset, to the near side of the other's box.
        aside = np.abs(theirs["t"] - (own["t"] - own["lane_offset"])) - other.box.width / 2.0
        inside = np.flatnonzero(width / 2.0 - aside >= self.depth)
        if not inside.size or inside[0] == 0:
            return "the other vehicle is in the ego's lane from the beginning, or never"
        row = int(inside[0])
        # Reference points are those of rear axles: gaps count from box to box.
        centres = abs(float(theirs["s"][row] - own["s"][row])) + other.box.x - ego.box.x
        closing = float(own["speed"][row] - theirs["speed"][row])
        if closing <= 0.0 or times[row] > contact.time:
            return "the ego is not faster than the other vehicle at the intrusion"
        return max(centres - (ego.box.length + other.box.length) / 2.0, 0.0) / closing, closing


def _told(contact: FirstContact) -> str:
    return (
        f"contact with {contact.other} at {contact.time:.2f} s, {contact.relative:.1f} km/h "
        f"relative, ego {contact.own:.1f} km/h"
    )


@dataclass(frozen=True)
class Column:
    """A quantity that the table shows of each run: the first of the parameters that the scenario
    has."""

    title: str
    parameters: tuple[str, ...]


@dataclass(frozen=True)
class ProtocolTest:
    """A test of a protocol.

    Attributes:
        name: short name in the protocol.
        title: long name.
        clause: where the protocol states the criterion.
        files: pattern (re) in the names of the test's files, without ending.
        criterion: criterion of each run.
        points: greatest number of points; 0 where none are computed.
        grid: parameters of the grid of test points, with the weight of each of their values; a
            point's weight is their product.
        remark: what a reader should know of the test.
        fixed: values that other parameters have at all test points, or by the first parameter of
            the grid; scenarios without such a parameter are not asked.
    """

    name: str
    title: str
    clause: str
    files: str
    criterion: ProtocolCriterion
    points: float = 0.0
    grid: Mapping[str, Mapping[float, float]] = field(default_factory=dict)
    remark: str = ""
    fixed: Mapping[str, Mapping[float, float] | float] = field(default_factory=dict)

    @property
    def size(self) -> int:
        """Number of test points of the grid."""
        return prod(len(weights) for weights in self.grid.values()) if self.grid else 0

    @property
    def weight(self) -> float:
        """Sum of the weights of all test points."""
        return prod(sum(weights.values()) for weights in self.grid.values())

    def point(self, drive: AssessedRun) -> tuple[float, ...] | None:
        """The test point of a run; None where it is none of the grid."""
        found = [drive.number(name) for name in self.grid]
        known = [
            value
            for value, weights in zip(found, self.grid.values(), strict=True)
            if value is not None and value in weights
        ]
        if not self.grid or len(known) < len(found):
            return None
        for name, wanted in self.fixed.items():
            value = drive.number(name)
            if value is not None and value != (
                wanted[known[0]] if isinstance(wanted, Mapping) else wanted
            ):
                return None
        return tuple(known)

    def share(self, point: tuple[float, ...]) -> float:
        """Points of a test point."""
        return (
            self.points
            * prod(weights[value] for weights, value in zip(self.grid.values(), point, strict=True))
            / self.weight
        )


@dataclass(frozen=True)
class Absent:
    """A part of the protocol that no file covers.

    Attributes:
        name: of the part.
        points: greatest number of points; 0 where the number is not public.
        reason: why it is not assessed.
    """

    name: str
    points: float
    reason: str


@dataclass(frozen=True)
class AssessmentProfile:
    """A protocol as data.

    Attributes:
        title: the protocol and its edition.
        sources: documents that the criteria and points are from.
        columns: parameters shown of each run.
        tests: the tests that files can be of; the first whose pattern fits a file is meant.
        absent: parts of the protocol that no file covers.
        assumptions: what the assessment assumes, a sentence each.
    """

    title: str
    sources: tuple[str, ...]
    columns: tuple[Column, ...]
    tests: tuple[ProtocolTest, ...]
    absent: tuple[Absent, ...] = ()
    assumptions: tuple[str, ...] = ()
