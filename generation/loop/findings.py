"""Findings of the stages of a loop, and their lines of text."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from enum import StrEnum
from functools import singledispatch
from typing import NamedTuple

from generation.report.regression import Fate, Fates
from schemas.common.terminal.text import many


class LoopStage(NamedTuple):
    """A stage: what is done, in which round, and of what; 0 and empty where it is of none."""

    task: str
    round: int = 0
    target: str = ""

    @property
    def name(self) -> str:
        """The name of its file."""
        parts = (f"round_{self.round}" if self.round else "", self.task, self.target)
        return "_".join(part for part in parts if part)


class CaseVerdict(StrEnum):
    """Verdict on the system under test in an edge case: a collision, or a distance below RSS's."""

    COLLISION = "collision"
    VIOLATION = "violation"


class CarefulDriver(StrEnum):
    """Verdict on careful drivers (`generation.search.outcomes.JUDGES`): one avoids it, all collide,
    or a run failed."""

    AVOIDS = "avoids"
    COLLIDES = "collides"
    UNKNOWN = "unknown"


@dataclass(frozen=True, kw_only=True)
class StageFinding:
    """Finding of a stage.

    Args:
        failures: what it could not do, by name, and why.
    """

    failures: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Recognised(StageFinding):
    """Scenarios recognised in recordings, by title of their class and by its state; files that were
    edited, left as they are."""

    classes: dict[str, int] = field(default_factory=dict)
    states: dict[str, int] = field(default_factory=dict)
    edited: list[str] = field(default_factory=list)


@dataclass(frozen=True, kw_only=True)
class Measured(StageFinding):
    """Manoeuvres measured in recordings, by kind."""

    kinds: dict[str, int]


@dataclass(frozen=True)
class DensitySource:
    """Number of recorded manoeuvres behind a density, and whether they are of these recordings or
    shipped."""

    manoeuvres: int
    own: bool


@dataclass(frozen=True)
class SearchRange:
    """A parameter that is searched, and its limits."""

    name: str
    low: float
    high: float


@dataclass(frozen=True)
class EdgeCase:
    """An edge case that was written.

    Args:
        file, road: its scenario and road, relative to the output folder; no road where it is not
            there.
        theta: values of the parameters.
        likelihood: log-density of recorded parameters there.
        risk: R_risk.
        survivors: names of the careful drivers that have no collision.
    """

    file: str
    road: str | None
    theta: dict[str, float]
    verdict: CaseVerdict
    careful: CarefulDriver
    likelihood: float
    risk: float
    survivors: list[str] = field(default_factory=list)

    @property
    def avoidable(self) -> bool:
        """Whether it is a collision that a careful driver avoids."""
        return self.verdict is CaseVerdict.COLLISION and self.careful is CarefulDriver.AVOIDS


@dataclass(frozen=True, kw_only=True)
class SearchedRegion:
    """A region of failure (`generation.report.counterexamples`).

    Args:
        rule: in words. precision, recall: of the rule, among unguided draws; None where none is
            within it, or none of its own fails.
        failures: number of failing runs in it.
        draws, drawn: unguided draws, and those that fail in it. low, high: 95 % interval of its
            probability.
        severity: mean impact speed, m/s.
        cases: files of its edge cases, the likelier first.
    """

    rule: str
    precision: float | None
    recall: float | None
    failures: int
    draws: int
    drawn: int
    low: float
    high: float
    severity: float
    cases: list[str] = field(default_factory=list)


