"""Files that a scenario refers to, taken along into the output folder, and the references that lead there."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from schemas.catalogs import locate, missing
from schemas.errors import InvalidFile
from schemas.storage import read_bytes
from xosc.document import Document, load
from xosc.exports.draft import Draft
from xosc.exports.folder import Folder
from xosc.node import Node

ROADS, MODELS, CATALOGS = "roads", "models", "catalogs"
"""Folders of the output."""

Convert = Callable[[Document], bytes]
"""The content that a catalogue gets in the output."""


def take_roads(document: Document, draft: Draft) -> Path | None:
    """Take along the road network and the 3D model of a scenario, to whose copies its references are changed.

    A model that is not there stays as it is referred to: few public scenarios bring their model along.

    Returns:
        The file of the road network; None where there is none.

    Raises:
        InvalidFile: the road network cannot be read.
        Unsupported: a parameter names it.
    """
    network, roads = document.node.find("RoadNetwork"), None
    for node in network.children("LogicFile", "SceneGraphFile") if network is not None else ():
        source = _literal(node, "filepath")
        if not node.get("filepath").strip() or (node.tag == "SceneGraphFile" and not source.is_file()):
            continue
        if node.tag == "LogicFile":
            found = draft.settings.roads(node)
            source = roads = found.path
            draft.note(*filter(None, [found.remark]))
        try:
            content = read_bytes(source)
        except InvalidFile as error:
            raise node.invalid(f"{source} can't be taken along: {error.message}") from None
        name = draft.folder.name(source, f"{ROADS if node.tag == 'LogicFile' else MODELS}/{source.name}")
        node.element.set("filepath", name)
        draft.add(name, content)
    return roads


def take_catalogs(document: Document, draft: Draft, convert: Convert) -> None:
    """Take along the catalogues of a scenario, to whose copies its references are changed.

    Raises:
        InvalidFile, Unsupported: a catalogue can't be read or converted.
    """
    locations = document.node.find("CatalogLocations")
    for location in locations.children() if locations is not None else ():
        node = location.need("Directory")
        source = _literal(node, "path")
        try:
            files = [Path(file) for file in locate(source, document.path, draft.settings.catalog_path).files]
        except (OSError, ValueError):
            raise node.invalid(missing(source)) from None
        for catalog in [load(file, strict=draft.settings.strict) for file in files]:
            if catalog.kind == "catalog":
                draft.note(*catalog.remarks)
                draft.add(catalog_name(catalog.path, draft.folder), convert(catalog))
        node.element.set("path", _directory(files[0].parent if files else source, draft.folder))


def _literal(node: Node, attribute: str) -> Path:
    """The path that an attribute names; `$(…)`, as ROS has it, is no parameter."""
    if "$" in node.get(attribute).replace("$(", ""):
        raise node.unsupported(
            f"{attribute}={node.get(attribute)!r} is the value of a parameter, and files are taken along by name"
        )
    return node.file(attribute)


def catalog_name(source: Path, folder: Folder) -> str:
    """The name that a catalogue gets in the output."""
    return f"{_directory(source.parent, folder)}/{source.name}"


def _directory(source: Path, folder: Folder) -> str:
    return folder.name(source, f"{CATALOGS}/{source.resolve().name}")
