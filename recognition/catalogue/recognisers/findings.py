"""What is recognised in recordings: moments that rules and model have labelled, joined into findings.

Moments are those at which a rule holds and, for a model, further ones at a regular stride, so that what no rule describes
can be found to be unknown. Moments of one ego and one class that follow each other closely are one finding.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from recognition.labels.classes import Event, Label

KNOWN, UNKNOWN, DISCOVERED = "known", "unknown", "discovered"
RULES, MODEL = "rules", "model"
"""Whose labels sort a catalogue"""
WINDOW = 1.5
"""Length (s) of what is looked at about a moment"""


@dataclass(frozen=True)
class Moment:
    """A window of a recording about one ego, labelled.

    Attributes:
        ego: name of the track.
        time: the middle of the window, s.
        title: name of the class that it is sorted by: one of the 17, `unknown`, or a discovered class.
        state: known, unknown or discovered.
        rule: what the rules say, UNKNOWN for nothing.
        model: the model's label: one of the 17, `unknown`, or a discovered class; None without a model.
        nearest: of the known classes the one that the model takes it for rather than any other; None without a model.
        confidence: of the model in `nearest`, in [0, 1]; None without.
        partner, tags: of the rule's event.
    """

    ego: str
    time: float
    title: str
    state: str
    rule: Label = Label.UNKNOWN
    model: str | None = None
    nearest: str | None = None
    confidence: float | None = None
    partner: str | None = None
    tags: dict[str, bool | float] = field(default_factory=dict)

    @property
    def labels_agree(self) -> bool | None:
        """Whether rules and model say the same; None where one of them says nothing."""
        return self.model == self.rule.title if self.rule and self.model is not None else None


@dataclass(frozen=True)
class Finding:
    """A stretch of a recording in which one class is recognised about one ego.

    Attributes:
        moment: the one with a rule's event, if any, else the one with most confidence.
        start, end: of the windows, s.
        moments: how many there are.
    """

    moment: Moment
    start: float
    end: float
    moments: int


def by_rules(event: Event) -> Moment:
    """The moment of a rule's event, without a model."""
    return Moment(event.ego, event.time, event.label.title, KNOWN, event.label, partner=event.partner, tags=event.tags)


def joined(moments: Iterable[Moment], gap: float) -> list[Finding]:
    """Findings, sorted by ego and time.

    Args:
        gap: greatest time between the windows of one finding, s.
    """
    groups: dict[tuple[str, str], list[Moment]] = {}
    for moment in moments:
        groups.setdefault((moment.ego, moment.title), []).append(moment)
    found = [_finding(run) for group in groups.values() for run in _runs(group, gap)]
    return sorted(found, key=lambda finding: (finding.moment.ego, finding.moment.time, finding.moment.title))


def _runs(moments: Iterable[Moment], gap: float) -> list[list[Moment]]:
    """Moments that follow each other closely, and have no two partners."""
    runs: list[list[Moment]] = []
    for moment in sorted(moments, key=lambda moment: (moment.time, moment.partner or "")):
        partners = {each.partner for each in runs[-1]} - {None} if runs else set()
        other = moment.partner is not None and bool(partners - {moment.partner})
        if not runs or other or moment.time - runs[-1][-1].time > WINDOW + gap:
            runs.append([])
        runs[-1].append(moment)
    return runs


def _finding(moments: Sequence[Moment]) -> Finding:
    best = max(moments, key=lambda moment: (bool(moment.rule), moment.confidence or 0.0, -moment.time))
    return Finding(best, moments[0].time - WINDOW / 2, moments[-1].time + WINDOW / 2, len(moments))
