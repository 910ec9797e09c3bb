"""Files that a scenario refers to, taken along into the output folder, and the references that lead there."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from schemas.catalogs import locate
from schemas.errors import InvalidFile
from schemas.storage import read_bytes
from xosc.document import Document, load
from xosc.exports.folder import Folder
from xosc.node import Node
from xosc.roads import find_roads

ROADS, MODELS, CATALOGS = "roads", "models", "catalogs"
"""Folders of the output."""

Convert = Callable[[Document], bytes]
"""The content that a catalogue gets in the output."""
Draft = dict[str, bytes]
"""Content by name, to be written when nothing more can be refused."""


def take_roads(document: Document, folder: Folder) -> Draft:
    """The road network and the 3D model of a scenario, to whose copies its references are changed.

    A model that is not there stays as it is referred to: few public scenarios bring their model along.

    Raises:
        InvalidFile: the road network cannot be read.
        Unsupported: a parameter names it.
    """
    network = document.node.find("RoadNetwork")
    taken: Draft = {}
    for node in network.children("LogicFile", "SceneGraphFile") if network is not None else ():
        source = _literal(node, "filepath")
        if not node.get("filepath").strip() or (node.tag == "SceneGraphFile" and not source.is_file()):
            continue
        if node.tag == "LogicFile":
            source = find_roads(node).path
        try:
            content = read_bytes(source)
        except InvalidFile as error:
            raise node.invalid(f"{source} cannot be taken along: {error.message}") from None
        name = folder.name(source, f"{ROADS if node.tag == 'LogicFile' else MODELS}/{source.name}")
        node.element.set("filepath", name)
        taken[name] = content
    return taken


def take_catalogs(document: Document, folder: Folder, convert: Convert) -> Draft:
    """The catalogues of a scenario, to whose copies its references are changed.

    Raises:
        InvalidFile, Unsupported: a catalogue can't be read or converted.
    """
    locations = document.node.find("CatalogLocations")
    taken: Draft = {}
    for location in locations.children() if locations is not None else ():
        node = location.need("Directory")
        source = _literal(node, "path")
        try:
            files = [Path(file) for file in locate(source, document.path).files]
        except (OSError, ValueError):
            raise node.invalid(f"the directory {source} does not exist or cannot be read") from None
        for catalog in [load(file) for file in files]:
            if catalog.kind == "catalog":
                taken[catalog_name(catalog.path, folder)] = convert(catalog)
        node.element.set("path", _directory(files[0].parent if files else source, folder))
    return taken


def _literal(node: Node, attribute: str) -> Path:
    if "$" in node.get(attribute):
        raise node.unsupported(
            f"{attribute}={node.get(attribute)!r} is the value of a parameter, and files are taken along by name"
        )
    return node.file(attribute)


def catalog_name(source: Path, folder: Folder) -> str:
    """The name that a catalogue gets in the output."""
    return f"{_directory(source.parent, folder)}/{source.name}"


def _directory(source: Path, folder: Folder) -> str:
    return folder.name(source, f"{CATALOGS}/{source.resolve().name}")
