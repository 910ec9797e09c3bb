"""The verdict of a run: contacts of its ego, criteria and limits, and the evidence that it tested
anything."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from runner.judging.criteria.criterion import (
    Criterion,
    CriterionResult,
    judge_criteria,
    kinds,
    light_states,
)
from runner.judging.evidence.least import limits_evidence, missing
from runner.judging.measures.measure import Facts
from runner.judging.result import RunEvidence, Verdict
from runner.systems.drivers import is_called_ego

if TYPE_CHECKING:
    from runner.engine.compile.compiler import Scenario
    from runner.engine.participants.entity import Entity
    from runner.engine.storyboard.collision import Contacts
    from runner.judging.measures.measure import Limit
    from runner.judging.result import RunResult
    from runner.recording import Recording


def judge(
    contacts: Contacts,
    ego: Entity | None,
    criteria: tuple[CriterionResult, ...],
    evidence: tuple[RunEvidence, ...],
) -> Verdict:
    """The verdict of a run: a failure when the ego touched another participant or a criterion
    failed.

    Args:
        criteria: results of the scenario's criteria.
        evidence: of the run.
    """
    collisions = [
        f"collision with {second if first == ego.name else first} at {time:.2f} s"
        for time, first, second in contacts.history
        # Contacts between others fail nothing: the verdict is about the ego's driver.
        if ego is not None and ego.name in (first, second)
    ]
    failures = (*collisions, *(str(result) for result in criteria if result.passed is False))
    return Verdict(failures, missing(evidence), criteria, evidence)


def results_of_criteria(
    criteria: Sequence[Criterion],
    scenario: Scenario,
    contacts: Contacts,
    recording: Recording,
    ego: Entity | None,
) -> tuple[CriterionResult, ...]:
    """Results of the scenario's criteria for its ego and all others that it calls so."""
    if not criteria:
        return ()
    # Files for CARLA may call several entities egos: criteria judge every one of them.
    egos = [
        entity.name
        for entity in scenario.entities.values()
        if entity is ego or is_called_ego(entity)
    ]
    lights = light_states(scenario.signals.history)
    return judge_criteria(criteria, egos, recording, contacts.history, lights)


def criteria_remarks(criteria: Sequence[Criterion]) -> tuple[str, ...]:
    """Return the remarks on criteria with parameters that have no meaning."""
    return tuple(
        f"{criterion.name}: {criterion.remark}"
        for criterion in criteria
        if criterion.kind is not None and criterion.remark
    )


def red_light_remarks(
    criteria: Sequence[Criterion], scenario: Scenario, recording: Recording, ego: Entity | None
) -> Iterator[str]:
    """A sentence on an ego that ran a red light, if no criterion of the scenario judges that."""
    if ego is None or not scenario.signals.history:
        return
    # A file without this criterion does not ask for it: the ego is remarked, and does not fail.
    kind = kinds()["runningredlighttest"]
    if any(criterion.kind is kind for criterion in criteria):
        return
    criterion = Criterion(kind.name, kind, {}, 0.0, "")
    (found,) = judge_criteria(
        [criterion], [ego.name], recording, (), light_states(scenario.signals.history)
    )
    if found.passed is False:
        yield f"{ego.name} {found.reason}; the scenario has no criterion for that"


def exceeded(result: RunResult, limits: Sequence[Limit]) -> tuple[str, ...]:
    """Reasons for which a run fails by limits; empty where it keeps them."""
    facts = _facts(result)
    return tuple(reason for limit in limits if (reason := limit.reason(facts)))


def kept(result: RunResult, limits: Sequence[Limit]) -> tuple[str, ...]:
    """Values of the measures of limits in a run that keeps them, in words."""
    facts = _facts(result)
    return tuple(dict.fromkeys(text for limit in limits if (text := limit.reached(facts))))


def margin(result: RunResult, limits: Sequence[Limit]) -> float:
    """Least signed distance of a run to its limits (`Limit.margins`) and to failures by criteria;
    infinite without any."""
    facts = _facts(result)
    by_criteria = (found.margin for found in result.verdict.criteria)
    return min((*by_criteria, *(limit.margin(facts) for limit in limits)), default=math.inf)


def _facts(result: RunResult) -> Facts:
    """Values that limits are compared with."""
    criticality = result.criticality
    # Limits on events are about the ego, as those on measures are.
    own = [entry for entry in result.events if entry.subject == result.ego]
    return Facts(
        criticality.summary if criticality is not None else None,
        [(entry.kind, f"{entry.subject} {entry.text} at {entry.time:.2f} s") for entry in own],
        result.status,
        result.end_time,
        result.verdict.criteria,
        criticality,
    )


def apply_limits(result: RunResult, limits: Sequence[Limit], least: Mapping[str, float]) -> None:
    """Fail a run by the limits that it does not keep; limits without a value leave it inconclusive.

    Args:
        least: least values of evidence by name.
    """
    if not limits:
        return
    criticality, reasons = result.criticality, exceeded(result, limits)
    # Without roads nobody can leave one: a limit on it would hold for ever and test nothing.
    roadless = result.recording.network is None
    shares = {
        limit.text: 0.0 if roadless and limit.needs_road else limit.defined(criticality)
        for limit in limits
    }
    found = limits_evidence(shares, least)
    verdict = result.verdict
    result.verdict = replace(
        verdict,
        failures=(*verdict.failures, *reasons),
        causes=(*verdict.causes, *missing([found])),
        evidence=(*verdict.evidence, found),
    )
