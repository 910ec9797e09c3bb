"""Judge the criteria of a scenario over the recording of its run."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

from runner.criteria.criterion import Contact, CriterionResult, Drive, Finding, Kind, LightStates
from runner.criteria.declared import Criterion

if TYPE_CHECKING:
    from runner.recording import Recording

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
