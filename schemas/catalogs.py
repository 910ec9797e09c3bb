"""Catalogues: finding the entry that a CatalogReference names; the one look-up of checks and of
runs.

Source: OpenSCENARIO XML 1.3.1, sections 9.4 to 9.6: in the directories that CatalogLocations gives
for the kind of element, every catalogue file counts; a catalogue is known by its name. Several may
have one name: an entry is looked for in all of them. Only where none has that name, the one whose
file is called so is taken: some public libraries rely on it.
Directories that are not there are looked for in folders that were asked for.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from os import PathLike
from pathlib import Path
from typing import NamedTuple, Protocol
from urllib.parse import unquote

from lxml import etree

from schemas.common.errors import InvalidFile, ToolchainError, nearest
from schemas.common.policy import current
from schemas.common.remarks import Remark, Remarks
from schemas.common.storage import Stamp, above, in_any_case, search_path, stamp
from schemas.expressions.values import quoted

ENTITIES = ("Vehicle", "Pedestrian", "MiscObject")
KINDS = (
    *ENTITIES,
    "Controller",
    "Environment",
    "Maneuver",
    "Trajectory",
    "Route",
    "TrafficDistributionEntry",
)
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
    "TrafficDistribution": ("TrafficDistributionEntry",),
}
"""Kinds of entries that a CatalogReference may stand for, by the element that holds it."""

REFERENCES = ("CatalogReference", "CatalogReferences")
"""Names of the elements that refer to an entry; a TrafficDistribution has the plural for each of
its own."""


class Loaded(Protocol):
    """An OpenSCENARIO file that has been read: its root element and its version of the standard."""

    @property
    def root(self) -> etree._Element: ...
    @property
    def version(self) -> tuple[int, int]: ...


VARIABLE = "XOSC_CATALOG_PATH"
"""Environment variable with more folders of catalogues, separated as in PATH."""
Folders = Sequence[str | PathLike[str]]
Load = Callable[[str], Loaded]
"""Reads a catalogue's file; raises a ToolchainError where it can't."""


@dataclass(frozen=True, eq=False)
class CatalogEntry:
    """An element of a catalogue.

    Attributes:
        kind: its element name, one of `KINDS`.
        name: its name.
        element: the element.
        catalog: name of the catalogue.
        path: the catalogue's file.
        version: the catalogue's version of the standard.
        size: number of elements in it.
    """

    kind: str
    name: str
    element: etree._Element
    catalog: str
    path: str
    version: tuple[int, int]
    size: int

    def __str__(self) -> str:
        return f"{self.kind} {self.name!r} ({self.path}:{self.element.sourceline})"

    @cached_property
    def plain(self) -> bool:
        """Whether it says the same wherever it is referred to: it has no parameters, expressions
        and references."""
        # Then one reading serves all references, and the engine keeps it.
        tags = any(True for _ in self.element.iter("ParameterDeclarations", *REFERENCES))
        return not tags and not any(
            "$" in text for inner in self.element.iter("*") for text in inner.attrib.values()
        )

    @property
    def parameters(self) -> set[str]:
        """Names of the parameters that it declares."""
        return {
            declaration.get("name") or ""
            for declaration in self.element.iterfind("ParameterDeclarations/ParameterDeclaration")
        }


DIRECTORIES = "asam.net:xosc:1.0.0:reference_control.catalogs_referenced_by_directory"
ENTRIES = "asam.net:xosc:1.0.0:reference_control.catalog_reference_resolvability"
"""Rules that a look-up may find broken."""


class Directory(NamedTuple):
    """Catalogue location: the path, and the place in the scenario that gives it."""

    path: Path
    file: Path
    line: int | None


class NoEntry(LookupError):
    """Error: a catalogue has no such entry, or more than one.

    Attributes:
        undecided: whether one of the directories is not there, so that the entry may be in it.
    """

    def __init__(self, message: str, undecided: bool = False) -> None:
        super().__init__(message)
        self.undecided = undecided


class _CatalogEntries(NamedTuple):
    name: str
    path: str
    entries: tuple[CatalogEntry, ...]


class _CatalogsOfKinds(NamedTuple):
    """The catalogues for some kinds of entries, what kept others from being read, and whether a
    directory is missing."""

    catalogs: list[_CatalogEntries]
    problems: list[str]
    incomplete: bool


class Catalogs:
    """The catalogues that a scenario can refer to, read when something from them is needed.

    Args:
        scenario: the scenario's file.
        location: the directory that a location, named like VehicleCatalog, gives; None where the
            scenario has none.
        load: reads a catalogue's file.
        remarks: where remarks are added on directories that are found elsewhere.
        folders: where to look for directories that are not there.
    """

    def __init__(
        self,
        scenario: Path,
        location: Callable[[str], Directory | None],
        load: Load,
        remarks: Remarks | None = None,
        folders: Folders = (),
    ) -> None:
        self._scenario = scenario
        self._location = location
        self._load = load
        self._remarks = remarks or Remarks()
        self._folders = folders
        self._known: dict[tuple[str, ...], _CatalogsOfKinds] = {}

    def find(self, holder: str, catalog: str, name: str) -> CatalogEntry:
        """Entry of a CatalogReference.

        Args:
            holder: name of the element that holds the reference.
            catalog, name: its catalogName and entryName.

        Raises:
            NoEntry: there is none, or more than one; or the reference stands where none is allowed.
        """
        if holder not in EXPECTED:
            raise NoEntry(f"no catalogue entry can stand in {holder}")
        kinds = EXPECTED[holder]
        # Once for each kind: a catalogue of vehicles is not read for a route.
        if kinds not in self._known:
            self._known[kinds] = self._read(kinds)
        read = self._known[kinds]
        named = [candidate for candidate in read.catalogs if candidate.name == catalog]
        named = named or [
            candidate for candidate in read.catalogs if Path(candidate.path).stem == catalog
        ]
        if not named:
            names = sorted({candidate.name for candidate in read.catalogs})
            hint = f", {nearest(catalog, names)}" if names else ""
            message = "; ".join([f"there is no catalogue {quoted(catalog)}{hint}", *read.problems])
            raise NoEntry(message, read.incomplete)
        entries = [entry for catalog in named for entry in catalog.entries if entry.kind in kinds]
        every = [entry for entry in entries if entry.name == name]
        # Folders are in the order of preference: an entry hides those of its name in later folders.
        folder = os.path.dirname(every[0].path) if every else ""
        matching = [entry for entry in every if os.path.dirname(entry.path) == folder]
        # Copies of one entry are no ambiguity, whatever the order of their attributes.
        texts = {
            etree.tostring(entry.element, method="c14n", with_tail=False) for entry in matching
        }
        if len(texts) > 1:
            raise NoEntry(f"more than one entry is meant: {' and '.join(map(str, matching))}")
        if len(every) > 1:
            text = f"{every[0]} is taken; {' and '.join(map(str, every[1:]))} has the name, too"
            self._remarks.add(Remark(ENTRIES, text, str(self._scenario)))
        if not matching:
            hint = nearest(name, [entry.name for entry in entries])
            message = (
                f"the catalogue {quoted(catalog)} has no {' or '.join(kinds)} "
                f"{quoted(name)}, {hint}"
            )
            raise NoEntry(message, read.incomplete)
        return matching[0]

    def _read(self, kinds: Iterable[str]) -> _CatalogsOfKinds:
        names = [f"{kind}Catalog" for kind in kinds]
        directories = [
            directory for name in names if (directory := self._location(name)) is not None
        ]
        problems = [] if directories else [f"CatalogLocations has no {' or '.join(names)}"]
        files: dict[str, None] = {}
        incomplete = False
        for directory in directories:
            try:
                located = locate(directory.path, self._scenario, self._folders)
            except InvalidFile as error:  # it may not be looked at
                problems.append(str(error))
                continue
            except (OSError, ValueError):
                incomplete = True
                place = f"{directory.file}:{directory.line}"
                problems.append(missing(directory.path, f" ({place})"))
                continue
            files |= dict.fromkeys(located.files)
            if located.assumed:
                self._remarks.add(
                    Remark(DIRECTORIES, located.assumed, str(directory.file), directory.line)
                )
        # The stamp is part of the cache's key: changed files are read anew.
        results = [_catalog(self._load, file, stamp(file)) for file in files]
        problems += [f"not readable: {result}" for result in results if isinstance(result, str)]
        catalogs = [result for result in results if isinstance(result, _CatalogEntries)]
        return _CatalogsOfKinds(catalogs, problems, incomplete)


def referred(file: Path, reference: str) -> Path:
    """The path that a file refers to, also as a `file:` URI; a relative one starts at the file's
    folder."""
    plain = unquote(_URI.sub("", reference)) if _URI.match(reference) else reference
    return file.parent / plain.replace("\\", "/")


_URI = re.compile(r"file:(//[^/]*)?(/(?=[A-Za-z]:))?", re.IGNORECASE)
"""Part of a URI before the path. The third slash of file:///C:/maps is not part of the path."""


