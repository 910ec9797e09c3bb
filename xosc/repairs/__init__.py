"""Repairs of documents as they are loaded.

Each repair is a function of a root and its version that changes the tree where something has one sensible meaning, and yields a
remark on each change. What has no such meaning is left to be refused; where they do not need it, a remark says that
it was there.
"""

from __future__ import annotations

import copy
from bisect import bisect_right
from collections import Counter
from dataclasses import replace

from lxml import etree

from schemas import validate
from schemas.common.remarks import Remark
from schemas.registry import HEADERS, OPENSCENARIO, header_of, revision, schema_for
from xosc.node import Node
from xosc.repairs import attributes, elements, names

# revision ---------------------------------------------------------------------------------------


_PRESENT, _DEFINED, _VALID = (
    f"asam.net:xosc:1.0.0:xml.{name}" for name in ("fileheader_is_present", "version_is_defined", "valid_schema")
)
_HEADER = {"author": "", "date": "1970-01-01T00:00:00", "description": ""}

Version = tuple[int, int]


def correct_revision(root: Node, versions: tuple[Version, ...]) -> list[Remark]:
    """Enter the revision of another version where the content says that it is of that one.

    The declared version rules the meaning. Only elements, attributes and expressions that it does not
    have, and that another has, speak for that one: of the versions that lack fewest, the nearest is taken. A missing
    child says nothing. Where the header has no revision, the newest version whose schema the content keeps is
    taken. A document of a later revision is read as one of the newest: what came later is then found as
    anything else that breaks its schema.

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
        remark = root.remark(_PRESENT, f"there is no FileHeader; the content is that of version {name}")
    else:
        has = f"the revision {said[0]}.{said[1]}" if said else "no revision"
        rule = _VALID if said else _DEFINED
        evidence = names.foreign(root, said) if said in versions else []
        shown = f": {evidence[0]}" if evidence else ""
        kept = bool(evidence) or _keeps(root, version)
        read = f"the content is that of version {name}{shown}" if kept else f"it is read as version {name}"
        remark = Node(header, root.path).remark(rule, f"the header has {has}, {read}")
    header.set("revMajor", str(version[0]))
    header.set("revMinor", str(version[1]))
    return [remark]


def _meant(root: Node, versions: tuple[Version, ...], said: Version | None) -> Version | None:
    """The version to read a document as; None where nothing says which."""
    later = said is not None and versions[-1] < said < (versions[-1][0] + 1, 0)
    if said in versions or later:
        lacks = {version: len(names.foreign(root, version)) for version in versions}
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
    """Return the distance between a version and the one in the header; of two equally distant ones the newer sorts first."""
    distance = abs(100 * version[0] + version[1] - 100 * said[0] - said[1]) if said else 0
    return distance, -version[1]


def is_valid(root: Node, version: Version) -> bool:
    """Whether a document is valid against the XSD of a version; true where there is none."""
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


# all repairs ------------------------------------------------------------------------------------


_REPAIRS = (
    attributes.leave_out_absent_values,
    attributes.correct_attribute_names,
    attributes.correct_declared_names,
    elements.join_doubled_elements,
    elements.keep_first_positions,
    elements.move_content,
    elements.double_lone_vertices,
    attributes.keep_last_declarations,
    elements.correct_element_names,
    elements.order_elements,
    attributes.add_missing_attributes,
    elements.add_missing_boxes,
    elements.add_missing_elements,
    attributes.tell_repeated_names,
    attributes.correct_spellings,
)
"""In the order in which they are made."""
_OF_VALID_DOCUMENTS = (attributes.correct_declared_names, attributes.keep_last_declarations, attributes.tell_repeated_names)
"""Repairs of faults that no XSD forbids."""


def repair(root: Node, versions: tuple[Version, ...]) -> list[Remark]:
    """Make all repairs in a document, in place.

    Args:
        root: the root, in no namespace.
        versions: those of the standard that can be read, ascending.
    """
    version = claimed(root)
    valid = version in versions and is_valid(root, version)
    remarks = [] if valid else correct_revision(root, versions)
    version = claimed(root)
    if version not in versions:
        return remarks
    repairs = _OF_VALID_DOCUMENTS if valid else _REPAIRS
    remarks += [remark for make in repairs for remark in make(root, version)]
    return _once(root, remarks if valid else [*remarks, *elements.remarks_on_violations(root, version)])


def _once(root: Node, remarks: list[Remark]) -> list[Remark]:
    """Remarks that say the same of several lines as one, on the first of them; those with a cause once a catalogue entry."""
    entries = [entry.line or 0 for catalog in root.children("Catalog") for entry in catalog.children()]
    keys = [(remark.rule, remark.message, bisect_right(entries, remark.line or 0) if remark.cause else 0) for remark in remarks]
    count = Counter(keys)
    first: dict[tuple[str, str, int], Remark] = {}
    for key, remark in zip(keys, remarks, strict=True):
        first.setdefault(key, remark)
    return [
        replace(remark, message=f"{remark.message} (and {count[key] - 1} more)") if count[key] > 1 else remark
        for key, remark in first.items()
    ]
