"""The verdict of a run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from runner.criteria.criterion import CriterionResult
from runner.criteria.judge import judge_criteria, light_states
from runner.interpreter.ego import is_called_ego
from runner.interpreter.result import Verdict
from runner.measures.measure import Facts

if TYPE_CHECKING:
    from runner.criteria.judge import Criterion
    from runner.interpreter.collision import Contacts
    from runner.interpreter.compiler import Scenario
    from runner.interpreter.result import Cause, RunResult
    from runner.measures.measure import Limit
    from runner.participants.entity import Entity
    from runner.recording import Recording


def judge(
    scenario: Scenario, contacts: Contacts, recording: Recording, ego: Entity | None, causes: tuple[Cause, ...] = ()
) -> Verdict:
    """The verdict of a run: a failure when the ego touched another participant or a criterion failed.

    Args:
        causes: for which it is inconclusive without a failure.
    """
    criteria = _criteria(scenario, contacts, recording, ego)
    collisions = [
        f"collision with {second if first == ego.name else first} at {time:.2f} s"
        for time, first, second in contacts.history
        if ego is not None and ego.name in (first, second)
    ]
    failures = (*collisions, *(str(result) for result in criteria if result.passed is False))
    return Verdict(failures, causes, criteria)


def _criteria(scenario: Scenario, contacts: Contacts, recording: Recording, ego: Entity | None) -> tuple[CriterionResult, ...]:
    """Results of the scenario's criteria for its ego and all others that it calls so."""
    if not scenario.criteria:
        return ()
    egos = [entity.name for entity in scenario.entities.values() if entity is ego or is_called_ego(entity)]
    return judge_criteria(scenario.criteria, egos, recording, contacts.history, light_states(scenario.signals.history))


def criteria_remarks(criteria: Sequence[Criterion], verdict: Verdict) -> tuple[str, ...]:
    """Return the remarks on criteria that could not be judged, or whose parameters have no meaning."""
    unused = [f"{each.name}: {each.remark}" for each in criteria if each.kind is not None and each.remark]
    return (*unused, *(f"not judged: {result}" for result in verdict.criteria if result.passed is None))


def apply_limits(result: RunResult, limits: Sequence[Limit]) -> None:
    """Fail a run by the limits that it does not keep, and remark on those that say nothing about it."""
    if result.ego is None:
        idle = tuple(f"{limit.text}: there is no ego to measure" for limit in limits if limit.needs_ego)
        result.remarks = (*result.remarks, *idle)
    if not limits:
        return
    criticality = result.criticality
    own = [entry for entry in result.events if entry.subject == result.ego]
    facts = Facts(
        criticality.summary if criticality is not None else None,
        [(entry.kind, f"{entry.subject} {entry.text} at {entry.time:.2f} s") for entry in own],
        result.status,
        result.end_time,
    )
    reasons = tuple(reason for limit in limits if (reason := limit.reason(facts)))
    if reasons:
        result.verdict = replace(result.verdict, failures=(*result.verdict.failures, *reasons))
