"""Criteria that a scenario declares in its stop triggers, as CARLA's scenario_runner reads them, and their judgement of a run."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from runner.criteria.criterion import Contact, CriterionResult, Drive, Finding, Kind, LightStates, kinds
from xosc.dialects.carla import CRITERION_PREFIX, is_criterion

if TYPE_CHECKING:
    from runner.recording import Recording
    from xosc.node import Node

Contacts = Iterable[tuple[float, str, str]]
"""Beginnings of contacts: time (s) and the names of both participants."""


def judge_criteria(
    criteria: Sequence[Criterion], names: Sequence[str], recording: Recording, contacts: Contacts, lights: LightStates
) -> tuple[CriterionResult, ...]:
    """The result of each criterion for each participant that it is about.

    A criterion that can't be judged says so: it has no such participant, no value, no roads, or no kind of its name.

    Args:
        criteria: of the scenario.
        names: the participants that they are about, the egos of the scenario.
        recording: of the run, with its road network where it had one.
        contacts: of all participants, in ascending time.
        lights: states of the traffic signals.
    """
    history = list(contacts)
    results = []
    for criterion in criteria:
        if criterion.kind is None:
            results.append(CriterionResult(criterion.name, "", None, None, "", criterion.remark))
        elif not names:
            results.append(CriterionResult(criterion.name, "", None, None, criterion.kind.unit, "the scenario has no ego"))
        else:
            for name in names:
                finding = _find(criterion, criterion.kind, name, recording, history, lights)
                results.append(
                    CriterionResult(criterion.name, name, finding.passed, finding.value, criterion.kind.unit, finding.reason)
                )
    return tuple(results)


def _find(
    criterion: Criterion, kind: Kind, name: str, recording: Recording, history: list[tuple[float, str, str]], lights: LightStates
) -> Finding:
    """A criterion's finding on one participant."""
    track = recording.tracks.get(name)
    if kind.on_roads and recording.network is None:
        return Finding(None, None, "there is no road network")
    missing = [parameter for parameter, value in criterion.parameters.items() if value is None]
    if missing:
        return Finding(None, None, f"the scenario gives no value for {' and '.join(missing)}")
    if track is None:
        return Finding(None, None, f"{name} never appeared")
    mine = tuple(
        Contact(time, second if first == name else first)
        for time, first, second in history
        if name in (first, second) and time >= criterion.delay
    )
    drive = Drive(track, recording, mine, lights, criterion.delay)
    if not len(drive.columns["time"]):
        return Finding(None, None, f"{name} was not there after {criterion.delay:g} s")
    return kind.evaluate(drive, **criterion.parameters)


def light_states(events: Iterable[tuple[float, str, str]]) -> Mapping[str, list[tuple[float, str]]]:
    """States of traffic signals by signal, from the times (s), signals and states of all changes in ascending time."""
    states: dict[str, list[tuple[float, str]]] = {}
    for time, signal, state in events:
        states.setdefault(signal, []).append((time, state))
    return states


_SEPARATORS = re.compile(r"[\s,;]+")


@dataclass(frozen=True)
class Criterion:
    """A criterion of a scenario.

    Args:
        name: as in the scenario, without `criteria_`.
        kind: None where no criterion has that name.
        parameters: of the kind, by name; None where neither the scenario nor the kind gives a value.
        delay: time (s) from which it is judged.
        where: `file:line` of the condition.
        remark: what the scenario says that has no meaning for it; empty where there is nothing.
    """

    name: str
    kind: Kind | None
    parameters: dict[str, float | None]
    delay: float
    where: str
    remark: str = ""


def declared(storyboard: Node) -> tuple[Criterion, ...]:
    """The criteria in all stop triggers of a Storyboard element.

    Raises:
        InvalidFile: a value of a criterion is not a number, or there are more values than it has parameters.
    """
    conditions = (condition for trigger in storyboard.iter("StopTrigger") for condition in trigger.iter("Condition"))
    return tuple(_read(condition) for condition in conditions if is_criterion(condition))


def _read(condition: Node) -> Criterion:
    name, parameter = (
        condition.get("name").removeprefix(CRITERION_PREFIX),
        condition.need("ByValueCondition", "ParameterCondition"),
    )
    kind, delay = kinds().get(name.casefold()), condition.finite("delay", 0.0)
    if kind is None:
        known = ", ".join(sorted(each.name for each in kinds().values()))
        return Criterion(name, None, {}, delay, condition.where, f"there is no criterion of this name; criteria: {known}")
    reference, text = parameter.get("parameterRef", ""), parameter.get("value", "")
    if not kind.parameters:
        remark = f"{kind.name} has no parameters: value={text!r} is not used" if text.strip() else ""
        return Criterion(kind.name, kind, {}, delay, condition.where, remark)
    values = _values(parameter, kind, reference, text)
    return Criterion(kind.name, kind, kind.parameters | values, delay, condition.where)


def _values(parameter: Node, kind: Kind, reference: str, text: str) -> dict[str, float | None]:
    """Values by parameter: in their order, from the one on that parameterRef names; an empty one with a name means 0."""
    names = list(kind.parameters)
    names = names[names.index(reference) if reference in names else 0 :]
    texts = [one for one in _SEPARATORS.split(text.strip()) if one] or (["0"] if reference else [])
    if len(texts) > len(names):
        raise parameter.invalid(f"value={text!r} has {len(texts)} numbers, {kind.name} takes {', '.join(names)}")
    return {name: _number(parameter, kind, one, text) for name, one in zip(names, texts, strict=False)}


def _number(parameter: Node, kind: Kind, text: str, whole: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not math.isfinite(value):
        raise parameter.invalid(f"value={whole!r} is not a number: {kind.name} takes {', '.join(kind.parameters)}")
    return value
