"""Catalogues that a scenario can refer to: the files in the folders of its CatalogLocations."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from lxml import etree

from schemas.errors import InvalidFile
from schemas.xml import parse

if TYPE_CHECKING:
    from schemas.rules.document import Document


@dataclass(frozen=True)
class Entry:
    """An entry of a catalogue: its element, and the document that it is in."""

    element: etree._Element
    document: Document

    @property
    def catalog(self) -> str:
        """Name of the catalogue that it is in."""
        parent = self.element.getparent()
        return parent.get("name") or "" if parent is not None else ""

    @property
    def parameters(self) -> set[str]:
        """Names of the parameters that it declares."""
        return {each.get("name") or "" for each in self.element.iterfind("ParameterDeclarations/ParameterDeclaration")}


class Catalogs:
    """The catalogues of a scenario, by their names and, as some tools look for them, by their files' names.

    Attributes:
        names: names of the entries of each catalogue, by its name.
        complete: whether all catalogue locations are there.
    """

    def __init__(self, scenario: Document) -> None:
        self._entries: dict[tuple[str, str], Entry] = {}
        self.names: dict[str, set[str]] = {}
        folders = list(_folders(scenario))
        self.complete = None not in folders
        for folder in filter(None, dict.fromkeys(folders)):
            for name, entry, found in _entries(folder):
                for called in (name, found.document.path.stem):
                    self._entries.setdefault((called, entry), found)
                self.names.setdefault(name, set()).add(entry)

    def entry(self, scenario: Document, reference: etree._Element) -> Entry | None:
        """The entry that a CatalogReference names, or None."""
        names = scenario.value(reference, "catalogName"), scenario.value(reference, "entryName")
        return self._entries.get((names[0] or "", names[1] or ""))


def _folders(scenario: Document) -> Iterator[Path | None]:
    for directory in scenario.elements("Directory"):
        name = scenario.value(directory, "path")
        yield scenario.file(name) if name is not None and scenario.has_folder(name) else None


def _entries(folder: Path) -> Iterator[tuple[str, str, Entry]]:
    for path in sorted(folder.glob("*.xosc")):
        try:
            status = path.stat()
            document = _read(path, status.st_mtime_ns, status.st_size)
        except (InvalidFile, OSError):
            continue  # the check of that file itself says so
        for catalog in document.elements("Catalog"):
            for element in catalog.iterchildren(etree.Element):
                yield catalog.get("name") or "", document.value(element, "name") or "", Entry(element, document)


@lru_cache(maxsize=256)
def _read(path: Path, mtime: int, size: int) -> Document:
    from schemas.rules.document import Document

    return Document(parse(path), path)
