"""Exports of several files: of documents as they are, of runs after running them."""

from __future__ import annotations

import traceback
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from runner.batch.jobs import Job, Outcome, assumed, jobs_of
from runner.judging.result import INCONCLUSIVE
from runner.judging.settings import RunSettings
from schemas.common.errors import ExitCode, ToolchainError, describe
from schemas.common.policy import limited
from xosc.distributions.space import Selection
from xosc.document import load
from xosc.exports.draft import ExportSettings, Roads, roads_in

if TYPE_CHECKING:
    from runner.exchange.exports import ExportTarget
    from runner.judging.result import RunResult
    from xosc.exports.draft import Folder


_MOST_FAULTS = 3
"""Errors of an exported file that are told; `xosc-check` tells all."""


class Exported(NamedTuple):
    """Outcome of one export.

    name: the file, or the name of the run. exit_code: 0 for exported, 6 for an exported run that is
    inconclusive, otherwise that of the error. remarks: what was assumed, is changed or left out;
    the reason where it is not exported. trace: traceback of an internal error. untested: why the
    run is inconclusive.
    """

    name: str
    exit_code: int
    remarks: Sequence[str] = ()
    trace: str = ""
    untested: Sequence[str] = ()


def export_documents(
    sources: Sequence[Path],
    target: ExportTarget,
    folder: Folder,
    settings: RunSettings | None = None,
    selection: Selection | None = None,
) -> Iterator[Exported]:
    """Export files as they are; a faulty file is reported and does not stop the others.

    Args:
        settings: of them, what says how files are read; None for the defaults.
        selection: parameter sets of distributions; None for all.
    """
    module = import_module(target.module)
    chosen = _export_settings(settings or RunSettings(), selection or Selection())
    for source in sources:
        try:
            with limited():
                before = len(folder.produced)
                remarks = module.export(source, target.name, folder, chosen)
                faults = _faults(folder, list(folder.produced)[before:])
            yield Exported(str(source), 0, [*remarks, *faults])
        except Exception as error:  # a defect of ours is reported too, the other files go on
            yield _refused(str(source), error)


def _faults(folder: Folder, names: Iterable[str]) -> Iterator[str]:
    """Errors that a check finds in files of an export: they come from their sources, since no
    repair has one sensible meaning for them."""
    from schemas.checks.checker import check

    for name in names:
        if not name.endswith((".xosc", ".xodr")):
            continue
        errors = [problem for problem in check(folder.path / name) if problem.level == "error"]
        if errors:
            lines: dict[str, int | None] = {}
            for problem in errors:
                lines.setdefault(problem.message, problem.line)
            told = [f"{line}: {text}" if line else text for text, line in lines.items()]
            more = f"; and {len(told) - _MOST_FAULTS} others" if len(told) > _MOST_FAULTS else ""
            count = "1 error stays" if len(errors) == 1 else f"{len(errors)} errors stay"
            yield f"{name}: {count}, as xosc-check says: {'; '.join(told[:_MOST_FAULTS])}{more}"


def _export_settings(settings: RunSettings, selection: Selection) -> ExportSettings:
    from runner.engine.compile.road_network import roads_for
    from runner.exchange.exports.geometry import RunnerGeometry

    roads: Roads = roads_in(*settings.road_path)
    if settings.road is not None:
        roads = partial(
            roads_for,
            road=settings.road,
            road_path=settings.road_path,
            catalog_path=settings.catalog_path,
            enforce_constraints=settings.enforce_constraints,
        )
    locate = None if settings.strict else partial(RunnerGeometry, settings=settings)
    return ExportSettings(
        settings.strict,
        roads,
        locate,
        settings.catalog_path,
        selection,
        settings.enforce_constraints,
    )


def export_runs(
    sources: Sequence[Path],
    target: ExportTarget,
    folder: Folder,
    settings: RunSettings,
    parameters: Mapping[str, str],
    selection: Selection | None = None,
) -> Iterator[Exported]:
    """Run files, distributions with every chosen set of parameters, and export the runs. Failed
    verdicts are runs as well."""
    jobs = jobs_of(_runnable(sources), dict(parameters), settings.enforce_constraints, selection)
    yield from export_jobs(jobs, target, folder, settings)


def export_jobs(
    jobs: Iterable[Job | Outcome], target: ExportTarget, folder: Folder, settings: RunSettings
) -> Iterator[Exported]:
    """Run jobs, and export the runs."""
    from runner.judging.execution import run

    module = import_module(target.module)
    for job in jobs:
        if isinstance(job, Outcome):
            yield Exported(job.job.name, job.exit_code, [job.message])
            continue
        try:
            assumptions = assumed(job, settings.strict)
            with limited():
                result = run(job.scenario, settings, parameters=job.parameters)
                result.assume(assumptions)
                remarks = module.export(result, job.name, folder)
            yield _exported(job.name, result, remarks)
        except Exception as error:  # a defect of ours is reported too, the other files go on
            yield _refused(job.name, error)


def _runnable(sources: Sequence[Path]) -> Iterator[Path]:
    """Sources without catalogues; entries of these are part of the scenarios that use them."""
    for source in sources:
        try:
            if load(source).kind == "catalog":
                continue
        except ToolchainError:
            pass  # reported when it is run
        yield source


def _exported(name: str, result: RunResult, remarks: Sequence[str]) -> Exported:
    untested = result.verdict.reasons if result.verdict.outcome == INCONCLUSIVE else ()
    # What makes a run inconclusive is told as that, not twice.
    assumptions = [remark for remark in result.remarks if remark not in untested]
    code = ExitCode.INCONCLUSIVE if untested else ExitCode.PASSED
    return Exported(name, code, [*assumptions, *remarks], untested=untested)


def _refused(name: str, error: Exception) -> Exported:
    message, code = describe(error)
    trace = "".join(traceback.format_exception(error)) if code == ExitCode.INTERNAL else ""
    return Exported(name, code, [message], trace)