@dataclass(frozen=True, kw_only=True)
class Searched(StageFinding):
    """A search of one class or scenario in one round.

    Args:
        target, title, scenario: its folder, the class or scenario, and the name of the logical
            scenario.
        error: why nothing was searched; empty where it was.
        pinned: values of parameters that are not searched.
        calls, failed_runs: sought runs, and those that ended with an error or inconclusive, of
            which nothing is known.
        errors: those that ended with an error.
        run_error: what most of these say.
        draws, drawn: unguided draws that ran before the sought runs, and their collisions.
        collisions, distinct, new: collisions of sought runs, those unlike each other, and those
            unlike the ones of earlier rounds as well.
        regions: groups of the failures, the most important first.
        failed: parameters of the failures, one a row, no two alike.
        real, tried: recorded parameters and those of the runs, thinned out for a plot.
    """

    round: int
    target: str
    title: str
    scenario: str
    prior: DensitySource
    error: str = ""
    parameters: list[SearchRange] = field(default_factory=list)
    pinned: dict[str, str] = field(default_factory=dict)
    calls: int = 0
    failed_runs: int = 0
    errors: int = 0
    run_error: str = ""
    draws: int = 0
    drawn: int = 0
    collisions: int = 0
    distinct: int = 0
    new: int = 0
    cases: list[EdgeCase] = field(default_factory=list)
    regions: list[SearchedRegion] = field(default_factory=list)
    failed: list[list[float]] = field(default_factory=list)
    real: list[list[float]] = field(default_factory=list)
    tried: list[list[float]] = field(default_factory=list)

    @property
    def in_vain(self) -> bool:
        """Whether it says nothing of the system: it was not done, or no run succeeded."""
        return bool(self.error) or self.failed_runs == self.calls


@dataclass(frozen=True)
class ShownRun:
    """A run: its name, state, status, message and end (s) as in the table of a batch, criticality
    measures by name, and its replay, relative to the output folder, with the moment to begin at;
    none where there is no replay."""

    name: str
    state: str
    status: str | None
    message: str
    end: float | None
    measures: dict[str, float | None]
    replay: str | None


@dataclass(frozen=True, kw_only=True)
class Ran(StageFinding):
    """Runs by the scenario or variation file that they are of, relative to the output folder where
    it is there.

    Args:
        sampled: number of parameter sets of variation files that were run in part.
        crashed: how many runs an internal error, or a failure of the system under test, ended.
    """

    files: dict[str, list[ShownRun]] = field(default_factory=dict)
    sampled: dict[str, int] = field(default_factory=dict)
    crashed: int = 0


@dataclass(frozen=True)
class LabelledScenario:
    """A scenario recognised in a run: title of its class, and its file in the catalogue of the
    round."""

    title: str
    file: str


@dataclass(frozen=True, kw_only=True)
class RecognisedRun(StageFinding):
    """Scenarios recognised about the ego, by the name of the run."""

    runs: dict[str, list[LabelledScenario]] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Checked(StageFinding):
    """Number of checked files, and their errors."""

    files: int
    problems: list[str]


@dataclass(frozen=True)
class Round:
    """A round of search: its number from 1, its searches, the runs of their edge cases, and what is
    recognised in these."""

    number: int
    searches: list[Searched]
    runs: Ran
    recognised: RecognisedRun


@dataclass(frozen=True)
class Refused:
    """A class or scenario that is not searched, and why."""

    title: str
    reason: str


@dataclass(frozen=True)
class KnownFailure:
    """A failure of an earlier loop: its parameters, and what became of it."""

    values: dict[str, str]
    fate: Fate


@dataclass(frozen=True, kw_only=True)
class Compared:
    """Failures of a class or scenario, in this loop and an earlier one.

    Args:
        target, title: its folder, and the class or scenario.
        reason: why the two can't be compared, or not in full; empty where they can.
        before: failures of the earlier loop.
        new: files of the failures that are unlike all of those and that the former system survives.
        others: fates of the failures that are unlike all of those and are not new, by file.
        blind: whether this loop can't say of any failure that it is not there: no run of its
            searches succeeded.
    """

    target: str
    title: str
    reason: str = ""
    before: list[KnownFailure] = field(default_factory=list)
    new: list[str] = field(default_factory=list)
    others: dict[str, Fate] = field(default_factory=dict)
    blind: bool = False

    @property
    def counts(self) -> Fates:
        """Number of failures of each fate."""
        return Fates(
            [
                *(failure.fate for failure in self.before),
                *(Fate.NEW for _ in self.new),
                *self.others.values(),
            ]
        )


