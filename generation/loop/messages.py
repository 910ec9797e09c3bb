"""Messages about what a loop has found, one line each."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import singledispatch

from generation.loop.stages.findings import (
    CaseVerdict,
    Checked,
    Finding,
    Labelled,
    LoopResult,
    Measured,
    Prior,
    Ran,
    Recognised,
    Refused,
    Searched,
)
from generation.loop.stages.finished import Stage
from schemas.commands.wording import many

_STATES = {"passed": "passed", "failed": "failed", "error": "with errors"}


def summary(stage: Stage, found: Finding) -> str:
    """What a stage has found."""
    return f"round {stage.round}: {_line(found)}" if stage.round else _line(found)


def closing(found: LoopResult) -> Iterator[str]:
    """A whole loop, in lines."""
    cases = [case for each in found.rounds for search in each.searches for case in search.cases]
    collisions = sum(case.verdict is CaseVerdict.COLLISION for case in cases)
    yield from _refused(found.refused)
    avoidable = sum(case.avoidable for case in cases)
    if not any(each.searches for each in found.rounds):
        yield "nothing was searched"
    else:
        yield f"{many(len(cases), 'edge case')}, {collisions} of them collisions, of which a careful driver avoids {avoidable}"
    if found.against is not None:
        blind = sum(each.blind for each in found.against.compared)
        unknown = f", nothing is known of {many(blind, 'search', 'searches')}" if blind else ""
        yield f"against {found.against.sut} in {found.against.folder}: {found.against.counts}{unknown}"
        for each in found.against.compared:
            told = "not known" if each.blind else str(each.counts)
            yield f"  {each.title}: {told}" + (f" ({each.reason})" if each.reason else "")


def _refused(refused: Iterable[Refused]) -> Iterator[str]:
    """What is not searched, a line for each kind of reason: what differs in it from one to the next is told of the first."""
    kinds: dict[str, list[Refused]] = {}
    for each in refused:
        kinds.setdefault(each.reason.partition(": ")[0], []).append(each)
    for alike in kinds.values():
        same = all(each.reason == alike[0].reason for each in alike)
        which = "" if same else f" (that is of {alike[0].title}; the page has the others)"
        yield f"not searched: {', '.join(each.title for each in alike)}: {alike[0].reason}{which}"


def prior(of: Prior) -> str:
    """Whose parameters a density is of."""
    if not of.manoeuvres:
        return "what is stated, without recordings"
    return f"{many(of.manoeuvres, 'manoeuvre')} {'of these recordings' if of.own else 'shipped with the package'}"


@singledispatch
def _line(found: Finding) -> str:
    raise NotImplementedError(type(found).__name__)


@_line.register
def _recognised(found: Recognised) -> str:
    states = ", ".join(f"{count} {state}" for state, count in found.states.items())
    return f"{many(sum(found.classes.values()), 'scenario')} recognised: {states or 'none'}"


@_line.register
def _measured(found: Measured) -> str:
    return "manoeuvres measured: " + (", ".join(f"{count} {kind}" for kind, count in found.kinds.items()) or "none")


@_line.register
def _searched(found: Searched) -> str:
    if found.error:
        return f"{found.title} was not searched: {found.error}"
    failed = f" ({found.failed_runs} with errors, mostly: {found.run_error})" if found.failed_runs else ""
    return (
        f"{found.title}: {many(found.calls, 'run')}{failed}, {many(found.collisions, 'collision')}, {found.distinct} of them "
        f"unlike each other ({found.new} new), {many(len(found.cases), 'edge case')} written; density of {prior(found.prior)}"
    )


@_line.register
def _ran(found: Ran) -> str:
    states = [run.state for runs in found.files.values() for run in runs]
    told = f"{many(len(states), 'run')}: " + ", ".join(f"{states.count(state)} {word}" for state, word in _STATES.items())
    left = sum(size - len(found.files.get(name, ())) for name, size in found.sampled.items())
    return (
        f"{told}; {many(left, 'parameter set')} of {many(len(found.sampled), 'variation file')} left out (--sample)"
        if left
        else told
    )


@_line.register
def _labelled(found: Labelled) -> str:
    labels, runs = sum(map(len, found.runs.values())), len(found.runs)
    return f"{many(labels, 'scenario')} recognised about the ego in {many(runs, 'run')} of edge cases"


@_line.register
def _checked(found: Checked) -> str:
    problems = f"{many(len(found.problems), 'problem')}, the first: {found.problems[0]}" if found.problems else "all valid"
    return f"{many(found.files, 'file')} checked, {problems}"
