"""Files are well-formed, valid documents of their standard, with names that
stand for one element.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from copy import deepcopy

from lxml import etree

from schemas.checks import road_elements
from schemas.checks.document import CheckedDocument
from schemas.checks.registry import Finding, rule
from schemas.common.xml import local_name
from schemas.validate import find_violations
from schemas.versions.registry import HEADERS, OPENDRIVE, SCHEMA_DIR, Schema, revision, schema_for


@rule("asam.net:xosc:1.0.0:xml.valid_xml_document", precondition=True)
@rule("asam.net:xodr:1.0.0:xml.valid_xml_document", precondition=True)
def file_is_well_formed(document: CheckedDocument) -> Iterator[Finding]:
    """The file must be a well-formed XML document, without a document type and not too large.

    Nothing is left to find in a document that has been parsed; `schemas.checks.checker` reports the
    others under this uid.
    """
    return iter(())


@rule("asam.net:xosc:1.0.0:xml.root_tag_is_openscenario", precondition=True)
@rule("asam.net:xodr:1.0.0:xml.root_tag_is_opendrive", precondition=True)
def root_element_names_the_standard(document: CheckedDocument) -> Iterator[Finding]:
    """The root element must be OpenSCENARIO or OpenDRIVE."""
    if local_name(document.root) != document.standard:
        yield Finding(
            document.root,
            f"the root element is {local_name(document.root)}, {document.standard} is expected",
        )


@rule("asam.net:xosc:1.0.0:xml.fileheader_is_present", precondition=True)
@rule("asam.net:xodr:1.0.0:xml.fileheader_is_present", precondition=True)
def header_is_present(document: CheckedDocument) -> Iterator[Finding]:
    """The root element must have the header as a child: FileHeader in OpenSCENARIO, header in
    OpenDRIVE."""
    # Below another root nothing is expected: that root is the one fault to report.
    if local_name(document.root) == document.standard and document.header is None:
        yield Finding(
            document.root,
            f"the element {HEADERS[document.standard]} is missing below {document.standard}",
        )


@rule("asam.net:xosc:1.0.0:xml.version_is_defined", precondition=True)
@rule("asam.net:xodr:1.0.0:xml.version_is_defined", precondition=True)
def header_has_the_version(document: CheckedDocument) -> Iterator[Finding]:
    """The header must have the attributes revMajor and revMinor, non-negative integers of at most
    65535."""
    if document.header is None:
        return
    for name in ("revMajor", "revMinor"):
        text = document.header.get(name)
        if text is None:
            yield Finding(document.header, f"the attribute {name} is missing")
        elif revision(text) is None:
            yield Finding(
                document.header,
                f"{name}={text!r} is no version number: an integer from 0 to 65535 is expected",
            )


SCHEMA_UID = "asam.net:xosc:1.0.0:xml.valid_schema"


@rule(SCHEMA_UID)
@rule("asam.net:xodr:1.0.0:xml.valid_schema")
def document_is_valid_by_schema(document: CheckedDocument) -> Iterator[Finding]:
    """The document must be valid against the XSD of the version that its header names.

    Where no XSD of that version is at hand this is a warning: the file may be fine, but nothing has
    shown it. Of road networks the elements that are read are checked all the same. Their XSD has no
    namespace; a document in ASAM's is validated without it.
    """
    schema = schema_for(document.type.standard, document.type.version)
    if schema is None:
        message = (
            f"not validated: no XSD of {document.type} is at hand; {SCHEMA_DIR} can name a folder "
            "that holds one"
        )
        yield Finding(
            document.header if document.header is not None else document.root, message, "warning"
        )
        if document.type.standard == OPENDRIVE:
            yield from (
                Finding(element, fault)
                for element, fault in road_elements.violations(document.root)
            )
        return
    if document.type.standard == OPENDRIVE and etree.QName(document.root).namespace in _NAMESPACES:
        yield Finding(
            document.root,
            "a namespace, of which the XSD of OpenDRIVE knows none: validated without it",
            "warning",
        )
        yield from _violations_without_namespaces(document.tree, schema)
        return
    for element, message in find_violations(document.tree, schema):
        yield Finding(element, message)


_NAMESPACES = {
    f"http{s}://code.asam.net/simulation/standard/opendrive_schema{end}"
    for s in ("", "s")
    for end in ("", "/")
}
"""Namespaces of OpenDRIVE in examples of ASAM and exports of editors"""


def _violations_without_namespaces(tree: etree._ElementTree, schema: Schema) -> Iterator[Finding]:
    """Yield violations by a document's elements if these were in no namespace."""
    # On a copy: other rules, and the findings, keep the elements as they are in the file.
    root = deepcopy(tree.getroot())
    originals = dict(zip(root.iter(), tree.getroot().iter(), strict=True))
    for element in root.iter(etree.Element):
        element.tag = local_name(element)
    for element, message in find_violations(root.getroottree(), schema):
        yield Finding(originals[element], message)


@rule("asam.net:xosc:1.0.0:general.file_ending", level="warning")
def file_has_the_ending(document: CheckedDocument) -> Iterator[Finding]:
    """Scenario descriptions should have the file extension .xosc."""
    # As it is spelt: systems that tell `.XOSC` from it do not find the file by its ending.
    if document.path.suffix != ".xosc":
        yield Finding(
            document.root, f"the file ends in {document.path.suffix!r}, .xosc is expected"
        )


# Their attribute `name` is that of a signal or of a value outside the file.
_NOT_OWN_NAMES = {"TrafficSignalStateAction", "TrafficSignalCondition", "UserDefinedValueCondition"}
_ENTITIES = {"Entities", "Catalog"}
"""Elements whose children have rules of their own: `xosc.rules.references`."""


UNIQUE_NAMES_UID = "asam.net:xosc:1.2.0:reference_control.unique_element_names_on_same_level"


@rule(UNIQUE_NAMES_UID)
def names_are_unique(document: CheckedDocument) -> Iterator[Finding]:
    """Element names shall be unique among the elements that one element directly encloses."""
    return (
        Finding(*duplicate)
        for duplicate in doubled((element, name) for element, _, name in document.values("name"))
    )


def doubled(named: Iterable[tuple[etree._Element, str]]) -> Iterator[tuple[etree._Element, str]]:
    """Elements that repeat the name of an earlier sibling, each with the fault."""
    seen: dict[tuple[etree._Element, str], etree._Element] = {}
    for element, name in named:
        parent = element.getparent()
        if (
            parent is None
            or local_name(parent) in _ENTITIES
            or local_name(element) in _NOT_OWN_NAMES
        ):
            continue
        # Elements of different kinds too: a reference has the name alone.
        if seen.setdefault((parent, name), element) is not element:
            yield (
                element,
                (
                    f"{local_name(element)} {name!r} has the name of another element in "
                    f"{local_name(parent)}"
                ),
            )


@rule("asam.net:xosc:1.0.0:naming.no_double_colon_prefix_in_names")
def names_have_no_double_colon(document: CheckedDocument) -> Iterator[Finding]:
    """Names shall not contain `::`, which separates the names in a reference."""
    for element, _, name in document.values("name"):
        if "::" in name and not local_name(element).endswith(("Condition", "StateAction")):
            yield Finding(element, f"the name {name!r} contains '::'")