@dataclass(frozen=True)
class Against:
    """An earlier loop, of another version of the system: its folder's name, the system, and what
    became of its failures."""

    folder: str
    sut: str
    compared: list[Compared]

    @property
    def counts(self) -> Fates:
        """Number of failures of each fate, in total."""
        return Fates(fate for comparison in self.compared for fate in comparison.counts.elements())

    def fails(self, *by: Fate) -> bool:
        """Whether there are failures of any of these fates, or may be, as of something no run
        succeeded."""
        return self.counts.fails(*by) or any(comparison.blind for comparison in self.compared)


@dataclass(frozen=True)
class LoopResult:
    """A whole loop.

    Args:
        settings: those that decide what is found, as text.
        recordings: how many there were.
        refused: what could not be searched.
        played: replays of recorded scenarios.
        scenarios: runs of the user's scenarios.
        against: the comparison with an earlier loop; None where there is none.
    """

    settings: dict[str, str]
    recordings: int
    recognised: Recognised
    refused: list[Refused]
    rounds: list[Round]
    played: Ran
    scenarios: Ran
    checked: Checked
    against: Against | None = None

    @property
    def inconclusive(self) -> list[ShownRun]:
        """The runs that did not test what their file describes."""
        return [
            run
            for stage in self._ran
            for runs in stage.files.values()
            for run in runs
            if run.state == "inconclusive"
        ]

    @property
    def crashed(self) -> bool:
        """Whether every run, those of searches among them, ended with an error, as where the system
        under test raises."""
        searched = [search for round_ in self.rounds for search in round_.searches]
        # One run that got through proves that the system starts: others may then fail by their
        # files.
        total = sum(len(runs) for stage in self._ran for runs in stage.files.values()) + sum(
            search.calls for search in searched
        )
        return (
            0
            < total
            == sum(stage.crashed for stage in self._ran) + sum(search.errors for search in searched)
        )

    @property
    def _ran(self) -> tuple[Ran, ...]:
        return self.played, self.scenarios, *(round_.runs for round_ in self.rounds)

    @property
    def unsound(self) -> list[str]:
        """Reasons for which a loop is not sound: inputs that can't be read, runs that ended with
        errors, empty searches.

        What the system under test does wrong is another matter, and what a loop is for.
        """
        stages: list[StageFinding] = [self.recognised, self.played, self.scenarios]
        for round_ in self.rounds:
            stages += [*round_.searches, round_.runs, round_.recognised]
        found = [f"{name}: {error}" for stage in stages for name, error in stage.failures.items()]
        return [*self.checked.problems, *found]


_NAMED = 3
"""Failed runs that a line names"""
_STATES = {
    "passed": "passed",
    "failed": "failed",
    "inconclusive": "inconclusive",
    "error": "with errors",
}


def summary(stage: LoopStage, found: StageFinding) -> str:
    """Summarise the findings of a stage."""
    return f"round {stage.round}: {_line(found)}" if stage.round else _line(found)


def closing(found: LoopResult) -> Iterator[str]:
    """A whole loop, in lines."""
    cases = [case for round_ in found.rounds for search in round_.searches for case in search.cases]
    collisions = sum(case.verdict is CaseVerdict.COLLISION for case in cases)
    yield from _refused(found.refused)
    avoidable = sum(case.avoidable for case in cases)
    if not any(round_.searches for round_ in found.rounds):
        yield "nothing was searched"
    else:
        yield (
            f"{many(len(cases), 'edge case')}, {collisions} of them collisions, of which a "
            f"careful driver avoids {avoidable}"
        )
    if found.against is not None:
        blind = sum(comparison.blind for comparison in found.against.compared)
        unknown = f", nothing is known of {many(blind, 'search', 'searches')}" if blind else ""
        yield (
            f"against {found.against.sut} in {found.against.folder}: "
            f"{found.against.counts}{unknown}"
        )
        for comparison in found.against.compared:
            told = "not known" if comparison.blind else str(comparison.counts)
            yield f"  {comparison.title}: {told}" + (
                f" ({comparison.reason})" if comparison.reason else ""
            )


