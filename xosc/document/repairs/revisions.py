"""The revision of a document: the declared one rules, unless the content says that it is of
another."""

from __future__ import annotations

import copy
from collections.abc import Iterator

from lxml import etree

from schemas import validate
from schemas.common.remarks import Remark
from schemas.expressions import is_expression
from schemas.versions.registry import HEADERS, OPENSCENARIO, header_of, revision, schema_for
from xosc.document.node import Node
from xosc.document.repairs.attributes import attributes, content, names

_PRESENT, _DEFINED, _VALID = (
    f"asam.net:xosc:1.0.0:xml.{name}"
    for name in ("fileheader_is_present", "version_is_defined", "valid_schema")
)
_HEADER = {"author": "", "date": "1970-01-01T00:00:00", "description": ""}

_EXPRESSIONS_SINCE = (1, 1)

Version = tuple[int, int]


def correct_revision(root: Node, versions: tuple[Version, ...]) -> list[Remark]:
    """Enter the revision of another version where the content says that it is of that one.

    The declared version rules the meaning. Only elements, attributes and expressions that it does
    not have, and that another has, speak for that one: of the versions that lack fewest, the
    nearest is taken. A missing child says nothing. Where the header has no revision, the newest
    version whose schema the content keeps is taken. A document of a later revision is read as one
    of the newest: what came later is then found as anything else that breaks its schema.

    Args:
        root: the root, in no namespace; its header is changed or added.
        versions: those that can be read, ascending.
    """
    header, said = header_of(root.element), claimed(root)
    if said in versions and (schema_for(OPENSCENARIO, said) is None or _keeps(root, said)):
        return []
    version = _meant(root, versions, said)
    if version is None or version == said:
        return []
    name = f"{version[0]}.{version[1]}"
    if header is None:
        header = etree.Element(HEADERS[OPENSCENARIO], _HEADER)
        root.element.insert(0, header)
        remark = root.remark(
            _PRESENT, f"there is no FileHeader; the content is that of version {name}"
        )
    else:
        has = f"the revision {said[0]}.{said[1]}" if said else "no revision"
        rule = _VALID if said else _DEFINED
        evidence = foreign(root, said) if said in versions else []
        shown = f": {evidence[0]}" if evidence else ""
        kept = bool(evidence) or _keeps(root, version)
        read = (
            f"the content is that of version {name}{shown}"
            if kept
            else f"it is read as version {name}"
        )
        cause = "version" if said is not None and said > versions[-1] else ""
        remark = Node(header, root.path).remark(rule, f"the header has {has}, {read}", cause)
    header.set("revMajor", str(version[0]))
    header.set("revMinor", str(version[1]))
    return [remark]


def _meant(root: Node, versions: tuple[Version, ...], said: Version | None) -> Version | None:
    """The version to read a document as; None where nothing says which."""
    later = said is not None and versions[-1] < said < (versions[-1][0] + 1, 0)
    if said in versions or later:
        lacks = {version: len(foreign(root, version)) for version in versions}
        return min(versions, key=lambda version: (lacks[version], _distance(version, said)))
    nearest = sorted(versions, key=lambda version: _distance(version, said))
    return next((version for version in nearest if _keeps(root, version)), None)


def claimed(root: Node) -> Version | None:
    """The version that the header of a document says; None where it says none."""
    header = header_of(root.element)
    if header is None:
        return None
    major, minor = revision(header.get("revMajor")), revision(header.get("revMinor"))
    return None if major is None or minor is None else (major, minor)


def _distance(version: Version, said: Version | None) -> tuple[int, int]:
    """Return the distance between a version and the one in the header; of two equally distant ones
    the newer sorts first."""
    distance = abs(100 * version[0] + version[1] - 100 * said[0] - said[1]) if said else 0
    return distance, -version[1]


def is_valid(root: Node, version: Version) -> bool:
    """Whether a document is valid against the XSD of a version; true where there is none."""
    schema = schema_for(OPENSCENARIO, version)
    return schema is None or validate.is_valid(root.element.getroottree(), schema)


def _keeps(root: Node, version: Version) -> bool:
    """Whether the content, without its header, is valid against the XSD of a version."""
    schema = schema_for(OPENSCENARIO, version)
    if schema is None:
        return False
    # On a copy: the header is completed only to ask.
    tree = copy.deepcopy(root.element.getroottree())
    header = header_of(tree.getroot())
    if header is None:
        header = etree.Element(HEADERS[OPENSCENARIO])
        tree.getroot().insert(0, header)
    for name, value in {
        **_HEADER,
        "revMajor": str(version[0]),
        "revMinor": str(version[1]),
    }.items():
        header.set(name, value)
    return validate.is_valid(tree, schema)


def foreign(root: Node, version: Version) -> list[str]:
    """Return a sentence on each element, attribute or expression that a version lacks and another
    one has.

    Names that no version has are misspelt, and say nothing of the version. Nor do values: the
    runner reads those of all versions alike.

    Args:
        root: root of a document, in no namespace.
        version: one of the standard's.
    """
    return list(dict.fromkeys(_foreign(root, version)))


def _foreign(root: Node, version: Version) -> Iterator[str]:
    inside, declared = content(version), attributes(version)
    known_children, known_attributes = names(content), names(attributes)
    lacks = f"{version[0]}.{version[1]} has no"
    for node in root.iter():
        tag = node.tag
        for child in node.children() if tag in inside else ():
            if child.tag in known_children[tag] and child.tag not in inside[tag]:
                yield f"{lacks} {child.tag} in {tag}"
        for name in map(str, node.element.attrib) if tag in declared else ():
            if name not in known_attributes[tag]:
                continue  # a look at its value takes a search through all before it
            if name not in declared[tag]:
                yield f"{lacks} attribute {name!r} of {tag}"
            elif version < _EXPRESSIONS_SINCE and name != "name" and is_expression(node.get(name)):
                yield f"{lacks} expressions, as {name}={node.get(name)!r}"
