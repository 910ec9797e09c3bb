"""Catalogues: finding the entry that a CatalogReference names.

Source: OpenSCENARIO XML 1.3.1, sections 9.4 to 9.6: in the directories that CatalogLocations gives for the kind of element,
every catalogue file counts; a catalogue is known by its name. Only where none has that name, the one whose file is called
so is taken: some public libraries rely on it.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from lxml import etree

from schemas.errors import ToolchainError
from schemas.values import quoted
from xosc.document import load, stamp
from xosc.node import Node
from xosc.parameters import nearest

ENTITIES = ("Vehicle", "Pedestrian", "MiscObject")
KINDS = (*ENTITIES, "Controller", "Environment", "Maneuver", "Trajectory", "Route")
"""The kinds of entries; each has its directory in CatalogLocations, VehicleCatalog and so on."""

EXPECTED: dict[str, tuple[str, ...]] = {
    "ScenarioObject": ENTITIES,
    "ScenarioObjectTemplate": ENTITIES,
    "Trailer": ENTITIES,
    "ObjectController": ("Controller",),
    "AssignControllerAction": ("Controller",),
    "ControllerDistributionEntry": ("Controller",),
    "EnvironmentAction": ("Environment",),
    "ManeuverGroup": ("Maneuver",),
    "FollowTrajectoryAction": ("Trajectory",),
    "TrajectoryRef": ("Trajectory",),
    "AssignRouteAction": ("Route",),
    "RouteRef": ("Route",),
}
"""Kinds of entries that a CatalogReference may stand for, by the element that holds it."""


@dataclass(frozen=True, eq=False)
class Entry:
    """An element of a catalogue, to be copied where it is used.

    Attributes:
        kind: its element name, one of `KINDS`.
        name: its name.
        element: the element.
        path: the catalogue's file.
        version: the catalogue's version of the standard.
        size: number of elements in it.
    """

    kind: str
    name: str
    element: etree._Element
    path: str
    version: tuple[int, int]
    size: int

    def __str__(self) -> str:
        return f"{self.kind} {self.name!r} ({self.path}:{self.element.sourceline})"


@dataclass(frozen=True, eq=False)
class _Catalog:
    name: str
    path: str
    entries: tuple[Entry, ...]


class Catalogs:
    """The catalogues that a scenario can refer to, read when something from them is needed.

    Args:
        scenario: root of a document whose attributes are literals.
    """

    def __init__(self, scenario: Node) -> None:
        locations = scenario.find("CatalogLocations")
        self._scenario = scenario.path
        self._known: dict[tuple[str, ...], tuple[list[_Catalog], list[str]]] = {}
        self._locations = {node.tag: node for node in locations.children()} if locations else {}

    def find(self, reference: Node) -> Entry:
        """The entry that a CatalogReference, whose attributes are literals, stands for.

        Raises:
            InvalidFile: there is none, or more than one; or the reference stands where none is allowed.
        """
        kinds = _expected(reference)
        catalog_name, entry_name = reference.get("catalogName"), reference.get("entryName")
        if kinds not in self._known:
            self._known[kinds] = self._read(kinds)
        found, problems = self._known[kinds]
        named = [catalog for catalog in found if catalog.name == catalog_name]
        named = named or [catalog for catalog in found if Path(catalog.path).stem == catalog_name]
        if not named:
            hint = nearest(catalog_name, sorted({catalog.name for catalog in found}))
            raise reference.invalid("; ".join([f"there is no catalogue {quoted(catalog_name)}, {hint}", *problems]))
        entries = [entry for catalog in named for entry in catalog.entries if entry.kind in kinds]
        matching = [entry for entry in entries if entry.name == entry_name]
        if len(matching) > 1:
            raise reference.invalid(f"more than one entry is meant: {' and '.join(map(str, matching))}")
        if not matching:
            kind = " or ".join(kinds)
            hint = nearest(entry_name, [entry.name for entry in entries])
            raise reference.invalid(f"the catalogue {quoted(catalog_name)} has no {kind} {quoted(entry_name)}, {hint}")
        return matching[0]

    def _read(self, kinds: tuple[str, ...]) -> tuple[list[_Catalog], list[str]]:
        """Catalogues in the directories for these kinds, and what kept others from being read."""
        locations = [self._locations[f"{kind}Catalog"] for kind in kinds if f"{kind}Catalog" in self._locations]
        files: dict[str, None] = {}
        problems = [] if locations else [f"CatalogLocations has no {' or '.join(f'{kind}Catalog' for kind in kinds)}"]
        for location in locations:
            directory = location.need("Directory")
            path = file_reference(directory, "path")
            try:
                files.update(dict.fromkeys(catalog_files(path, self._scenario)))
            except (OSError, ValueError):
                problems.append(f"the directory {path} ({directory.where}) does not exist or cannot be read")
        results = [_catalog(file, stamp(file)) for file in files]
        problems += [f"not readable: {result}" for result in results if isinstance(result, str)]
        return [result for result in results if isinstance(result, _Catalog)], problems


def file_reference(node: Node, attribute: str) -> Path:
    """A path attribute as a path; a relative one starts at the folder of the file that it stands in."""
    return node.path.parent / node.get(attribute).replace("\\", "/")


def _expected(reference: Node) -> tuple[str, ...]:
    parent = reference.element.getparent()
    place = str(parent.tag) if parent is not None else "the root"
    if place not in EXPECTED:
        raise reference.invalid(f"no catalogue entry can stand in {place}")
    return EXPECTED[place]


def catalog_files(path: Path, scenario: Path) -> list[str]:
    """Files of a catalogue directory, sorted; a path that is a file itself, as some scenarios have it, gives that file.

    Libraries get moved about: a directory that does not exist is looked for by its name in the scenario's folder and in
    the folders in that.
    """
    if path.is_file():
        return [os.path.normpath(path)]
    if not path.exists():
        name = os.path.basename(os.path.normpath(path))
        places = [scenario.parent, *sorted(scenario.parent.iterdir())]
        path = next((place / name for place in places if (place / name).is_dir()), path)
    return sorted(os.path.normpath(entry.path) for entry in os.scandir(path) if entry.name.lower().endswith(".xosc"))


@lru_cache(maxsize=256)
def _catalog(path: str, _: tuple[int, int]) -> _Catalog | str | None:
    """The catalogue in a file, None where the file is something else, and the reason where it can't be read."""
    try:
        document = load(path)
    except ToolchainError as error:
        return str(error)
    catalog = document.root.find("Catalog")
    if catalog is None:
        return None
    entries = tuple(
        Entry(str(child.tag), child.get("name", ""), child, path, document.version, sum(1 for _ in child.iter()))
        for child in catalog.iterchildren(*KINDS)
    )
    return _Catalog(catalog.get("name", ""), path, entries)