class Located(NamedTuple):
    """Files of a catalogue directory, sorted, and assumptions about its place; empty without any.

    Where the directory is missing these are the files of all folders that were asked for, in the
    order of the folders.
    """

    files: list[str]
    assumed: str


def missing(directory: Path, place: str = "") -> str:
    """Return the message for a catalogue directory that does not exist, with the place that names
    it."""
    return (
        f"the directory {directory}{place} does not exist or can't be read: put it there, or name "
        "the folder that has it with "
        f"--catalog-path (or in {VARIABLE})"
    )


def locate(path: Path, scenario: Path, folders: Folders = ()) -> Located:
    """Find the files of a catalogue directory.

    A path that is a file itself, as some scenarios have it, gives that file. Libraries get moved
    about: what does not exist is looked for by its name in the folders that were asked for, which
    may be the directory themselves, in other case, by its name in the scenario's folder and in the
    folders in that, then by its relative path in the folders above.

    Args:
        folders: where to look first, before those in XOSC_CATALOG_PATH.

    Raises:
        OSError, ValueError: there is no such directory, or it cannot be read.
        InvalidFile: it may not be looked at (`schemas.common.policy`).
    """
    assumed = ""
    current().admit(path)
    if not path.exists():
        # Before any guess by name: the user has said where to look.
        asked_for = _asked_for(path, folders)
        if asked_for:
            return Located([file for path in asked_for for file in _files(path)], "")
        other = next(
            (
                candidate
                for candidate in _elsewhere(path, scenario)
                if current().allows(candidate) and candidate.exists()
            ),
            None,
        )
        if other is not None:
            path, assumed = other, f"there is no folder {path}: {other} is taken, by its name"
    alone = (
        f"{path} is a file, a folder is expected: that file alone is taken"
        if path.is_file()
        else ""
    )
    return Located(_files(path), assumed or alone)


