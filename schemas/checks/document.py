"""Document of a check: indexed elements, parameters resolved where no run is needed for it."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

from lxml import etree

from schemas import expressions
from schemas.catalogs import CatalogEntry, Catalogs, Directory, Folders, NoEntry, referred
from schemas.checks import Problem, road_references
from schemas.common.errors import InvalidFile, ToolchainError
from schemas.common.policy import current
from schemas.common.xml import line_of, local_name, parse
from schemas.expressions.values import operand, type_named, typed
from schemas.versions.registry import OPENDRIVE, OPENSCENARIO, FileType, detect, header_of

_MAX_INDIRECTIONS = 50


class CheckedDocument:
    """A parsed file that is being checked.

    Args:
        tree: the parsed document.
        path: its file, the base of the relative paths in it.
        catalog_path, road_path: see `schemas.checks.checker.check`.
    """

    def __init__(
        self,
        tree: etree._ElementTree,
        path: Path,
        catalog_path: Folders = (),
        road_path: Folders = (),
    ) -> None:
        self.tree = tree
        self.root = tree.getroot()
        self.path = path
        self.catalog_path, self.road_path = catalog_path, road_path
        # By declaration: two of one name in different scopes have different defaults.
        self._defaults: dict[etree._Element, expressions.Value | None] = {}
        self._pending: set[etree._Element] = set()
        self._sources: dict[str, CheckedDocument] = {}

    @property
    def standard(self) -> str:
        """The standard that the root element or, failing that, the file name claims."""
        if local_name(self.root) in (OPENSCENARIO, OPENDRIVE):
            return local_name(self.root)
        return OPENDRIVE if self.path.suffix.lower() == ".xodr" else OPENSCENARIO

    @cached_property
    def header(self) -> etree._Element | None:
        """The element that holds the version."""
        return header_of(self.root)

    @cached_property
    def type(self) -> FileType:
        """Standard, version and kind; known once the preconditions hold."""
        return detect(self.tree)

    # elements ---------------------------------------------------------------------------------

    @cached_property
    def _index(self) -> tuple[dict[str, list[etree._Element]], dict[str, list[etree._Element]]]:
        # One pass for a hundred rules, each of which would go through the whole document.
        tags, attributes = defaultdict(list), defaultdict(list)
        for element in self.root.iter(etree.Element):
            tags[local_name(element)].append(element)
            for name in element.attrib:
                attributes[str(name)].append(element)
        return dict(tags), dict(attributes)

    def elements(self, *tags: str) -> list[etree._Element]:
        """All elements with one of these names, in document order within each name."""
        return [element for tag in tags for element in self._index[0].get(tag, ())]

    def values(self, *names: str) -> Iterator[tuple[etree._Element, str, str]]:
        """Element, attribute name and value of every attribute with one of these names; undecidable
        ones left out."""
        for name in names:
            for element in self._index[1].get(name, ()):
                value = self.value(element, name)
                if value is not None:
                    yield element, name, value

    def parametrised(self) -> Iterator[tuple[etree._Element, str, str]]:
        """Element, name and text of every attribute that refers to parameters or is an expression.

        Not the attribute `name`: names are text, for which the standard has no expressions.
        """
        for name, elements in self._index[1].items():
            for element in elements:
                text = element.get(name) or ""
                if text.startswith("$") and not (
                    name == "name" and expressions.is_expression(text)
                ):
                    yield element, name, text

    def names(self, *tags: str) -> set[str]:
        """The names of all elements with one of these tags."""
        return {
            name
            for element in self.elements(*tags)
            if (name := self.value(element, "name")) is not None
        }

    def problem(
        self, rule: str, level: str, message: str, element: etree._Element | None = None
    ) -> Problem:
        """A problem at an element of this document."""
        if element is None:
            # Of the file as a whole, as where it can't be parsed.
            return Problem(rule, level, message, str(self.path))
        return Problem(
            rule, level, message, str(self.path), line_of(element), self.tree.getpath(element)
        )

    # values -----------------------------------------------------------------------------------

    def value(self, element: etree._Element, name: str) -> str | None:
        """An attribute's value with the parameters at their defaults; None where it is absent or
        cannot be decided."""
        text = element.get(name)
        # Most attributes: substitution of plain text would only take time.
        if text is None or "$" not in text:
            return text
        try:
            return expressions.substitute(text, self.lookup(element))
        except ToolchainError:
            return None

    def number(self, element: etree._Element, name: str) -> float | None:
        """An attribute's value as a number; None where it is absent, undecidable or no number."""
        text = self.value(element, name)
        try:
            # A text that is no number is an error of the XSD, and none of the rule that asks.
            return float(text) if text is not None else None
        except ValueError:
            return None

    def lookup(self, element: etree._Element) -> expressions.Lookup:
        """Values that parameters have at an element: the defaults of the declarations in scope
        there."""

        def find(name: str) -> expressions.Value:
            declaration = self.declaration(element, name)
            value = None if declaration is None else self._default(declaration)
            if value is None:
                raise KeyError(name)
            return value

        return find

    def _default(self, declaration: etree._Element) -> expressions.Value | None:
        """The typed default of a parameter; None where it has none: malformed, cyclic or too deep.

        Each is worked out once, or a file of a few lines could ask for a billion evaluations.
        """
        # Depth as well as cycles: a chain of thousands would exceed the recursion of Python.
        if declaration in self._pending or len(self._pending) > _MAX_INDIRECTIONS:
            return None
        if declaration not in self._defaults:
            self._pending.add(declaration)
            try:
                text = expressions.substitute(
                    declaration.get("value") or "", self.lookup(declaration)
                )
                self._defaults[declaration] = operand(typed(self.type_of(declaration), text), text)
            except (ToolchainError, ValueError):
                self._defaults[declaration] = None
            self._pending.discard(declaration)
        return self._defaults[declaration]

    def type_of(self, declaration: etree._Element) -> str:
        """The type of a parameter or variable, one of `schemas.expressions.values.TYPES`.

        Raises:
            ValueError: it names no type, or is missing or undecidable.
        """
        name = (
            "variableType" if local_name(declaration) == "VariableDeclaration" else "parameterType"
        )
        return type_named(self.value(declaration, name) or "")

    def declaration(self, element: etree._Element, name: str) -> etree._Element | None:
        """The ParameterDeclaration of that name in scope at an element, the innermost first."""
        scope: etree._Element | None = element
        while scope is not None:
            declared = self._declarations.get(scope, {}).get(name)
            if declared is not None:
                return declared
            scope = scope.getparent()
        return None

    @cached_property
    def _declarations(self) -> dict[etree._Element, dict[str, etree._Element]]:
        scopes: dict[etree._Element, dict[str, etree._Element]] = defaultdict(dict)
        for declaration in self.elements("ParameterDeclaration"):
            scope = declaration.getparent()
            if scope is not None and local_name(scope) == "ParameterDeclarations":
                scope = scope.getparent()
            if scope is not None:
                # The first of two: a second one is the fault of another rule.
                scopes[scope].setdefault(declaration.get("name") or "", declaration)
        return dict(scopes)

    # the world outside --------------------------------------------------------------------------

    def file(self, name: str) -> Path:
        """A file that the document names, relative to the document's folder."""
        return referred(self.path, name)

    def has_file(self, name: str) -> bool:
        """Whether a file that the document names exists."""
        try:
            return current().allows(self.file(name)) and self.file(name).is_file()
        except (OSError, ValueError):
            return False

    def road_file(self, name: str) -> Path | None:
        """The road network that a LogicFile names: where it says, or in the folders that were asked
        for; None without one."""
        return (
            self.file(name)
            if self.has_file(name)
            else road_references.asked_for(self.file(name).name, self.road_path)
        )

    @cached_property
    def catalogs(self) -> Catalogs:
        """The catalogues in the scenario's catalogue locations."""
        return Catalogs(self.path, self._directory, _load, folders=self.catalog_path)

    def _directory(self, location: str) -> Directory | None:
        for element in self.elements(location):
            for directory in element.iterchildren("Directory"):
                name = self.value(directory, "path")
                # A location whose path can't be decided stands for the scenario's own folder.
                path = self.path.parent if name is None else self.file(name)
                return Directory(path, self.path, line_of(directory))
        return None

    def entry(self, reference: etree._Element) -> CatalogEntry | None:
        """Catalogue entry of a CatalogReference; None if its attributes are missing or undecidable.

        Raises:
            NoEntry: there is none, or more than one.
        """
        catalog, name, holder = (
            self.value(reference, "catalogName"),
            self.value(reference, "entryName"),
            reference.getparent(),
        )
        if catalog is None or name is None or holder is None:
            return None
        return self.catalogs.find(local_name(holder), catalog, name)

    def resolvable_entry(self, reference: etree._Element) -> CatalogEntry | None:
        """Catalogue entry of a CatalogReference; None unless there is exactly one."""
        try:
            return self.entry(reference)
        except NoEntry:
            return None

    def source(self, entry: CatalogEntry) -> CheckedDocument:
        """The document that a catalogue entry is in."""
        root = entry.element.getroottree()
        # Once a file: an index of a large catalogue for each reference would be quadratic.
        if entry.path not in self._sources:
            self._sources[entry.path] = CheckedDocument(root, Path(entry.path))
        return self._sources[entry.path]

    @cached_property
    def road_network(self) -> road_references.ReferencedRoads | None:
        """Roads of the LogicFile, if it is readable."""
        for element in self.elements("LogicFile"):
            name = self.value(element, "filepath")
            path = self.road_file(name) if name else None
            if path is not None:
                try:
                    return road_references.read(path)
                except InvalidFile:
                    return None
        return None


class _ParsedCatalog(NamedTuple):
    root: etree._Element
    version: tuple[int, int]


def _load(path: str) -> _ParsedCatalog:
    tree = parse(path)
    return _ParsedCatalog(tree.getroot(), detect(tree).version)
