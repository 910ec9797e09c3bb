"""Report on reading a recording: gaps, cuts, exclusions, and the checks of its intake with a
verdict and a quality."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple


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
