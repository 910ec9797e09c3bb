"""Many parameter sets of one scenario played at once, in arrays, where all its elements can.

The structure is compiled once, numbers are arrays over sets; sets whose numbers change the
structure are compiled apart. What can't be played so is named, and is left to the interpreter.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, nullcontext
from dataclasses import dataclass, replace
from functools import partial
from heapq import heappop, heappush
from itertools import compress, islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import xosc
from runner.batch.jobs import CODES, Job, Outcome
from runner.batch.outputs.terminal import IN_ARRAYS
from runner.batch.pool import Workers, results
from runner.engine.compile.compiler import Scenario, compile_scenario
from runner.engine.compile.road_network import load_roads
from runner.engine.motion.rss import parameter_set
from runner.engine.storyboard.array_run import ArraySimulation
from runner.judging.criteria.criterion import declared
from runner.judging.evidence.array_judge import MEASURED, OPEN, ArrayJudge, ArrayOutcomes
from runner.judging.evidence.least import least_values
from runner.judging.evidence.rows import ROWS
from runner.judging.measures.runs import Measuring, RunMeasures
from runner.judging.result import FAILED, PASSED
from runner.judging.settings import RunSettings
from runner.systems import OF_SYSTEM
from runner.systems.array_systems import open_arrays
from runner.systems.base import SystemUnderTestError
from runner.systems.drivers import ArraySystemDriver, find_ego
from schemas.common.array_types import IntArray
from schemas.common.errors import ToolchainError, Unsupported
from schemas.common.policy import current
from schemas.common.terminal.text import many
from schemas.expressions.columns import Columns, NotInArrays, NumberColumn, reading
from schemas.expressions.values import type_named

BLOCK = 16_384
"""Sets that are played at a time: a step of more of them costs less each"""
RUN_BY_RUN_BLOCK = 1024
"""Sets that are played at a time where the system is asked run by run, which takes most of the
time: several processes have work from fewer sets on"""
_KEPT = 1024
"""Sets that are played at a time where all their instants are kept: about 40 MB for two
participants and 30 s"""
_AFTER_COLLISION = 1.0
"""Time that is played on after the ego's first contact, where that ends a run, s"""
SETS = "sets.parquet"
"""Table of the sets that were played in arrays, in the folder of a batch"""
NEAREST = 10
"""Runs without a failure that come nearest to one, and that are recorded"""
_TOLD = 5
"""Sets that are named of those that end otherwise in arrays than one by one"""
_MOST_STRUCTURES = 32
"""Structures that are compiled for the sets of a scenario; sets beyond are played one by one"""
_TEXTS = ("outcome", "status", "partner")
_COLUMNS = (*_TEXTS, "end_time", "contact", "min_ttc", "min_distance", "max_drac", "risk")
"""Columns of `sets.parquet` beside the name of the run and its parameters"""
_RUN_BY_RUN = 0.1
"""Share of steps of entities that are done run by run from which on single runs are as fast"""
_MOST_OPEN = 0.5
"""Share of runs that are left to the interpreter from which on it may as well play all"""
Sets = Sequence[Mapping[str, str]]


@dataclass(frozen=True, eq=False)
class CompiledSets:
    """A scenario compiled for the sets that have its structure.

    Args:
        scenario: compiled once; numbers that vary are columns.
        members: indices of the sets (k,).
        places: of these in the columns (k,), which have sets of other structures as well.
    """

    scenario: Scenario
    members: IntArray
    places: IntArray


@dataclass(frozen=True, eq=False)
class PlayedRow:
    """Sets that were played at once.

    Args:
        members: indices of the sets (k,).
        outcomes: of these.
    """

    members: IntArray
    outcomes: ArrayOutcomes


def structures(path: Path, sets: Sets, settings: RunSettings) -> Iterator[CompiledSets]:
    """Compile a scenario for parameter sets with the same parameter names.

    Sets beyond the structures given, and those for which it can't be compiled, have to be played
    one by one.

    Raises:
        NotInArrays: the scenario can't be compiled for many sets at once.
        ToolchainError: it can't be compiled for any.
    """
    document = xosc.load(path)
    doubles = _doubles(document)
    left: dict[tuple[tuple[str, str], ...], list[int]] = {}
    for number, values in enumerate(sets):
        key = tuple((name, text) for name, text in values.items() if name not in doubles)
        left.setdefault(key, []).append(number)
    # Numbers that are no doubles, as counts and texts, may choose elements: one structure each.
    pending = [(dict(key), np.array(members)) for key, members in left.items()]
    fault: ToolchainError | None = None
    compiled = False
    for _ in range(_MOST_STRUCTURES):
        if not pending:
            break
        fixed, members = pending.pop(0)
        found, alike = _compiled(
            document, path, fixed, [sets[member] for member in members], settings
        )
        if isinstance(found, ToolchainError):
            fault = found
        else:
            compiled = True
            yield CompiledSets(found, members[alike], np.flatnonzero(alike))
        if not alike.all():
            pending.append((fixed, members[~alike]))
    if fault is not None and not compiled:
        raise fault