def _refused(refused: Iterable[Refused]) -> Iterator[str]:
    """Yield the refused searches, one line per kind of reason with the first example."""
    kinds: dict[str, list[Refused]] = {}
    for refusal in refused:
        # Reasons have their particulars behind a colon: forty scenarios without a road make one
        # line.
        kinds.setdefault(refusal.reason.partition(": ")[0], []).append(refusal)
    for alike in kinds.values():
        same = all(refusal.reason == alike[0].reason for refusal in alike)
        which = "" if same else f" (that is of {alike[0].title}; the page has the others)"
        yield (
            f"not searched: {', '.join(refusal.title for refusal in alike)}: "
            f"{alike[0].reason}{which}"
        )


def prior(of: DensitySource) -> str:
    """Describe the source of a density's parameters."""
    if not of.manoeuvres:
        return "what is stated, without recordings"
    return (
        f"{many(of.manoeuvres, 'manoeuvre')} "
        f"{'of these recordings' if of.own else 'shipped with the package'}"
    )


@singledispatch
def _line(found: StageFinding) -> str:
    raise NotImplementedError(type(found).__name__)


@_line.register
def _recognised(found: Recognised) -> str:
    states = ", ".join(f"{count} {state}" for state, count in found.states.items())
    return f"{many(sum(found.classes.values()), 'scenario')} recognised: {states or 'none'}"


@_line.register
def _measured(found: Measured) -> str:
    return "manoeuvres measured: " + (
        ", ".join(f"{count} {kind}" for kind, count in found.kinds.items()) or "none"
    )


@_line.register
def _searched(found: Searched) -> str:
    if found.error:
        return f"{found.title} was not searched: {found.error}"
    failed = (
        f" ({found.failed_runs} with errors or inconclusive, mostly: {found.run_error})"
        if found.failed_runs
        else ""
    )
    near = sum(case.verdict == CaseVerdict.VIOLATION for case in found.cases)
    cases = [many(len(found.cases) - near, "foreseeable and preventable collision")]
    if near:
        cases.append(f"{near} without a collision, nearer than RSS allows")
    unlike = f" ({found.distinct} unlike each other, {found.new} new)" if found.collisions else ""
    return (
        f"{found.title}: {many(found.draws, 'unguided draw')} with "
        f"{many(found.drawn, 'collision')}, {many(found.calls, 'sought run')}{failed} with "
        f"{many(found.collisions, 'collision')}{unlike}; "
        f"{many(len(found.cases), 'edge case')} written: {', '.join(cases)}; "
        f"density of {prior(found.prior)}"
    )


@_line.register
def _ran(found: Ran) -> str:
    states = [run.state for runs in found.files.values() for run in runs]
    told = f"{many(len(states), 'run')}: " + ", ".join(
        f"{states.count(state)} {word}" for state, word in _STATES.items()
    )
    failed = [run.name for runs in found.files.values() for run in runs if run.state == "failed"]
    if failed:
        more = f" and {len(failed) - _NAMED} more" if len(failed) > _NAMED else ""
        told = f"{told}; failed: {', '.join(failed[:_NAMED])}{more}"
    # Counted against what ran, not against --sample: an interrupted file has run fewer.
    left = sum(size - len(found.files.get(name, ())) for name, size in found.sampled.items())
    return (
        (
            f"{told}; {many(left, 'parameter set')} of "
            f"{many(len(found.sampled), 'variation file')} left out (--sample)"
        )
        if left
        else told
    )


@_line.register
def _labelled(found: RecognisedRun) -> str:
    labels, runs = sum(map(len, found.runs.values())), len(found.runs)
    return (
        f"{many(labels, 'scenario')} recognised about the ego in {many(runs, 'run')} of edge cases"
    )


@_line.register
def _checked(found: Checked) -> str:
    problems = (
        f"{many(len(found.problems), 'problem')}, the first: {found.problems[0]}"
        if found.problems
        else "all valid"
    )
    return f"{many(found.files, 'file')} checked, {problems}"
