"""Digests of everything that decides the result of a run: a finished run is valid while none of it
changes."""

from __future__ import annotations

import copy
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from functools import cache, lru_cache
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from types import MappingProxyType
from typing import Any

import xosc
from runner.batch.jobs import Job
from runner.judging.settings import MADE, RunSettings
from runner.systems import code_of, find_system, system_name
from runner.systems.base import parameters_of, split
from schemas.catalogs import locate
from schemas.common.errors import InvalidFile, ToolchainError, UsageError
from schemas.common.storage import Stamp, fingerprint, read_bytes, stamp
from schemas.expressions import ExpressionError
from xosc.document.node import Node
from xosc.document.road_files import find_roads
from xosc.resolve.parameters import Assignment, ParameterScope

OURS = ("schemas", "xosc", "xodr", "runner")
"""Packages whose code plays and measures runs"""
_PATHS = {"LogicFile": "filepath", "Directory": "path"}
"""Elements that name roads and catalogues, and the attribute that does"""
_LIBRARIES = ("numpy", "libsumo", "eclipse-sumo")


def of_batch(run: RunSettings) -> str:
    """Return the digest of the shared part of a batch: settings, code of the toolchain, its
    libraries, the system under test.

    Raises:
        UsageError: the system under test is unknown.
    """
    return fingerprint(repr((run.as_json(), _system(run), program(OURS))).encode())


def of_job(job: Job, run: RunSettings, shared: str) -> str:
    """Digest of everything that decides the result of a run.

    A file that is missing or damaged decides too: the run says so, until the file is another.

    Args:
        run: the settings of the batch.
        shared: what `of_batch` gives.
    """
    source = _by_stamp(job.source, stamp(job.source))
    values = job.name, sorted(job.parameters.items()), job.seed
    parts = shared, source, *values, content_of(job, run)
    return fingerprint(repr(parts).encode())


def content_of(job: Job, run: RunSettings) -> str:
    """Digest of the files of a job: scenario, road network and catalogues; of a distribution it has
    the values."""
    return fingerprint(repr(_files_of(job, run)).encode())


def _files_of(job: Job, run: RunSettings) -> tuple[list[str], str]:
    """Digests of the scenario and the files that it refers to, and their faults."""
    try:
        # A missing file decides, too: the run is repeated once it is there.
        paths, lack = _referred_by(job.scenario, run, job.parameters)
    except ToolchainError as error:
        paths, lack = (), error
    given = [] if run.road in (None, MADE) else [Path(str(run.road))]
    return [_by_stamp(path, stamp(path)) for path in (job.scenario, *paths, *given)], str(lack)


@lru_cache(maxsize=4096)
def _by_stamp(path: Path, _: Stamp) -> str:
    """Digest of a file that is read again where it has changed; empty where it can't be read."""
    try:
        return fingerprint(read_bytes(path))
    except InvalidFile:
        return ""


def inputs(
    scenario: Path,
    run: RunSettings,
    pinned: Mapping[str, str] = MappingProxyType({}),
    packages: tuple[str, ...] = OURS,
) -> dict[str, Any]:
    """Digests of files and code, settings and versions, by subject.

    Args:
        pinned: values of parameters that are the same in all runs: a path may be one.
        packages: those whose code decides.

    Raises:
        InvalidFile: the scenario, or a file that it refers to, is malformed.
        UsageError: there is no such system under test.
    """
    return {
        **files(scenario, run, pinned),
        "system": _system(run),
        "settings": {name: value for name, value in run.as_json().items() if name != "sut"},
        "program": program(packages),
    }


def _system(run: RunSettings) -> list[Any]:
    """Name of the system under test, parameters of one that is given as such, its code, and files
    that parameters name."""
    given = split(run.sut)[1].values() if isinstance(run.sut, str) else ()
    # Parameters may name files, as that of an FMU or of a model's weights.
    files = [fingerprint(path.read_bytes()) for path in map(Path, given) if os.path.isfile(path)]
    parameters = {} if isinstance(run.sut, str | None) else parameters_of(run.sut)
    return [system_name(run.sut), parameters, plugged_in(run), files]


@cache
def program(packages: tuple[str, ...]) -> str:
    """Digest of code of ours, and the versions of the libraries that it runs on."""
    versions = [f"{name} {version(name)}" for name in _LIBRARIES]
    return fingerprint("\n".join([*map(_content, packages), *versions]).encode())


def files(
    scenario: Path, run: RunSettings, pinned: Mapping[str, str] = MappingProxyType({})
) -> dict[str, Any]:
    """Digests of a scenario, its road network and its catalogues.

    Raises:
        InvalidFile: one of them is malformed, or there is no such road network.
    """
    return {
        "scenario": fingerprint(scenario.read_bytes()),
        "roads and catalogues": {
            path.name: fingerprint(path.read_bytes()) for path in referred_by(scenario, run, pinned)
        },
    }