def _files(path: Path) -> list[str]:
    """The files of a directory of catalogues, sorted; the file alone where it is one."""
    if path.is_file():
        return [os.path.normpath(path)]
    return sorted(
        os.path.normpath(entry.path)
        for entry in os.scandir(path)
        # Other files may lie there; which of these are catalogues is known once they are read.
        if entry.name.lower().endswith(".xosc")
    )


def _asked_for(path: Path, folders: Folders) -> list[Path]:
    """The directories, or files, of that name in the folders that were asked for, then those
    folders that have catalogues."""
    places = search_path(folders, VARIABLE)
    name = os.path.basename(os.path.normpath(path))
    # Folders of that name before folders that only hold some catalogues.
    named = [place / name for place in places if (place / name).exists()]
    return [*named, *(place for place in places if any(place.glob("*.xosc")))]


def _elsewhere(path: Path, scenario: Path) -> Iterator[Path]:
    """Yield candidates for a catalogue directory that is not at its given path."""
    spelt = in_any_case(path)
    if spelt is not None:
        yield spelt
    name = os.path.basename(os.path.normpath(path))
    yield from (place / name for place in (scenario.parent, *sorted(scenario.parent.iterdir())))
    yield from above(path, scenario)


@lru_cache(maxsize=256)
def _catalog(load: Load, path: str, _: Stamp) -> _CatalogEntries | str | None:
    """The catalogue in a file, None where the file is something else, and the reason where it can't
    be read."""
    try:
        document = load(path)
    except ToolchainError as error:
        return str(error)
    catalog = document.root.find("Catalog")
    if catalog is None:
        return None
    name = catalog.get("name", "")
    entries = tuple(
        CatalogEntry(
            str(child.tag),
            child.get("name", ""),
            child,
            name,
            path,
            document.version,
            sum(1 for _ in child.iter()),
        )
        # Kinds of the standard only: what else stands there is an error of the XSD.
        for child in catalog.iterchildren(*KINDS)
    )
    return _CatalogEntries(name, path, entries)