def _doubles(document: Any) -> set[str]:
    declared = document.node.find("ParameterDeclarations")
    doubles = set()
    for declaration in declared.children() if declared is not None else ():
        try:
            if type_named(declaration.get("parameterType", "")) == "double":
                doubles.add(declaration.get("name"))
        except ValueError:
            continue
    return doubles


def _compiled(
    document: Any, path: Path, fixed: dict[str, str], sets: Sets, settings: RunSettings
) -> tuple[Scenario | ToolchainError, Any]:
    """Scenario of the first set and all sets of its structure, or its fault, and the mask of these
    sets."""
    values: dict[str, Any] = {}
    constant: dict[str, Any] = dict(fixed)
    for name in sets[0].keys() - fixed.keys():
        column = np.array([float(assignment[name]) for assignment in sets])
        # A constant stays a number: elements that take no column can be compiled with it.
        if (column == column[0]).all():
            constant[name] = sets[0][name]
        else:
            values[name] = column.view(NumberColumn)
    with reading(Columns(len(sets))) as columns:
        try:
            resolved = xosc.resolve(
                document,
                constant,
                enforce_constraints=settings.enforce_constraints,
                strict=settings.strict,
                catalog_path=settings.catalog_path,
                columns=values,
            )
            network, assumed = load_roads(
                resolved, settings.road, settings.road_path, settings.strict
            )
            resolved = replace(resolved, remarks=(*resolved.remarks, *assumed))
            scenario = compile_scenario(resolved, network, strict=settings.strict)
            # Criteria watch single runs: their findings have no arrays.
            limits = (limit.criterion for limit in settings.limits)
            criteria = [
                *declared(resolved.node.need("Storyboard")),
                *(criterion for criterion in limits if criterion is not None),
            ]
            of_system = [name for name in scenario.parameters if name.startswith(OF_SYSTEM)]
            if of_system and settings.sut is not None:
                raise NotInArrays(f"{of_system[0]}: systems get parameters in single runs only")
            if criteria:
                raise NotInArrays(f"{criteria[0].name}: criteria are judged in single runs only")
        except NotInArrays:
            raise
        except ToolchainError as error:
            return error, columns.alike
        except TypeError as error:  # a function of single numbers was given a column
            # Constant numbers only: then the error is a defect of ours.
            if not values:
                raise
            raise NotInArrays(f"a number that varies is used as a single one: {error}") from error
        return scenario, columns.alike


def obstacle(path: Path, settings: RunSettings, sets: Sets = ({},), *, fast: bool = False) -> str:
    """Return the reason for which a scenario does not play in arrays; empty where it does.

    Args:
        sets: parameter sets for which it is compiled.
        fast: play the sets, and take it for such a reason if much of it is done run by run.

    Raises:
        ToolchainError: the scenario can't be compiled.
    """
    try:
        for structure in structures(path, sets, settings):
            with _run(structure, structure.places, settings) as (run, judge):
                if not fast:
                    continue
                run.play()
                outcomes = judge.outcomes(run)
                # Instants of all participants: what was loaded one by one is measured against them.
                moves = outcomes.steps.sum() * len(outcomes.names)
                if (
                    run.loaded.count > _RUN_BY_RUN * moves
                    or (outcomes.outcome == OPEN).mean() > _MOST_OPEN
                ):
                    return "much of it is done run by run, as slowly as in single runs"
    except (NotInArrays, Unsupported) as error:
        return str(error)
    return ""


def _needs_instants(settings: RunSettings) -> bool:
    """Whether a limit is of a measure that is taken run by run."""
    return any(limit.name not in MEASURED for limit in settings.limits)


