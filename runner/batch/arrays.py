"""Many parameter sets of one scenario played at once, in arrays, where all its elements can.

The structure is compiled once, numbers are arrays over sets; sets whose numbers change the
structure are compiled apart. What can't be played so is named, and is left to the interpreter.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import xosc
from runner.engine.compile.compiler import Scenario, compile_scenario
from runner.engine.compile.road_network import load_roads
from runner.engine.storyboard.batch_run import BatchSimulation
from runner.judging.criteria.criterion import declared
from runner.judging.evidence.batch import BatchJudge, BatchOutcomes
from runner.judging.settings import RunSettings
from runner.systems.batch_systems import open_batch
from runner.systems.drivers import BatchSystemDriver, find_ego
from schemas.common.array_types import IntArray
from schemas.common.errors import Unsupported
from schemas.expressions.columns import Columns, NotInArrays, NumberColumn, reading
from schemas.expressions.values import type_named

BLOCK = 1024
"""Sets that are played at a time: their states fit into the processor's caches"""
_AFTER_COLLISION = 1.0
"""Time that is played on after the ego's first contact, where that ends a run, s"""
_MOST_STRUCTURES = 32
"""Structures that are compiled for the sets of a scenario; sets beyond are played one by one"""
Sets = Sequence[Mapping[str, str]]


@dataclass(frozen=True, eq=False)
class CompiledSets:
    """A scenario compiled for the sets that have its structure.

    Args:
        scenario: compiled once; numbers that vary are columns over `members`.
        members: indices of the sets (k,).
    """

    scenario: Scenario
    members: IntArray


@dataclass(frozen=True, eq=False)
class Played:
    """Sets that were played at once.

    Args:
        members: indices of the sets (k,).
        outcomes: of these.
    """

    members: IntArray
    outcomes: BatchOutcomes


def structures(path: Path, sets: Sets, settings: RunSettings) -> Iterator[CompiledSets]:
    """Compile a scenario for parameter sets, all of which name the same parameters.

    Sets beyond the structures given have to be played one by one.

    Raises:
        NotInArrays: the scenario can't be compiled for many sets at once.
        ToolchainError: it can't be compiled.
    """
    document = xosc.load(path)
    doubles = _doubles(document)
    left: dict[tuple[tuple[str, str], ...], list[int]] = {}
    for number, values in enumerate(sets):
        key = tuple((name, text) for name, text in values.items() if name not in doubles)
        left.setdefault(key, []).append(number)
    pending = [(dict(key), np.array(members)) for key, members in left.items()]
    for _ in range(_MOST_STRUCTURES):
        if not pending:
            return
        fixed, members = pending.pop(0)
        found, alike = _compiled(document, path, fixed, [sets[each] for each in members], settings)
        yield CompiledSets(found, members[alike])
        if not alike.all():
            pending.append((fixed, members[~alike]))


def _doubles(document: Any) -> set[str]:
    declared = document.node.find("ParameterDeclarations")
    found = set()
    for each in declared.children() if declared is not None else ():
        try:
            if type_named(each.get("parameterType", "")) == "double":
                found.add(each.get("name"))
        except ValueError:
            continue
    return found


def _compiled(
    document: Any, path: Path, fixed: dict[str, str], sets: Sets, settings: RunSettings
) -> tuple[Scenario, Any]:
    values: dict[str, Any] = {}
    constant: dict[str, Any] = dict(fixed)
    for name in sets[0].keys() - fixed.keys():
        column = np.array([float(each[name]) for each in sets])
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
            if criteria := declared(resolved.node.need("Storyboard")):
                raise NotInArrays(f"{criteria[0].name}: criteria are judged in single runs only")
        except TypeError as error:  # a function of single numbers was given a column
            raise NotInArrays(f"a number that varies is used as a single one: {error}") from error
        return scenario, columns.alike


def obstacle(path: Path, settings: RunSettings, parameters: Mapping[str, Any] | None = None) -> str:
    """Return the reason for which a scenario does not play in arrays; empty where it does.

    Raises:
        ToolchainError: the scenario can't be compiled.
    """
    try:
        for structure in structures(path, [dict(parameters or {})], settings):
            _run(structure, np.zeros(1, np.int64), settings)
    except (NotInArrays, Unsupported) as error:
        return str(error)
    return ""


def play(structure: CompiledSets, settings: RunSettings) -> Iterator[Played]:
    """Play the sets of a structure, a block at a time.

    Raises:
        NotInArrays: an element, the system under test or a setting plays in single runs only.
    """
    count = len(structure.members)
    for start in range(0, count, BLOCK):
        sets = np.arange(start, min(start + BLOCK, count))
        run, judge = _run(structure, sets, settings)
        run.play()
        yield Played(structure.members[sets], judge.outcomes(run))


def _run(
    structure: CompiledSets, sets: IntArray, settings: RunSettings
) -> tuple[BatchSimulation, BatchJudge]:
    scenario = structure.scenario
    if settings.fail_if or settings.least:
        raise NotInArrays("limits of verdicts are judged in single runs only")
    ego = find_ego(scenario, settings.ego)
    if ego is None:
        raise NotInArrays("a scenario without an ego plays in single runs only")
    system = open_batch(settings.sut, settings.sut_in_process, settings.sut_timeout)
    driver = (
        BatchSystemDriver(system, scenario, ego, len(sets), settings.timestep, settings.seed)
        if system is not None
        else None
    )
    judge = BatchJudge(scenario, sets, system is not None)
    after = round(_AFTER_COLLISION / settings.timestep)
    run = BatchSimulation(
        scenario,
        sets,
        settings.timestep,
        settings.seed,
        ego.name,
        driver,
        int(settings.max_time / settings.timestep + 1e-6),
        after if settings.ends_after_collision else None,
        judge,
    )
    return run, judge
