"""Outcomes of runs: from a result, or derived again from stored results where a batch is resumed
without a seal."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import xosc
from runner.batch.jobs import CODES, Job, Outcome
from runner.batch.outputs import report
from runner.batch.outputs.folder import EVENTS, RESULT, TRAJECTORIES, load_run
from runner.judging.criteria.criterion import elements
from runner.judging.evidence.rows import ROWS
from runner.judging.verdict import exceeded, kept
from runner.systems import system_name
from runner.systems.base import SENSOR_RANGE, split
from schemas.common.errors import InvalidFile
from schemas.common.storage import read_object
from schemas.common.terminal.text import one_line, shown

if TYPE_CHECKING:
    from runner.judging.measures.measure import Limit
    from runner.judging.result import RunResult
    from runner.judging.settings import RunSettings

_DERIVED = (
    "state", "exit_code", "message", "status", "end_time", "measures", "impact", "criteria",
    "remarks", "causes", "evidence",
)  # fmt: skip
"""Fields of an outcome that follow from the result of its run"""
_SAME = 1e-9
"""Relative difference of times that are equal"""


def outcome_of(
    job: Job,
    result: RunResult,
    measures: dict[str, Any],
    files: dict[str, str],
    contacts: bool = True,
    limits: Sequence[Limit] = (),
) -> Outcome:
    """The outcome of a run that has a result.

    Args:
        measures: criticality of the ego, as in `result.json`.
        files: digests of the files in its folder.
        contacts: describe the first contact of a failed run.
        limits: of the run, whose values a passed one tells.
    """
    verdict = result.verdict
    told_of = kept(result, limits) if verdict.passed else _reasons(result)
    # A line each: names from files may hold line breaks.
    message, criteria = one_line("; ".join(told_of)), report.criteria(verdict)
    doubts = dict.fromkeys((*result.remarks, *(cause.text for cause in verdict.causes)))
    told = [
        one_line(remark)
        for remark in doubts
        if not any(remark in reason for reason in verdict.reasons)
    ]
    return Outcome(
        job, verdict.outcome, CODES[verdict.outcome], message, result.status, result.end_time,
        measures,
        impact=report.impact(result) if verdict.failures and contacts else None,
        criteria=criteria, remarks=told,
        causes=[*dict.fromkeys(cause.name for cause in verdict.causes)],
        evidence=report.evidence(verdict), files=files,
    )  # fmt: skip


def _reasons(result: RunResult) -> Iterator[str]:
    """Reasons for a failure, with the range of the system's sensors, or for an inconclusive run."""
    yield from shown(result.verdict.reasons)
    if result.verdict.failures and SENSOR_RANGE in result.sut_parameters:
        yield f"{split(result.sut)[0]} sees {result.sut_parameters[SENSOR_RANGE]:g} m"


def contradiction(stored: Outcome, folder: Path, settings: RunSettings) -> str:
    """Return why a stored outcome does not follow from the files of its run; empty where it does.

    Derived again are the measures and contacts of the trajectories, the limits, the times of the
    evidence, and of these and the result the outcome. An error has no files: it is taken as it is.
    Criteria of the scenario watch the simulation itself: a run that satisfies them is not believed.

    Args:
        folder: results of the run.
        settings: of the batch.
    """
    if stored.state == "error":
        return ""
    if not stored.files.keys() >= {RESULT, TRAJECTORIES, EVENTS}:
        return "without results"
    try:
        result = load_run(folder)
        # Both as JSON has them: infinite numbers are null there.
        derived, said = report.finite(report.summary(result)), read_object(folder / RESULT)
    except InvalidFile:
        return "with results that can't be read"
    own = settings if stored.job.seed is None else replace(settings, seed=stored.job.seed)
    measures = derived["criticality"] or {}
    outcome = outcome_of(stored.job, result, measures, stored.files, limits=own.limits)
    values = report.finite({name: getattr(outcome, name) for name in _DERIVED})
    if any(getattr(stored, name) != value for name, value in values.items()):
        return "with an entry that does not follow from the results"
    if derived != said or not _is_of(result, stored.job, own) or not _is_judged(result, own):
        return "with a verdict that does not follow from the trajectories"
    # A failure is believed: an edited entry would rather claim a pass.
    if not result.verdict.failures and any(elements(xosc.load(stored.job.scenario).node)):
        return "with criteria, which trajectories do not decide (XOSC_SEAL_KEY seals them)"
    return ""


def _is_of(result: RunResult, job: Job, settings: RunSettings) -> bool:
    """Whether a result is that of a job."""
    asked = system_name(settings.sut)
    return (
        result.scenario.name == job.scenario.name
        and result.parameters == {name: str(value) for name, value in job.parameters.items()}
        and all(getattr(settings, name) == value for name, value in result.settings.items())
        and result.sut in (asked, "none" if result.ego is None else asked)
    )


def _is_judged(result: RunResult, settings: RunSettings) -> bool:
    """Whether the contacts of the ego, the limits and the times of a result are those of its
    trajectories."""
    verdict = result.verdict
    # Hiding a contact is what an edited result is for: it is looked for anew.
    if not verdict.failures and _is_contact(result):
        return False
    if not set(exceeded(result, settings.limits)) <= set(verdict.failures):
        return False
    evidence = {row.name: row for row in verdict.evidence}
    least = settings.least_values
    if not evidence.keys() <= ROWS.keys():
        return False
    # A lower least value would turn a lack into a pass.
    if any(row.least != least.get(name, ROWS[name].least) for name, row in evidence.items()):
        return False
    times = {"seconds": result.end_time}
    if result.ego is None and "ego_seconds" in evidence:
        return False
    if result.ego in result.recording.tracks:
        # As `Observed.ego_seconds` counts: n rows are n - 1 steps.
        rows = len(result.recording.tracks[result.ego].columns["time"])
        times["ego_seconds"] = max(rows - 1, 0) * result.settings["timestep"]
    return all(
        name in evidence and abs(evidence[name].value - time) <= _SAME * max(time, 1.0)
        for name, time in times.items()
    )


def _is_contact(result: RunResult) -> bool:
    """Whether the ego touches another participant, or without an ego any two touch."""
    from runner.judging.measures.criticality import of_recording

    if result.ego is not None:
        return result.criticality is not None and result.criticality.impact is not None
    found = (of_recording(result.recording, name) for name in result.recording.tracks)
    return any(measures is not None and measures.impact is not None for measures in found)