def play(
    structure: CompiledSets,
    settings: RunSettings,
    measuring: Measuring | None = None,
    keeps: bool = False,
) -> Iterator[PlayedRow]:
    """Play the sets of a structure, a block at a time.

    Args:
        measuring: choice of measures; None for none.
        keeps: whether places at all instants are kept, for comparisons.

    Raises:
        NotInArrays: an element, the system under test or a setting plays in single runs only.
    """
    count = len(structure.members)
    # In blocks: the state of all sets of a large space would fill the memory.
    block = _KEPT if _needs_instants(settings) else BLOCK
    for start in range(0, count, block):
        chosen = slice(start, start + block)
        with _run(structure, structure.places[chosen], settings, measuring, keeps) as (run, judge):
            run.play()
        yield PlayedRow(structure.members[chosen], judge.outcomes(run))


def decides_together(settings: RunSettings) -> bool:
    """Whether the system under test decides in all runs by one call.

    Raises:
        Unsupported: it can't be asked for many runs at once.
        ToolchainError: it fails, or there is none of this name.
    """
    system = open_arrays(settings.sut, settings.sut_in_process, settings.sut_timeout)
    with closing(system) if system is not None else nullcontext():
        return system is None or system.together


class Together:
    """Jobs and outcomes of a batch: sets that pass in arrays are outcomes, the others jobs for the
    interpreter.

    A run that failed in arrays counts only if it fails in the interpreter; one that does not is a
    disagreement. The nearest misses are played by the interpreter as well, so that there are
    recordings of them, and passes are tried. What both have played must have one verdict, and in
    the kinematic world one end: else there is a defect of ours, or a system whose `control_batch`
    decides otherwise than its `control`.

    Args:
        jobs: of the batch.
        settings: of the runs.
        out: folder for `sets.parquet`, a row for each set that was played in arrays; None for none.
        tell: called with a line on what is left to the interpreter, and with the sum.
        processes: how many play at a time.
    """

    def __init__(
        self,
        jobs: Iterable[Job | Outcome],
        settings: RunSettings,
        out: Path | None,
        tell: Callable[[str], None],
        processes: int = 1,
    ) -> None:
        self._jobs, self._settings, self._out, self._tell = jobs, settings, out, tell
        self._processes = processes
        self._single: set[Path] = set()
        """scenarios that do not play in arrays"""
        self._failed = 0
        self._left: dict[str, _EndInArrays] = {}
        """what arrays made of sets that the interpreter is yet to play"""
        self._near: list[tuple[float, int, Outcome]] = []
        """nearest misses, the farthest first: minus its distance (m)"""
        self._writer: Any = None
        self._passed = self._apart = self._disagreements = 0
        self._failing = False

    def __iter__(self) -> Iterator[Job | Outcome]:
        try:
            chunks = _chunks(self._jobs, self._size())
            while group := [*islice(chunks, self._processes)]:
                yield from self._settle(group)
            # The nearest misses of all are known at the end only: as jobs they are recorded.
            for _, _, near in sorted(self._near, key=lambda e: e[1]):
                assert near.end_time is not None
                self._left[near.job.name] = _EndInArrays(PASSED, near.status, near.end_time)
                yield near.job
        finally:
            if self._writer is not None:
                self._writer.close()

    @property
    def fault(self) -> str:
        """Reason for which passes in arrays count for nothing: runs contradict them, or the system
        fails where it decides in arrays. Empty without one."""
        if self._apart:
            return "single runs end otherwise than in arrays, whose passes count for nothing"
        return "the system under test fails in arrays; all was run one by one" * self._failing

    def checked(self, outcomes: Iterable[Outcome]) -> Generator[Outcome]:
        """The outcomes of the batch; those that contradict the arrays are told."""
        for outcome in outcomes:
            played = self._left.pop(outcome.job.name, None)
            if played is not None:
                self._compare(outcome, played)
            yield outcome
        if self._apart:
            self._tell(
                f"{many(self._apart, 'set')} ended otherwise in arrays than one by one: "
                "the system decides otherwise in control_batch than in control, or it is a defect "
                "of ours; passes in arrays count for nothing, --no-batch runs each set"
            )
        if not self._passed and not self._failed:
            self._tell("no set was played to a verdict in arrays")
            return
        told = f"{self._passed} sets passed in arrays, kinematically, {self._failed} failed there"
        self._tell(f"{told}, of which {self._disagreements} did not fail one by one")

    def _compare(self, outcome: Outcome, played: _EndInArrays) -> None:
        # An error ends a run anywhere; what it had hidden is not known.
        decided = outcome.state != "error" or played.state == FAILED
        if played.state in (PASSED, FAILED) and decided and outcome.state != played.state:
            self._disagreements += played.state == FAILED
            told = f"{played.state} in arrays, {outcome.state} one by one"
        elif (
            self._settings.world == "kinematic"  # on SUMO others may do otherwise
            and outcome.end_time is not None
            and (
                abs(outcome.end_time - played.end_time) > self._settings.timestep / 2.0
                or outcome.status != played.status
            )
        ):
            told = (
                f"{played.status} at {played.end_time:.2f} s in arrays, "
                f"{outcome.status} at {outcome.end_time:.2f} s one by one"
            )
        else:
            return
        self._apart += 1
        if self._apart <= _TOLD:
            self._tell(f"{outcome.job.name}: {told}")

    def _size(self) -> int:
        """Jobs that are settled at a time, in each process."""
        try:
            return BLOCK if decides_together(self._settings) else RUN_BY_RUN_BLOCK
        except (ToolchainError, NotInArrays):  # told with the first file
            return BLOCK

    def _settle(self, chunks: list[list[Job] | Outcome]) -> Iterator[Job | Outcome]:
        """Play some chunks, each in a process of its own, and go through them in their order."""
        asked = [
            not isinstance(chunk, Outcome) and chunk[0].scenario not in self._single
            for chunk in chunks
        ]
        tasks: list[Any] = [*compress(chunks, asked)]
        # An instance of a system can't be handed to other processes.
        alone = len(tasks) < 2 or not isinstance(self._settings.sut, str | None)
        workers = Workers(1 if alone else self._processes)
        with results(partial(_measured, self._settings), tasks, workers) as found:
            answers = iter([*found])
        for chunk, is_asked in zip(chunks, asked, strict=True):
            if isinstance(chunk, Outcome):
                yield chunk
            elif is_asked:
                yield from self._sort(chunk, next(answers))
            else:
                yield from chunk

    def _sort(self, jobs: list[Job], answer: _Answer) -> Iterator[Job | Outcome]:
        """Tell sets that passed in arrays from those that are left to the interpreter."""
        path = jobs[0].scenario
        self._failing |= answer.failing
        if answer.single and path not in self._single:
            self._single.add(path)
            # Faults of a file are told by its runs: only elements without arrays are told here.
            if answer.reason:
                self._tell(f"{path}: not in arrays: {answer.reason}")
        rows = []
        for number, job in enumerate(jobs):
            row = answer.rows.get(number)
            if row is None:
                yield job
                continue
            rows.append({"run": job.name, "parameters": list(job.parameters.items()), **row})
            state = row["outcome"]
            if state == PASSED:
                yield from self._pass(job, row)
                continue
            self._failed += state == FAILED
            self._left[job.name] = _EndInArrays(state, row["status"], row["end_time"])
            yield job
        self._write(rows)

    def _pass(self, job: Job, row: dict[str, Any]) -> Iterator[Outcome]:
        self._passed += 1
        measures = {name: row[name] for name in ("min_ttc", "min_distance", "max_drac")}
        # On SUMO the run might have ended otherwise: the verdict's line says so.
        message = "" if self._settings.world == "kinematic" else IN_ARRAYS
        code, status, end = CODES[PASSED], row["status"], row["end_time"]
        outcome = Outcome(job, PASSED, code, message, status, end, measures)
        distance = row["min_distance"]
        if distance is None:
            yield outcome
            return
        # By the number of passes, since outcomes of equal distance have no order.
        heappush(self._near, (-distance, self._passed, outcome))
        if len(self._near) > NEAREST:
            yield heappop(self._near)[2]

    def _write(self, rows: list[dict[str, Any]]) -> None:
        if self._out is None or not rows:
            return
        import pyarrow as pa
        import pyarrow.parquet as pq

        text, number = pa.string(), pa.float64()
        schema = pa.schema(
            {"run": text, "parameters": pa.map_(text, text)}
            | {name: text if name in _TEXTS else number for name in _COLUMNS}
        )
        if self._writer is None:
            self._out.mkdir(parents=True, exist_ok=True)
            self._writer = pq.ParquetWriter(self._out / SETS, schema)
        self._writer.write_table(pa.Table.from_pylist(rows, schema))


