"""Jobs of a batch: their creation from files, and their outcomes."""

from __future__ import annotations

import traceback
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from runner.judging.result import FAILED, INCONCLUSIVE, PASSED
from runner.systems.base import SystemUnderTestError
from schemas.common.errors import (
    ExitCode,
    InvalidFile,
    ToolchainError,
    Unsupported,
    UsageError,
    describe,
)
from schemas.common.policy import current, limited
from schemas.common.remarks import Remarks
from xosc.distributions.space import Selection, numbered

if TYPE_CHECKING:
    from schemas.common.remarks import Remark
    from xosc.distributions import ParameterSpace

CODES = {PASSED: ExitCode.PASSED, FAILED: ExitCode.FINDING, INCONCLUSIVE: ExitCode.INCONCLUSIVE}
"""Exit codes of verdicts"""
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
        seed: where it is repeated with seeds of its own; None for that of the batch.
        label: its name for people, with the values that vary between the runs of its file.
    """

    name: str
    source: Path
    scenario: Path
    parameters: dict[str, str] = field(default_factory=dict)
    seed: int | None = None
    label: str = field(default="", compare=False)

    @property
    def title(self) -> str:
        """The label, or else the name."""
        return self.label or self.name


FLEETING = {"memory": "a shortage of memory", "died": "the death of their process"}
"""Statuses of runs that something else than their inputs has ended, so that they are repeated where
a batch goes on"""

SYSTEM = "system"
"""Status of a run that an error of the system under test has ended"""


@dataclass(frozen=True)
class Outcome:
    """Outcome of one run of a batch.

    Args:
        state: `passed`, `failed`, `inconclusive` (its verdict), `error` (a defect of the file or
            the run), or `loaded` (by a rehearsal).
        exit_code: what the command line would answer for this run alone.
        message: reasons of a failed or inconclusive verdict, values of the limits that a passed run
            keeps, or the error.
        status, end_time, measures: of the run, where there was one (measures only with an output
            folder); of an error the status is one of `FLEETING`, `SYSTEM`, or empty.
        trace: traceback of an error.
        impact: of a failed run in which the ego touches another participant: `speed`, `delta_v`
            (m/s), `risk` (of a death), `time` (s), `other`, `side`, `point` (m) and `strikes`; see
            `runner.judging.measures.contacts`.
        criteria: results of the scenario's criteria, as in `result.json`.
        remarks: what was assumed and what may not be meant, as in `result.json`, a line each.
        causes: names of the causes for which the run tested nothing, see `runner.judging.evidence`.
        evidence: of the run, as in `result.json`.
        inputs: digest of all that decided what the run gave (with an output folder).
        content: digest of its files alone: scenario, road network and catalogues.
        files: digests of the files in the folder of its results, by name.
        seal: of the journal, by the user's key.
    """

    job: Job
    state: str
    exit_code: int
    message: str = ""
    status: str = ""
    end_time: float | None = None
    measures: dict[str, Any] = field(default_factory=dict)
    impact: dict[str, Any] | None = None
    trace: str = ""
    criteria: list[dict[str, Any]] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)
    causes: list[str] = field(default_factory=list)
    evidence: list[dict[str, Any]] = field(default_factory=list)
    inputs: str = ""
    content: str = ""
    files: dict[str, str] = field(default_factory=dict)
    seal: str = ""


_OF_ERRORS = {ExitCode.USAGE, ExitCode.INVALID, ExitCode.UNSUPPORTED, ExitCode.INTERNAL}


def is_sound(outcome: Outcome) -> bool:
    """Whether an outcome of a possibly edited file has values of its types, and an exit code of its
    state.

    Raises:
        TypeError, KeyError, AttributeError, ValueError: it has not even their structure.
    """
    # Wrong types here would end as internal errors in tables and pages.
    job, impact = outcome.job, outcome.impact
    texts = [outcome.message, outcome.status, outcome.inputs, outcome.content, outcome.seal]
    texts += [job.label, *outcome.remarks, *outcome.causes]
    numbers = [outcome.end_time, job.seed]
    for mapping in (job.parameters, outcome.files):
        texts += [*mapping.keys(), *mapping.values()]
    for name, value in outcome.measures.items():
        extreme = value if isinstance(value, dict) else {"value": value}
        texts += [name, extreme.get("other") or ""]
        numbers += [extreme["value"], extreme.get("time")]
    for row in outcome.evidence:
        texts += [row["name"], row["unit"], *row["texts"]]
        numbers += [row["value"], row["planned"], row["least"]]
    for criterion in outcome.criteria:
        texts += [criterion["name"], criterion["entity"], criterion["result"], criterion["reason"]]
    if impact is not None:
        x, y = impact["point"]
        texts += [impact["side"], impact["other"]]
        numbers += [x, y, *(impact[name] for name in ("speed", "delta_v", "risk", "time"))]
    typed = all(isinstance(text, str) for text in texts)
    typed &= all(isinstance(number, int | float | None) for number in numbers)
    is_error = outcome.state == "error"
    # A state and a code that contradict each other come from an edited file.
    return typed and (
        outcome.exit_code in _OF_ERRORS
        if is_error
        else CODES.get(outcome.state) == outcome.exit_code
    )


def jobs_of(
    paths: Iterable[Path],
    parameters: dict[str, str],
    enforce_constraints: bool,
    selection: Selection | None = None,
    repeat: int | None = None,
) -> Jobs:
    """The runs that files stand for, lazily: one for a scenario, one for each parameter set of a
    distribution.

    Args:
        paths: scenarios and distributions; one that can't be read gives an outcome in its place.
        parameters: values given by the user, for parameters that no distribution sets.
        enforce_constraints: leave out parameter sets that violate the scenario's constraint groups.
        selection: which sets; by default each.
        repeat: how often each set is run, with seeds that count up from the selection's; None for
            once, with the settings' seed.
    """
    selection = selection or Selection()
    seeds = [None] if repeat is None else [selection.seed + number for number in range(repeat)]
    return Jobs(list(paths), parameters, enforce_constraints, selection, seeds)


class Jobs:
    """Jobs of files, and their number; see `jobs_of`.

    Attributes:
        left_out: number of parameter sets of each file that violate constraints, once the file's
            jobs have been made.
        made: number of jobs that have been made.
        stopped: whether the batch has ended before all of them.
    """

    def __init__(
        self,
        paths: list[Path],
        parameters: dict[str, str],
        enforce_constraints: bool,
        selection: Selection,
        seeds: Sequence[int | None],
    ) -> None:
        self._files = list(zip(names_of(paths), paths, strict=True))
        self._parameters, self._enforce, self._selection, self._seeds = (
            parameters,
            enforce_constraints,
            selection,
            seeds,
        )
        self._spaces: dict[Path, ParameterSpace] = {}
        self.left_out: dict[Path, int] = {}
        self.made, self.stopped = 0, False

    def __iter__(self) -> Iterator[Job | Outcome]:
        for job in self._all():
            self.made += 1
            yield job

    def _all(self) -> Iterator[Job | Outcome]:
        for name, path in self._files:
            try:
                yield from self._of(path, name)
            # The next files go on: one that can't be read is an outcome in its place.
            except Exception as error:  # a defect of ours is an outcome too, the other files go on
                if isinstance(error, UsageError) and error.path is None:
                    error.path = str(path)
                yield failure(Job(name, path, path, dict(self._parameters)), error)

    @property
    def sources(self) -> set[Path]:
        """The files that the user named."""
        return {path for _, path in self._files}

    def is_named(self, job: Job) -> bool:
        """Whether a job has the name that this batch gives runs of its file."""
        # Names are those of this batch's files: `~` leads on to sets and seeds.
        names = [name for name, path in self._files if path == job.source]
        return any(job.name == name or job.name.startswith(f"{name}~") for name in names)

    @property
    def planned(self) -> int:
        """Number of jobs: of those that have been made, and of all where the batch was stopped."""
        return self.total if self.stopped else self.made

    @property
    def total(self) -> int:
        """Return the largest possible number of jobs; sets that constraints exclude are counted.
        Reads the files."""
        return sum(self._count(path) for _, path in self._files)

    def _count(self, path: Path) -> int:
        try:
            return self._selection.count(self._space(path)) * len(self._seeds)
        except ToolchainError:
            return 1  # the outcome in its place

    def _space(self, path: Path) -> ParameterSpace:
        import xosc
        from xosc.distributions import ParameterSpace

        if path not in self._spaces:
            kind = xosc.load(path).kind
            if kind not in ("scenario", "distribution"):
                raise InvalidFile(f"this is a {kind}, nothing in it can be run", path=path)
            self._spaces[path] = ParameterSpace(path)
        return self._spaces[path]

    def _of(self, path: Path, name: str) -> Iterator[Job]:
        """The jobs of a file, with names that begin with its own."""
        with limited():
            space = self._space(path)
        # Before any set is made: a space may have more sets than a policy allows.
        current().admit_runs(self._selection.count(space) * len(self._seeds), path)
        varying = space.varying
        for index, values in self._selection.sets(
            space, self._enforce, partial(self.left_out.__setitem__, path)
        ):
            # A value given by the user would have no effect, and pass in silence.
            for parameter in self._parameters.keys() & values.keys():
                raise UsageError(
                    f"the parameter {parameter!r} can't be given, this file sets it", path=path
                )
            own = name if space.distribution is None else numbered(name, index)
            told = ", ".join(f"{name}={value}" for name, value in values.items() if name in varying)
            for seed in self._seeds:
                one = own if seed is None else f"{own}~seed{seed}"
                yield Job(
                    one,
                    path,
                    space.scenario,
                    {**self._parameters, **values},
                    seed,
                    f"{one} {told}".rstrip(),
                )
        # A space holds its file's document: many files would fill the memory.
        self._spaces.pop(path, None)


def assumed(job: Job, strict: bool) -> Sequence[Remark]:
    """Return the assumptions in reading the parameter value distribution of a job; none for other
    jobs.

    Raises:
        InvalidFile: there is something, and reading is strict.
    """
    from xosc.distributions.deterministic import respelled
    from xosc.document import load

    if job.source == job.scenario:
        return []
    source, remarks = load(job.source, strict=strict), Remarks(strict)
    remarks.add(*respelled(source, load(job.scenario), job.parameters))
    return (*source.remarks, *remarks.found)


def names_of(paths: Sequence[Path]) -> list[str]:
    """A name for each file: unique, safe as a folder's name, and with the folders that tell files
    of one name apart."""
    # Long names are cut: file systems allow 255 bytes, and sets and seeds follow.
    files = {path.absolute(): _folder_name(path.stem)[:_LONGEST] for path in paths}
    for depth in range(1, max((len(path.parts) for path in files), default=0)):
        alike = {
            name for name, count in Counter(map(str.casefold, files.values())).items() if count > 1
        }
        files |= {
            path: _qualified(path, depth)
            for path, name in files.items()
            if name.casefold() in alike
        }
    taken: Counter[str] = Counter()
    names = []
    for path in paths:
        name = files[path.absolute()]
        taken[name.casefold()] += 1  # some file systems do not tell upper from lower case
        names.append(
            name if taken[name.casefold()] == 1 else f"{name}~{taken[name.casefold()]}"
        )  # the same file again
    return names


def _qualified(path: Path, depth: int) -> str:
    """File name with the names of its innermost folders."""
    return "-".join(_folder_name(part) for part in path.with_suffix("").parts[-depth - 1 :])[
        -_LONGEST:
    ]


def _folder_name(text: str) -> str:
    """Safe folder name on all systems; without dots, so that it is none of the batch's own
    files."""
    # No dots: `..`, hidden folders and files of the batch can't be named.
    return "".join(c if c.isalnum() or c in "-_+=" else "_" for c in text)


def failure(job: Job, error: Exception) -> Outcome:
    """The outcome of a run that an error ended (to be called while it is handled); the file is
    named in any case."""
    if (
        isinstance(error, InvalidFile | Unsupported) and error.path is None
    ):  # only the run knew what is wrong
        error.path = str(job.scenario)
    message, code = describe(error)
    status = "memory" if isinstance(error, MemoryError) else ""
    status = SYSTEM if isinstance(error, SystemUnderTestError) else status
    return Outcome(job, "error", code, message, status, trace=traceback.format_exc())
