"""Files that a scenario refers to, taken along into the output folder, and the references that lead
there.

An author may choose any name and suffix, so what is taken along is known by its content: a road
network or a catalogue is read, a 3-D model is known by how its format begins.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from pathlib import Path

from lxml import etree

from schemas.catalogs import locate, missing
from schemas.common.errors import InvalidFile
from schemas.common.policy import current
from schemas.common.remarks import Remark
from schemas.common.storage import read_bytes
from schemas.common.xml import local_name, parse_bytes, repaired
from schemas.versions.registry import OPENDRIVE, detect
from xosc.document import Document, load
from xosc.document.node import Node
from xosc.document.road_files import RULE, logic_file
from xosc.exports.draft import Draft, Folder

ROADS, MODELS, CATALOGS = "roads", "models", "catalogs"
"""Folders of the output."""

Convert = Callable[[Document], bytes]
"""The content that a catalogue gets in the output."""


def take_roads(document: Document, draft: Draft) -> Path | None:
    """Take along the road network and the 3D model of a scenario, to whose copies its references
    are changed.

    A model that is not there stays as it is referred to: few public scenarios bring their model
    along.

    Returns:
        The file of the road network; None where there is none.

    Raises:
        InvalidFile: the road network cannot be read.
        Unsupported: a parameter names it.
    """
    logic, scene = logic_file(document.node), document.node.find("RoadNetwork", "SceneGraphFile")
    if logic is not None:
        _literal(logic, "filepath")
    roads = draft.settings.roads(document.node)
    if roads is not None:
        draft.note(*filter(None, [roads.remark]))
        _take(logic or _new_logic_file(document.node), roads.path, ROADS, draft)
    if scene is not None and scene.get("filepath").strip():
        _take_model(scene, draft)
    return roads.path if roads is not None else None


def _take_model(node: Node, draft: Draft) -> None:
    """Take a 3-D model along, where it is one: anything can be named."""
    source = _literal(node, "filepath")
    if not current().allows(source):
        raise node.invalid(f"the model {source} {current().outside}, which --untrusted refuses")
    if not os.path.isfile(source):  # unlike that of Path it takes names of any length
        return
    content = _content(node, source)
    if is_model(content):
        _add(node, source, content, MODELS, draft)
    else:
        draft.note(
            node.remark(
                RULE,
                f"{source} is no 3-D model of a known format ({MODEL_FORMATS}); "
                "it is not taken along",
            )
        )


def _take(node: Node, source: Path, folder: str, draft: Draft) -> None:
    """Take a road network along, to which an element then refers."""
    content = _content(node, source)
    try:
        draft.note(*need_roads(content, source))
    except InvalidFile as error:
        raise node.invalid(f"{source} can't be taken along: {error.message}") from None
    if _has_temporary_lanes(content, source):
        draft.note(
            f"{source}: temporary lanes: a player that does not know lane layers has the "
            "permanent ones alone, at best"
        )
    _add(node, source, content, folder, draft)


def _has_temporary_lanes(content: bytes, source: Path) -> bool:
    """Whether a road has a second layer of lanes (OpenDRIVE 1.9)."""
    # As bytes first: few files have to be parsed for this.
    if b"temporary" not in content:
        return False
    return parse_bytes(content, source).find("{*}road/{*}lanes[@layer='temporary']") is not None


def _content(node: Node, source: Path) -> bytes:
    try:
        return read_bytes(source)
    except InvalidFile as error:
        raise node.invalid(f"{source} can't be taken along: {error.message}") from None


def _add(node: Node, source: Path, content: bytes, folder: str, draft: Draft) -> None:
    name = draft.folder.name(source, f"{folder}/{source.name}")
    node.element.set("filepath", name)
    draft.add(name, content)
    _note_outside(source, draft)


def _note_outside(source: Path, draft: Draft) -> None:
    if not current().holds(source):
        draft.note(f"{source} {current().outside}; it is taken along")


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
            files = [
                Path(file)
                for file in locate(source, document.path, draft.settings.catalog_path).files
            ]
        except (OSError, ValueError):
            raise node.invalid(missing(source)) from None
        taken: dict[str, Path] = {}
        for catalog in [load(file, strict=draft.settings.strict) for file in files]:
            name = (
                catalog.node.need("Catalog").get("name", "") if catalog.kind == "catalog" else None
            )
            # Of catalogues with one name those of the first folder count, as in a run
            # (`schemas.catalogs`).
            if (
                name is not None
                and taken.setdefault(name, catalog.path.parent) == catalog.path.parent
            ):
                draft.note(*catalog.remarks)
                _note_outside(catalog.path, draft)
                draft.add(_beside(catalog.path, files[0], draft.folder), convert(catalog))
        node.element.set("path", _directory(files[0].parent if files else source, draft.folder))


def _literal(node: Node, attribute: str) -> Path:
    """Path of an attribute; `$(…)` of ROS is not a parameter."""
    if "$" in node.get(attribute).replace("$(", ""):
        raise node.unsupported(
            f"{attribute}={node.get(attribute)!r} is the value of a parameter, and files are "
            "taken along by name"
        )
    return node.file(attribute)


def catalog_name(source: Path, folder: Folder) -> str:
    """The name that a catalogue gets in the output."""
    return f"{_directory(source.parent, folder)}/{source.name}"


def _beside(catalog: Path, first: Path, folder: Folder) -> str:
    """The name of a catalogue in the directory of the first one, where several folders serve one
    location."""
    if catalog.parent == first.parent:
        return catalog_name(catalog, folder)
    return f"{_directory(first.parent, folder)}/{catalog.parent.name}-{catalog.name}"


def _directory(source: Path, folder: Folder) -> str:
    return folder.name(source, f"{CATALOGS}/{source.resolve().name}")


# types of files by their content ------------------------------------------------------------------

_HEAD = 4096
_BEGINNINGS = {
    "glTF, binary": rb"glTF[\x01\x02]\x00\x00\x00",
    "OpenSceneGraph, binary": rb"\xa1\x91\xfb\x6c|\x6c\xfb\x91\xa1",
    "OpenSceneGraph, text": (
        rb"#(?:Ascii|Version)\b|"
        rb"(?:osg::)?(?:Group|Geode|MatrixTransform|LOD|PagedLOD|Transform|Switch)\s*\{"
    ),
    "OpenSceneGraph, older binary (ive)": (
        rb"\x01\x00\x00\x00[\x00-\x2f]\x00\x00\x00|"
        rb"\x00\x00\x00\x01\x00\x00\x00[\x00-\x2f]"
    ),
    "FBX, binary": rb"Kaydara FBX Binary  \x00",
    "FBX, text": rb"; FBX \d",
    "3D Studio": rb"MM.{4}(?:\x02\x00|\x3d\x3d|\x00\xb0)",
    "USD, binary": rb"PXR-USDC",
    "USD, text": rb"#usda \d",
    "OpenFlight": rb"\x00\x01\x01\x04|\x00\x01\x01\x08",
    "VRML": rb"#VRML V\d",
    "PLY": rb"ply\r?\nformat (?:ascii|binary)",
    "STL, text": rb"solid\b[^\n]*\n\s*(?:facet normal|endsolid)",
    "Blender": rb"BLENDER[-_][vV]\d",
}
_MODEL = re.compile(
    b"|".join(b"(?:%b)" % beginning for beginning in _BEGINNINGS.values()), re.DOTALL
)
_LINE_OF_OBJ = re.compile(
    rb"#.*|(?P<vertex>v|vn|vt|vp)(?:\s+-?[\d.]+(?:[eE][-+]?\d+)?)+|[flp](?:\s+[\d/-]+)+|(?:o|g|s|mtllib|usemtl)(?:\s.*)?|"
)
_COLLADA = re.compile(
    rb"(?:\xef\xbb\xbf)?\s*(?:<\?xml[^>]*>\s*)?(?:<!--.*?-->\s*)*<COLLADA[\s>]", re.DOTALL
)
_GLTF = re.compile(rb"\s*\{.*\"asset\"\s*:\s*\{[^{}]*\"version\"\s*:\s*\"[12]\.\d", re.DOTALL)
MODEL_FORMATS = (
    "glTF, OpenSceneGraph, FBX, OBJ, 3D Studio, COLLADA, USD, OpenFlight, VRML, PLY, STL, Blender"
)
"""Formats of 3-D models that are known, for people"""


def is_model(content: bytes) -> bool:
    """Whether a file is a 3-D model of a known format."""
    head = content[:_HEAD]
    if _MODEL.match(head) or _COLLADA.match(head):
        return True
    if head.lstrip()[:1] == b"{":
        return _GLTF.match(content) is not None
    # OBJ has no signature: every line has to be one of its statements.
    vertices = 0
    for line in content.split(b"\n"):
        statement = _LINE_OF_OBJ.fullmatch(line.strip())
        if statement is None:
            return False
        vertices += statement["vertex"] == b"v"
    return vertices > 0


def need_roads(content: bytes, path: Path) -> list[Remark]:
    """Refuse a file that is no road network; remarks on assumptions made to read it.

    Raises:
        InvalidFile: it is no OpenDRIVE, or has no road.
    """
    remarks: list[Remark] = []
    try:
        tree = parse_bytes(content, path)
    except InvalidFile:
        fixed, remarks = repaired(content, path)
        if not remarks:
            raise
        tree = parse_bytes(fixed, path)
    file = detect(tree)
    if file.standard != OPENDRIVE:
        raise InvalidFile(f"this is {file.standard}, an OpenDRIVE file is expected", path=path)
    if not any(local_name(child) == "road" for child in tree.getroot()):
        raise InvalidFile("this OpenDRIVE file has no road", path=path)
    return remarks
