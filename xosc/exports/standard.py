"""Targets `1.0` to `1.3`: the same scenarios, catalogues and distributions in another version of the standard.

Where a version has no expressions, or not the functions that a scenario uses, its parameters are worked out; its
distributions then become a scenario for each set of parameters, as for 1.0, which has no distributions.
"""

from __future__ import annotations

from pathlib import Path

from schemas.errors import Unsupported
from xosc.document import Document, load, to_bytes
from xosc.exports.concrete import concrete, concrete_scenarios, copied
from xosc.exports.folder import Folder
from xosc.exports.older import in_version
from xosc.exports.references import Draft, catalog_name, take_catalogs, take_roads
from xosc.versions import Version


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
        folder.write(catalog_name(source, folder), to_bytes(in_version(document, version)))
        return []
    if document.kind == "distribution":
        return _distribution(document, version, folder)
    draft, remarks = _scenario(document, version, folder)
    _write(draft, folder)
    return remarks


def _scenario(document: Document, version: Version, folder: Folder) -> tuple[Draft, list[str]]:
    """The files of a scenario, with parameters and catalogues where the version can say them; remarks."""
    try:
        return _package(document, version, folder), []
    except Unsupported as error:
        draft = _package(concrete(document), version, folder)
        return draft, [f"parameters, expressions and catalogue entries are worked out, for {error}"]


def _package(document: Document, version: Version, folder: Folder, name: str = "") -> Draft:
    changed = copied(document)
    draft = take_catalogs(changed, folder, lambda catalog: to_bytes(in_version(catalog, version)))
    draft |= take_roads(changed, folder)
    named = folder.name(document.path, f"{name or document.path.stem}.xosc")
    return {**draft, named: to_bytes(in_version(changed, version))}


def _distribution(document: Document, version: Version, folder: Folder) -> list[str]:
    node = document.node.need("ParameterValueDistribution", "ScenarioFile")
    scenario = load(document.path.parent / node.get("filepath").replace("\\", "/"))
    try:
        draft = _package(scenario, version, folder)
        changed = copied(in_version(document, version))
        reference = changed.node.need("ParameterValueDistribution", "ScenarioFile")
        reference.element.set("filepath", folder.name(scenario.path, f"{scenario.path.stem}.xosc"))
        _write(draft | {folder.name(document.path, document.path.name): to_bytes(changed)}, folder)
        return []
    except Unsupported as error:
        draft = {}
        for name, worked_out in concrete_scenarios(document.path):
            draft |= _package(worked_out, version, folder, name)
        _write(draft, folder)
        return [f"a scenario is written for each set of parameters, for {error}"]


def _write(draft: Draft, folder: Folder) -> None:
    for name, content in draft.items():
        folder.write(name, content)
