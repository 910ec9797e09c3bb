"""Files that a scenario refers to, taken along into the output folder, and the references that lead there."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from lxml import etree

from schemas.catalogs import locate, missing
from schemas.errors import InvalidFile
from schemas.storage import read_bytes
from xosc.document import Document, load
from xosc.exports.draft import Draft
from xosc.exports.folder import Folder
from xosc.node import Node
from xosc.roads import logic_file

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
    logic, scene = logic_file(document.node), document.node.find("RoadNetwork", "SceneGraphFile")
    if logic is not None:
        _literal(logic, "filepath")
    found = draft.settings.roads(document.node)
    if found is not None:
        draft.note(*filter(None, [found.remark]))
        _take(logic or _new_logic_file(document.node), found.path, ROADS, draft)
    if scene is not None and scene.get("filepath").strip() and _literal(scene, "filepath").is_file():
        _take(scene, _literal(scene, "filepath"), MODELS, draft)
    return found.path if found is not None else None


def _take(node: Node, source: Path, folder: str, draft: Draft) -> None:
    """Take a file along, to which an element then refers."""
    try:
        content = read_bytes(source)
    except InvalidFile as error:
        raise node.invalid(f"{source} can't be taken along: {error.message}") from None
    name = draft.folder.name(source, f"{folder}/{source.name}")
    node.element.set("filepath", name)
    draft.add(name, content)


def _new_logic_file(scenario: Node) -> Node:
    """The element LogicFile of a scenario that has none, or an empty one."""
    network = scenario.need("RoadNetwork")
    logic = network.find("LogicFile")
    if logic is None:
        network.element.insert(0, etree.Element("LogicFile"))
        logic = network.need("LogicFile")
    return logic


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
