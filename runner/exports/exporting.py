"""Exports done one after the other: of documents as they are, of runs after running them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from runner.batch.jobs import Outcome, assumed, jobs_of
from runner.settings import RunSettings
from schemas.errors import ToolchainError, describe
from xosc.distributions.selection import Selection
from xosc.document import load
from xosc.exports.draft import ExportSettings, roads_in

if TYPE_CHECKING:
    from runner.exports import Target
    from xosc.exports.folder import Folder


class Exported(NamedTuple):
    """How one export ended.

    name: the file, or the name of the run. exit_code: 0 for exported, otherwise that of the error. remarks: what is
    changed or left out; the reason where it is not exported.
    """

    name: str
    exit_code: int
    remarks: Sequence[str] = ()


def export_documents(
    sources: Sequence[Path],
    target: Target,
    folder: Folder,
    settings: RunSettings | None = None,
    selection: Selection | None = None,
) -> Iterator[Exported]:
    """Export files as they are. What is wrong with one of them is told, the others go on.

    Args:
        settings: of them, what says how files are read; None for the defaults.
        selection: parameter sets of distributions; None for all.
    """
    module = import_module(target.module)
    chosen = _export_settings(settings or RunSettings(), selection or Selection())
    for source in sources:
        try:
            yield Exported(str(source), 0, module.export(source, target.name, folder, chosen))
        except (ToolchainError, OSError) as error:
            yield _refused(str(source), error)


def _export_settings(settings: RunSettings, selection: Selection) -> ExportSettings:
    from runner.exports.geometry import RunnerGeometry
    from runner.interpreter.roads import made_roads

    made = partial(made_roads, catalog_path=settings.catalog_path, enforce_constraints=settings.enforce_constraints)
    roads = made if settings.road == "auto" else roads_in(*settings.road_path)
    locate = None if settings.strict else partial(RunnerGeometry, settings=settings)
    return ExportSettings(settings.strict, roads, locate, settings.catalog_path, selection, settings.enforce_constraints)


def export_runs(
    sources: Sequence[Path],
    target: Target,
    folder: Folder,
    settings: RunSettings,
    parameters: Mapping[str, str],
    selection: Selection | None = None,
) -> Iterator[Exported]:
    """Run files, distributions with every chosen set of parameters, and export the runs. Failed verdicts are runs as well."""
    from runner.interpreter.execution import run

    module = import_module(target.module)
    for job in jobs_of(_runnable(sources), dict(parameters), settings.enforce_constraints, selection):
        if isinstance(job, Outcome):
            yield Exported(job.job.name, job.exit_code, [job.message])
            continue
        try:
            assumed(job, settings.strict)
            result = run(job.scenario, settings, parameters=job.parameters)
            yield Exported(job.name, 0, module.export(result, job.name, folder))
        except (ToolchainError, OSError) as error:
            yield _refused(job.name, error)


def _runnable(sources: Sequence[Path]) -> Iterator[Path]:
    """The sources without catalogues, whose entries are part of the scenarios that use them."""
    for source in sources:
        try:
            if load(source).kind == "catalog":
                continue
        except ToolchainError:
            pass  # it is told when it is to be run
        yield source


def _refused(name: str, error: Exception) -> Exported:
    message, code = describe(error)
    return Exported(name, code, [message])