def referred_by(scenario: Path, run: RunSettings, given: Mapping[str, str]) -> tuple[Path, ...]:
    """The road network and the catalogues of a scenario; where a path has no value, or is nowhere,
    every run says so itself.

    Raises:
        InvalidFile: the scenario is malformed, or there is no such road network.
    """
    found, lack = _referred_by(scenario, run, given)
    if lack is not None:
        raise lack
    return found


_Referred = tuple[tuple[Path, ...], ToolchainError | None]
"""Files, and the error of a road network that is nowhere"""


def _referred_by(scenario: Path, run: RunSettings, given: Mapping[str, str]) -> _Referred:
    root = xosc.load(scenario, strict=run.strict).node.element
    # Paths that are constant do not need the values: one entry serves all sets.
    varies = any(
        "$" in element.get(attribute, "")
        for name, attribute in _PATHS.items()
        for element in root.iter(name)
    )
    values = tuple(sorted(given.items())) if varies else ()
    asked = scenario, stamp(scenario), run.strict, run.road_path, run.catalog_path, values
    found, lack = _referred(*asked)
    # The stamp is the scenario's: files that it refers to may have come or gone.
    if lack is None and all(map(os.path.isfile, found)):
        return found, None
    return _referred.__wrapped__(*asked)  # a file was removed or added since


@lru_cache(maxsize=256)
def _referred(
    scenario: Path,
    _: Stamp,
    strict: bool,
    road_path: tuple[str, ...],
    catalog_path: tuple[str, ...],
    given: tuple[tuple[str, str], ...],
) -> _Referred:
    root = _with_paths(xosc.load(scenario, strict=strict).node, dict(given))
    found, lack = list[Path](), None
    road = root.find("RoadNetwork", "LogicFile")
    if road is not None and road.get("filepath").strip() and "$" not in road.get("filepath"):
        try:
            found.append(find_roads(road, road_path).path)
        except ToolchainError as error:  # with --road it is none
            lack = error
    locations = root.find("CatalogLocations")
    for location in locations.children() if locations is not None else ():
        directory = location.need("Directory")
        with suppress(OSError, ValueError):
            found += sorted(
                Path(file) for file in locate(directory.file("path"), scenario, catalog_path).files
            )
    return tuple(found), lack


def _with_paths(root: Node, pinned: Mapping[str, str]) -> Node:
    """Copy of a scenario with literal paths of roads and catalogues."""
    # `xosc.load` shares documents: the one here must stay as it is.
    root = Node(copy.deepcopy(root.element), root.path)
    holder = root.find("ParameterDeclarations")
    assigned = {name: Assignment(value, UsageError, True) for name, value in pinned.items()}
    scope = ParameterScope(
        holder.children("ParameterDeclaration") if holder is not None else [], assigned=assigned
    )
    for name, attribute in _PATHS.items():
        for element in root.element.iter(name):
            with suppress(ExpressionError):
                element.set(attribute, scope.literal(element.get(attribute, "")))
    return root


def plugged_in(run: RunSettings) -> str:
    """Digest of the code of a system under test that is none of ours: of all modules of its
    package, or of the files it names."""
    if (
        isinstance(run.sut, str)
        and (origin := code_of(run.sut, run.sut_in_process, run.sut_timeout)) is not None
    ):
        own = [*_files(origin.origin, origin.folders)]
        return _digest_of([*own, *(Path(file) for file in origin.imports)])
    # Systems of ours name the files that decide; of a plug-in the whole package counts.
    made = find_system(run.sut) if isinstance(run.sut, str | None) else type(run.sut)
    factory = getattr(made, "func", made)
    package = str(getattr(factory, "__module__", "")).partition(".")[0]
    named: Callable[..., tuple[Path, ...]] | None = (
        getattr(factory, "files", None) if package == "runner" else None
    )
    if named is not None:
        return fingerprint(
            b"\0".join(path.read_bytes() for path in named(**getattr(made, "keywords", {})))
        )
    return "" if package in ("", "builtins", "runner", "generation") else _content(package)


def _content(package: str) -> str:
    """Digest of all files of a package, or of a module."""
    spec = import_module(
        package
    ).__spec__  # it is imported already, perhaps from the working folder
    return (
        _digest_of(_files(spec.origin or "", spec.submodule_search_locations or ()))
        if spec is not None
        else _digest_of(())
    )


def _digest_of(files: Iterable[Path]) -> str:
    # Names too: two files that exchange their contents are another program.
    return fingerprint(b"\0".join(str(path.name).encode() + path.read_bytes() for path in files))


def _files(origin: str, folders: Iterable[str]) -> Iterator[Path]:
    """Files of a package, with packages inside it, or the file of a module."""
    files = [Path(folder) for folder in folders]
    if files:
        inside = (path for folder in files for path in folder.rglob("*"))
        yield from sorted(path for path in inside if path.suffix in _DECIDING and path.is_file())
    elif os.path.isfile(origin):
        yield Path(origin)


_DECIDING = (
    ".py",
    ".so",
    ".json",
    ".safetensors",
    ".npz",
    ".onnx",
    ".pt",
    ".yaml",
    ".toml",
    ".txt",
    ".csv",
)
"""Endings of files that code, or weights and settings of a system, are in"""
