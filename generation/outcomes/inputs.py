"""All that decides what a run gives, by content: runs are remembered as long as none of it changes."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping
from contextlib import suppress
from functools import cache
from importlib.machinery import PathFinder
from importlib.metadata import version
from pathlib import Path
from types import MappingProxyType
from typing import Any

import xosc
from runner.settings import RunSettings
from runner.sut import find_system, load_system, system_name
from runner.sut.parameters import parameters_of
from schemas.catalogs import locate
from schemas.errors import UsageError
from schemas.expressions import ExpressionError
from schemas.storage import digest
from xosc.node import Node
from xosc.parameters import Assignment, Scope
from xosc.roads import find_roads

_OURS = ("schemas", "xosc", "xodr", "runner", "generation.outcomes")
"""Packages whose code plays and measures runs"""
_LIBRARIES = ("numpy", "libsumo", "eclipse-sumo")


def inputs(scenario: Path, run: RunSettings, rss: str, pinned: Mapping[str, str] = MappingProxyType({})) -> dict[str, Any]:
    """Digests of files and code, settings and versions, by what they are of.

    Args:
        rss: name of the RSS parameter set.
        pinned: values of parameters that are the same in all runs: a path may be one.

    Raises:
        InvalidFile: the scenario, or a file that it refers to, is malformed.
        UsageError: there is no such system under test.
    """
    return {
        **files(scenario, run, pinned),
        "system": [system_name(run.sut), parameters_of(load_system(run.sut)), plugged_in(run)],
        "settings": {name: value for name, value in run.as_json().items() if name != "sut"} | {"rss": rss},
        "toolchain": _code(_OURS),
        "versions": {name: version(name) for name in _LIBRARIES},
    }


def files(scenario: Path, run: RunSettings, pinned: Mapping[str, str] = MappingProxyType({})) -> dict[str, Any]:
    """Digests of a scenario, its road network and its catalogues.

    Raises:
        InvalidFile: one of them is malformed, or there is no such road network.
    """
    return {
        "scenario": digest(scenario.read_bytes()),
        "roads and catalogues": {path.name: digest(path.read_bytes()) for path in _referred(scenario, run, pinned)},
    }


def _referred(scenario: Path, run: RunSettings, pinned: Mapping[str, str]) -> Iterator[Path]:
    """The road network and the catalogues of a scenario; where a path has no value, or is nowhere, every run says so itself."""
    root = _with_paths(xosc.load(scenario, strict=run.strict).node, pinned)
    road = root.find("RoadNetwork", "LogicFile")
    if road is not None and road.get("filepath").strip() and "$" not in road.get("filepath"):
        yield find_roads(road, run.road_path).path
    locations = root.find("CatalogLocations")
    for location in locations.children() if locations is not None else ():
        directory = location.need("Directory")
        with suppress(OSError, ValueError):
            yield from sorted(Path(file) for file in locate(directory.file("path"), scenario, run.catalog_path).files)


def _with_paths(root: Node, pinned: Mapping[str, str]) -> Node:
    """A copy of a scenario in which parameters and expressions in the paths of roads and catalogues are worked out."""
    root = Node(copy.deepcopy(root.element), root.path)
    holder = root.find("ParameterDeclarations")
    assigned = {name: Assignment(value, UsageError, True) for name, value in pinned.items()}
    scope = Scope(holder.children("ParameterDeclaration") if holder is not None else [], assigned=assigned)
    for name, attribute in (("LogicFile", "filepath"), ("Directory", "path")):
        for element in root.element.iter(name):
            with suppress(ExpressionError):
                element.set(attribute, scope.literal(element.get(attribute, "")))
    return root


def plugged_in(run: RunSettings) -> str:
    """Digest of the code of a system under test that is none of ours: of all modules of its package."""
    made = find_system(run.sut) if isinstance(run.sut, str | None) else type(run.sut)
    factory = getattr(made, "func", made)
    package = str(getattr(factory, "__module__", "")).partition(".")[0]
    return "" if package in ("", "builtins", "runner", "generation") else _content(package)


@cache
def _code(packages: tuple[str, ...]) -> str:
    return digest("".join(_content(each) for each in packages).encode())


def _content(package: str) -> str:
    """Digest of all files of a package, or of a module."""
    return digest(b"\0".join(str(path.name).encode() + path.read_bytes() for path in _files(package)))


def _files(package: str) -> Iterator[Path]:
    """Its Python files, those of packages inside it included."""
    where: list[str] | None = None
    for part in package.split("."):
        spec = PathFinder.find_spec(part, where)
        where = list(spec.submodule_search_locations or []) if spec is not None else []
    folders = [Path(each) for each in where or []]
    if folders:
        yield from sorted(path for folder in folders for path in folder.rglob("*") if path.suffix in _DECIDING and path.is_file())
    elif spec is not None and spec.origin:
        yield Path(spec.origin)


_DECIDING = (".py", ".so", ".json", ".safetensors", ".npz", ".onnx", ".pt", ".yaml", ".toml", ".txt", ".csv")
"""Endings of files that code, or weights and settings of a system, are in"""
