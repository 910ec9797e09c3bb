"""Types of files by their content, since an author may choose any name and suffix.

Exports take along the files that a scenario refers to. A road network or a catalogue is read to know that it is one; a 3-D model
is known by how its format begins, for nothing here reads models.
"""

from __future__ import annotations

import re
from pathlib import Path

from schemas.errors import InvalidFile
from schemas.registry import OPENDRIVE, detect
from schemas.remarks import Remark
from schemas.xml import local_name, parse_bytes, repaired

_HEAD = 4096
_BEGINNINGS = {
    "glTF, binary": rb"glTF[\x01\x02]\x00\x00\x00",
    "OpenSceneGraph, binary": rb"\xa1\x91\xfb\x6c|\x6c\xfb\x91\xa1",
    "OpenSceneGraph, text": rb"#(?:Ascii|Version)\b|(?:osg::)?(?:Group|Geode|MatrixTransform|LOD|PagedLOD|Transform|Switch)\s*\{",
    "OpenSceneGraph, older binary (ive)": rb"\x01\x00\x00\x00[\x00-\x2f]\x00\x00\x00|\x00\x00\x00\x01\x00\x00\x00[\x00-\x2f]",
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
_MODEL = re.compile(b"|".join(b"(?:%b)" % each for each in _BEGINNINGS.values()), re.DOTALL)
_LINE_OF_OBJ = re.compile(
    rb"#.*|(?P<vertex>v|vn|vt|vp)(?:\s+-?[\d.]+(?:[eE][-+]?\d+)?)+|[flp](?:\s+[\d/-]+)+|(?:o|g|s|mtllib|usemtl)(?:\s.*)?|"
)
_COLLADA = re.compile(rb"(?:\xef\xbb\xbf)?\s*(?:<\?xml[^>]*>\s*)?(?:<!--.*?-->\s*)*<COLLADA[\s>]", re.DOTALL)
_GLTF = re.compile(rb"\s*\{.*\"asset\"\s*:\s*\{[^{}]*\"version\"\s*:\s*\"[12]\.\d", re.DOTALL)
MODELS = "glTF, OpenSceneGraph, FBX, OBJ, 3D Studio, COLLADA, USD, OpenFlight, VRML, PLY, STL, Blender"
"""Formats of 3-D models that are known, for people"""


def is_model(content: bytes) -> bool:
    """Whether a file is a 3-D model of a known format."""
    head = content[:_HEAD]
    if _MODEL.match(head) or _COLLADA.match(head):
        return True
    if head.lstrip()[:1] == b"{":
        return _GLTF.match(content) is not None
    vertices = 0
    for line in content.split(b"\n"):
        found = _LINE_OF_OBJ.fullmatch(line.strip())
        if found is None:
            return False
        vertices += found["vertex"] == b"v"
    return vertices > 0


def need_roads(content: bytes, path: Path) -> list[Remark]:
    """See that a file is a road network; remarks on what was assumed to read it.

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
    found = detect(tree)
    if found.standard != OPENDRIVE:
        raise InvalidFile(f"this is {found.standard}, an OpenDRIVE file is expected", path=path)
    if not any(local_name(child) == "road" for child in tree.getroot()):
        raise InvalidFile("this OpenDRIVE file has no road", path=path)
    return remarks
