"""The revision that a document has by its content, where its header names none, or a wrong one."""

from __future__ import annotations

import copy

from lxml import etree

from schemas import validate
from schemas.common.remarks import Remark
from schemas.registry import HEADERS, OPENSCENARIO, header_of, revision, schema_for
from xosc.node import Node

_PRESENT, _DEFINED, _VALID = (
    f"asam.net:xosc:1.0.0:xml.{name}" for name in ("fileheader_is_present", "version_is_defined", "valid_schema")
)
_HEADER = {"author": "", "date": "1970-01-01T00:00:00", "description": ""}

Version = tuple[int, int]


def repair(root: Node, versions: tuple[Version, ...]) -> list[Remark]:
    """Enter the revision of the version whose schema the document keeps, where it does not keep that of its own.

    Where several do, it is the one nearest to what the header says; the newest where that says nothing. A document of a later
    revision that keeps none is read as one of the newest: what came later is then found as anything else that breaks its schema.

    Args:
        root: the root, in no namespace; its header is changed or added.
        versions: those that can be read, ascending.
    """
    header, said = header_of(root.element), claimed(root)
    if said in versions and (schema_for(OPENSCENARIO, said) is None or _keeps(root, said)):
        return []
    for version in sorted(versions, key=lambda each: _distance(each, said)):
        if version != said and _keeps(root, version):
            break
    else:
        if said is None or not versions[-1] < said < (versions[-1][0] + 1, 0):
            return []
        version = versions[-1]
    name = f"{version[0]}.{version[1]}"
    if header is None:
        header = etree.Element(HEADERS[OPENSCENARIO], _HEADER)
        root.element.insert(0, header)
        remark = root.remark(_PRESENT, f"there is no FileHeader; the content is that of version {name}")
    else:
        has = f"the revision {said[0]}.{said[1]}" if said else "no revision"
        rule = _VALID if said else _DEFINED
        read = f"the content is that of version {name}" if _keeps(root, version) else f"it is read as version {name}"
        remark = Node(header, root.path).remark(rule, f"the header has {has}, {read}")
    header.set("revMajor", str(version[0]))
    header.set("revMinor", str(version[1]))
    return [remark]


def claimed(root: Node) -> Version | None:
    """The version that the header of a document says; None where it says none."""
    header = header_of(root.element)
    if header is None:
        return None
    major, minor = revision(header.get("revMajor")), revision(header.get("revMinor"))
    return None if major is None or minor is None else (major, minor)


def _distance(version: Version, said: Version | None) -> tuple[int, int]:
    """Return the distance between a version and the one in the header; of two equally distant ones the newer sorts first."""
    distance = abs(100 * version[0] + version[1] - 100 * said[0] - said[1]) if said else 0
    return distance, -version[1]


def is_valid(root: Node, version: Version) -> bool:
    """Whether a document is valid against the XSD of a version, as far as there is one."""
    schema = schema_for(OPENSCENARIO, version)
    return schema is None or validate.is_valid(root.element.getroottree(), schema)


def _keeps(root: Node, version: Version) -> bool:
    """Whether the content keeps the schema of a version, whatever the header says."""
    schema = schema_for(OPENSCENARIO, version)
    if schema is None:
        return False
    tree = copy.deepcopy(root.element.getroottree())
    header = header_of(tree.getroot())
    if header is None:
        header = etree.Element(HEADERS[OPENSCENARIO])
        tree.getroot().insert(0, header)
    for name, value in {**_HEADER, "revMajor": str(version[0]), "revMinor": str(version[1])}.items():
        header.set(name, value)
    return validate.is_valid(tree, schema)