class _EndInArrays(NamedTuple):
    """Outcome, status and end (s) of a set in arrays."""

    state: str
    status: str
    end_time: float


class _Answer(NamedTuple):
    """Columns of the sets of a chunk that were played in arrays, by their numbers; whether its
    scenario is to be played in single runs only, the reason, and whether that is a failure of the
    system under test."""

    rows: dict[int, dict[str, Any]]
    single: bool = False
    reason: str = ""
    failing: bool = False


def _measured(settings: RunSettings, jobs: list[Job]) -> _Answer:
    """Play jobs of one scenario and seed in arrays."""
    path, seed = jobs[0].scenario, jobs[0].seed
    settings = settings if seed is None else replace(settings, seed=seed)
    known: dict[int, dict[str, Any]] = {}
    try:
        # A limit ends a process: here it would end those of all sets.
        if current().bounded:
            raise NotInArrays("runs with limits of memory or time are in processes of their own")
        for structure in structures(path, [job.parameters for job in jobs], settings):
            for block in play(structure, settings, Measuring(parameter_set("ad-rss"))):
                measures = block.outcomes.measures
                assert measures is not None
                known |= {
                    number: _measures(block.outcomes, measures, at)
                    for at, number in enumerate(block.members.tolist())
                }
    except (NotInArrays, Unsupported) as error:
        return _Answer(known, True, str(error))
    except SystemUnderTestError as error:  # single runs ask another method of it, which may work
        return _Answer(known, True, str(error), True)
    except ToolchainError:  # the interpreter names what is wrong with which set
        return _Answer(known, True)
    return _Answer(known)


