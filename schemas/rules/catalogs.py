"""Catalogues, their entries and other files that are referred to exist."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path, PurePosixPath, PureWindowsPath

from schemas.catalogs import DIRECTORIES, ENTRIES, REFERENCES, NoEntry, locate
from schemas.checks.document import Document
from schemas.checks.findings import unknown
from schemas.checks.registry import Finding, rule
from schemas.common.policy import current
from schemas.common.storage import in_any_case
from schemas.xml import local_name


@rule(DIRECTORIES, level="warning", kinds=("scenario",))
def catalog_directory_exists(document: Document) -> Iterator[Finding]:
    """A catalogue location must name an existing folder, relative to the scenario.

    A warning: templates list locations that they do not use, and libraries that have been moved are found by their name.
    """
    for element in document.elements("Directory"):
        name = document.value(element, "path")
        if name is None:
            continue
        try:
            fault = locate(document.file(name), document.path, document.catalog_path).assumed
        except (OSError, ValueError):
            fault = f"there is no folder {name!r}"
        if fault:
            location = local_name(element.getparent())  # type: ignore[arg-type]  # a Directory is in a location
            yield Finding(element, f"{location}: {fault}")


@rule(ENTRIES, kinds=("scenario",))
def catalog_entry_exists(document: Document) -> Iterator[Finding]:
    """A CatalogReference must name an entry of a catalogue in one of the catalogue locations.

    Where a catalogue location is not there the entry may be in it, and this is a warning.
    """
    for element in document.elements(*REFERENCES):
        try:
            entry = document.entry(element)
        except NoEntry as error:
            yield Finding(element, str(error), "warning" if error.undecided else None)
            continue
        if entry is not None and entry.catalog != document.value(element, "catalogName"):
            message = f"{Path(entry.path).name} has the entry, but its catalogue is called {entry.catalog!r}"
            yield Finding(element, message, "warning")


@rule("xosc.toolchain:xosc:1.0.0:parameters.assigned_parameter_is_declared", kinds=("scenario",))
def assigned_parameter_is_declared(document: Document) -> Iterator[Finding]:
    """A ParameterAssignment of a CatalogReference must name a parameter that the catalogue entry declares."""
    for reference in document.elements(*REFERENCES):
        entry = document.resolvable_entry(reference)
        if entry is None:
            continue
        for assignment in reference.iter("ParameterAssignment"):
            name = (assignment.get("parameterRef") or "").removeprefix("$")
            if name not in entry.parameters:
                yield Finding(assignment, f"parameterRef: {unknown('parameter', name, entry.parameters)} in the catalogue entry")


_LEVELS = {"LogicFile": "error", "ScenarioFile": "error", "SceneGraphFile": "warning", "File": "warning"}


@rule("xosc.toolchain:xosc:1.0.0:reference_control.resolvable_file_reference")
def referred_file_exists(document: Document) -> Iterator[Finding]:
    """A file that is referred to must exist, relative to the referring file; a road network may be in a folder asked for.

    Models for graphics and animations are only warned about, since a run can do without them; so are absolute paths, which
    may exist on the machine that they are meant for.
    """
    for tag, level in _LEVELS.items():
        for element in document.elements(tag):
            name = document.value(element, "filepath")
            if name and not _exists(document, tag, name):
                absolute = PurePosixPath(name).is_absolute() or PureWindowsPath(name).is_absolute()
                place = "" if absolute else f" in {document.path.parent}"
                alike = in_any_case(document.file(name))
                spelt = f"; {alike} differs in upper and lower case" if alike else ""
                if not current().allows(document.file(name)):
                    yield Finding(element, f"{tag}: {name!r} {current().outside}, which --untrusted refuses", "error")
                    continue
                yield Finding(element, f"{tag}: there is no file {name!r}{place}{spelt}", "warning" if absolute else level)


def _exists(document: Document, tag: str, name: str) -> bool:
    return document.road_file(name) is not None if tag == "LogicFile" else document.has_file(name)
