"""Targets `1.0` to `1.3`: the same scenarios, catalogues and distributions in another version of the standard.

Where a version has no expressions, or not the functions that a scenario uses, its parameters are worked out; its
distributions then become a scenario for each set of parameters, as for 1.0, which has no distributions.
"""

from __future__ import annotations

from pathlib import Path

from schemas.errors import Unsupported
from schemas.expressions import ExpressionError, references
from xosc.document import Document, load, to_bytes
from xosc.exports.concrete import concrete, concrete_scenarios, copied
from xosc.exports.conversion import in_version
from xosc.exports.folder import Folder
from xosc.exports.references import Draft, catalog_name, take_catalogs, take_roads
from xosc.versions import Version

TARGETS = {
    "1.0": "OpenSCENARIO XML 1.0",
    "1.1": "OpenSCENARIO XML 1.1",
    "1.2": "OpenSCENARIO XML 1.2",
    "1.3": "OpenSCENARIO XML 1.3",
}
_CLOSED_SINCE = (1, 2)
"""Before, the entries of catalogues also saw the parameters at the place of the reference."""


def export(source: Path, target: str, folder: Folder) -> list[str]:
    """Write a file, and all that it refers to, in the version that the target names.

    Args:
        source: a scenario, catalogue or distribution.
        target: `1.0`, `1.1`, `1.2` or `1.3`.

    Returns:
        Remarks on what is not as it was.

    Raises:
        Unsupported: the version can't say all of it, named with file and line.
        InvalidFile, UsageError: a file can't be read, or not be written.
    """
    major, minor = target.split(".")
    version = (int(major), int(minor))
    document = load(source)
    if document.kind == "catalog":
        folder.write(catalog_name(source, folder), to_bytes(_catalog(document, version)))
        return []
    if document.kind == "distribution":
        return distribution(document, version, folder)
    return scenario(document, version, folder)


def scenario(document: Document, version: Version | None, folder: Folder) -> list[str]:
    """Write a scenario with its parameters and catalogues, or worked out where the version can't say them; as in `export`."""
    try:
        draft, remarks = package(document, version, folder), []
    except Unsupported as error:
        draft, remarks = package(concrete(document), version, folder), [f"everything is worked out: {error}"]
    write_all(draft, folder)
    return remarks


def package(document: Document, version: Version | None, folder: Folder, name: str = "") -> Draft:
    """The files of a scenario: itself (under another name, where one is given), its catalogues, its roads.

    Args:
        version: of the scenario and its catalogues; None leaves each in its own.

    Raises:
        Unsupported: the version can't say all of it.
        InvalidFile: a file that it refers to can't be read.
    """
    changed = copied(document)
    draft = take_catalogs(changed, folder, lambda catalog: to_bytes(_catalog(catalog, version)))
    draft |= take_roads(changed, folder)
    named = folder.name(document.path, f"{name or document.path.stem}.xosc")
    return {**draft, named: to_bytes(in_version(changed, version or changed.version))}


def _catalog(catalog: Document, version: Version | None) -> Document:
    """A catalogue in a version; refused where its entries would no longer see parameters that they use."""
    if version is not None and catalog.version < _CLOSED_SINCE <= version:
        for entry in catalog.node.need("Catalog").children():
            declared = {each.get("name") for each in entry.iter("ParameterDeclaration")}
            for node in entry.iter():
                used = {name for text in node.element.attrib.values() for name in _parameters(str(text))}
                if used - declared:
                    name = min(used - declared)
                    raise node.unsupported(f"${name} is of the scenario, and since 1.2 entries of catalogues see their own only")
    return in_version(catalog, version or catalog.version)


def _parameters(text: str) -> set[str]:
    try:
        return references(text)
    except ExpressionError:  # as malformed in every version
        return set()


def distribution(document: Document, version: Version | None, folder: Folder) -> list[str]:
    """Write a distribution and its scenario, or a scenario for each set of parameters; remarks and errors as in `export`."""
    node = document.node.need("ParameterValueDistribution", "ScenarioFile")
    varied = load(document.path.parent / node.get("filepath").replace("\\", "/"))
    try:
        draft = package(varied, version, folder)
        changed = copied(in_version(document, version or document.version))
        reference = changed.node.need("ParameterValueDistribution", "ScenarioFile")
        reference.element.set("filepath", folder.name(varied.path, f"{varied.path.stem}.xosc"))
        write_all(draft | {folder.name(document.path, document.path.name): to_bytes(changed)}, folder)
        return []
    except Unsupported as error:
        write_sets(document, version, folder)
        return [f"a scenario is written for each set of parameters: {error}"]


def write_sets(document: Document, version: Version | None, folder: Folder) -> None:
    """Write the scenario of a distribution with each set of its parameters worked out; errors as in `export`."""
    draft: Draft = {}
    for name, worked_out in concrete_scenarios(document.path):
        draft |= package(worked_out, version, folder, name)
    write_all(draft, folder)


def write_all(draft: Draft, folder: Folder) -> None:
    """Write the files of an export, of which nothing is refused any more."""
    for name, content in draft.items():
        folder.write(name, content)
