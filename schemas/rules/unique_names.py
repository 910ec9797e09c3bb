"""Names are unique where they stand."""

from collections.abc import Iterable, Iterator

from lxml import etree

from schemas.checks.document import Document
from schemas.checks.registry import Finding, rule
from schemas.xml import local_name

_NOT_OWN_NAMES = {"TrafficSignalStateAction", "TrafficSignalCondition", "UserDefinedValueCondition"}
_ENTITIES = {"Entities", "Catalog"}  # see unique_entities


UID = "asam.net:xosc:1.2.0:reference_control.unique_element_names_on_same_level"


@rule(UID)
def check(document: Document) -> Iterator[Finding]:
    """Element names shall be unique among the elements that one element directly encloses."""
    return (Finding(*each) for each in doubled((element, name) for element, _, name in document.values("name")))


def doubled(named: Iterable[tuple[etree._Element, str]]) -> Iterator[tuple[etree._Element, str]]:
    """Of elements with their names, those that have the name of an earlier one in the same element, and what is wrong."""
    seen: dict[tuple[etree._Element, str], etree._Element] = {}
    for element, name in named:
        parent = element.getparent()
        if parent is None or local_name(parent) in _ENTITIES or local_name(element) in _NOT_OWN_NAMES:
            continue
        if seen.setdefault((parent, name), element) is not element:
            yield element, f"{local_name(element)} {name!r} has the name of another element in {local_name(parent)}"