def _chunks(jobs: Iterable[Job | Outcome], size: int) -> Iterator[list[Job] | Outcome]:
    """Consecutive jobs of one scenario and seed with the same parameters, `size` at most, and
    outcomes as they are."""
    chunk: list[Job] = []
    for job in jobs:
        if isinstance(job, Outcome):
            if chunk:
                yield chunk
            chunk = []
            yield job
            continue
        if chunk and (len(chunk) >= size or _kind(job) != _kind(chunk[0])):
            yield chunk
            chunk = []
        chunk.append(job)
    if chunk:
        yield chunk


def _kind(job: Job) -> tuple[Path, Path, int | None, frozenset[str]]:
    return job.source, job.scenario, job.seed, frozenset(job.parameters)


def _measures(outcomes: ArrayOutcomes, measured: RunMeasures, at: int) -> dict[str, Any]:
    """Columns of a run in `sets.parquet`."""
    measures: dict[str, Any] = {
        **dict.fromkeys(_COLUMNS),
        **{name: str(getattr(outcomes, name)[at]) for name in _TEXTS},
        "end_time": float(outcomes.end_time[at]),
        "contact": float(outcomes.contact[at]),
    }
    if measures["outcome"] == OPEN:
        return measures
    # Tables have null, not infinity, where a measure has no value.
    least, ttc = float(measured.min_distance[at]), float(measured.min_ttc[at])
    measures["min_ttc"] = ttc if ttc < math.inf else None
    measures["max_drac"] = float(measured.max_drac[at]) or None
    if least < math.inf:
        measures["min_distance"], measures["risk"] = least, float(measured.risk[at])
    return measures


@contextmanager
def _run(
    structure: CompiledSets,
    sets: IntArray,
    settings: RunSettings,
    measuring: Measuring | None = None,
    keeps: bool = False,
) -> Iterator[tuple[ArraySimulation, ArrayJudge]]:
    """The runs of some sets; the system under test is closed after them."""
    scenario = structure.scenario
    least = least_values(settings.least)
    reserve, defined = least.pop("reserve", 1.0), least.pop("limits", ROWS["limits"].least)
    # Other evidence needs logs of single runs.
    if least:
        raise NotInArrays("least values of evidence are judged in single runs only")
    limits = settings.limits
    if limits and measuring is None:
        measuring = Measuring(parameter_set("ad-rss"))
    ego = find_ego(scenario, settings.ego)
    if ego is None:
        raise NotInArrays("a scenario without an ego plays in single runs only")
    system = open_arrays(settings.sut, settings.sut_in_process, settings.sut_timeout)
    with closing(system) if system is not None else nullcontext():
        driver = (
            ArraySystemDriver(system, scenario, ego, len(sets), settings.timestep, settings.seed)
            if system is not None
            else None
        )
        judge = ArrayJudge(
            scenario,
            sets,
            system is not None,
            reserve,
            measuring,
            keeps or _needs_instants(settings),
            limits,
            defined,
        )
        after = round(_AFTER_COLLISION / settings.timestep)
        run = ArraySimulation(
            scenario,
            sets,
            settings.timestep,
            settings.seed,
            ego.name,
            driver,
            # Steps as in `Session`: the slack keeps the last one of a limit that is a multiple.
            int(settings.max_time / settings.timestep + 1e-6),
            after if settings.ends_after_collision else None,
            judge,
        )
        yield run, judge
