"""What a batch consists of: jobs, how files become jobs, and how each job ended."""

from __future__ import annotations

import traceback
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from schemas.errors import InvalidFile, Unsupported, UsageError, describe

_LONGEST = 100
"""Characters of a job's name that come from its file's name."""


@dataclass(frozen=True)
class Job:
    """One run to be done.

    Args:
        name: unique in the batch; names the folder of its results.
        source: the file that the user named (a scenario, or a parameter value distribution).
        scenario: the scenario file.
        parameters: values of its parameters.
    """

    name: str
    source: Path
    scenario: Path
    parameters: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Outcome:
    """How one run of a batch ended.

    Args:
        state: `passed`, `failed` (its verdict) or `error` (a defect of the file or the run).
        exit_code: what the command line would answer for this run alone.
        message: reasons of a failed verdict and remarks on the run, or the error.
        status, end_time, measures: of the run, where there was one (measures only with an output folder).
        trace: traceback of an error.
        criteria: results of the scenario's criteria, as in `result.json`.
    """

    job: Job
    state: str
    exit_code: int
    message: str = ""
    status: str = ""
    end_time: float | None = None
    measures: dict[str, Any] = field(default_factory=dict)
    trace: str = ""
    criteria: list[dict[str, Any]] = field(default_factory=list)


def jobs_of(paths: Iterable[Path], parameters: dict[str, str], enforce_constraints: bool) -> Iterator[Job | Outcome]:
    """The runs that files stand for, lazily: one for a scenario, one for each parameter set of a distribution.

    Args:
        paths: scenarios and distributions; one that can't be read gives an outcome in its place.
        parameters: values given by the user, for parameters that a distribution leaves alone.
        enforce_constraints: leave out parameter sets that violate the scenario's constraint groups.
    """
    stems: Counter[str] = Counter()
    for path in paths:
        stem = _folder_name(path)
        key = stem.casefold()  # some file systems do not tell upper from lower case
        stems[key] += 1
        if stems[key] > 1:
            stem = f"{stem}~{stems[key]}"
        try:
            yield from _jobs_of(path, stem, parameters, enforce_constraints)
        except Exception as error:  # a defect of ours is an outcome too, the other files go on
            yield failure(Job(stem, path, path, dict(parameters)), error)


def _folder_name(path: Path) -> str:
    """A file's name as a folder's name that is safe everywhere, and is none of the batch's own files, which have dots."""
    stem = "".join(c if c.isalnum() or c in "-_+=" else "_" for c in path.stem)
    return stem[:_LONGEST]


def _jobs_of(path: Path, stem: str, parameters: dict[str, str], enforce_constraints: bool) -> Iterator[Job]:
    import xosc

    kind = xosc.load(path).kind
    if kind == "scenario":
        yield Job(stem, path, path, dict(parameters))
    elif kind == "distribution":
        for index, (scenario, values) in enumerate(xosc.variations(path, enforce_constraints=enforce_constraints)):
            for name in parameters.keys() & values.keys():
                raise UsageError(f"the parameter {name!r} can't be given, this file sets it", path=path)
            yield Job(f"{stem}~{index:06d}", path, Path(scenario), {**parameters, **values})
    else:
        raise InvalidFile(f"this is a {kind}, nothing in it can be run", path=path)


def failure(job: Job, error: Exception) -> Outcome:
    """The outcome of a run that an error ended (to be called while it is handled); the file is named in any case."""
    if isinstance(error, InvalidFile | Unsupported) and error.path is None:  # only the run knew what is wrong
        error.path = str(job.scenario)
    message, code = describe(error)
    return Outcome(job, "error", code, message, trace=traceback.format_exc())
