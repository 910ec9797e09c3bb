"""Names are unique where they stand."""

from collections.abc import Iterator

from schemas.checks.document import Document
from schemas.checks.registry import Finding, rule
from schemas.xml import local_name

_NOT_OWN_NAMES = {"TrafficSignalStateAction", "TrafficSignalCondition", "UserDefinedValueCondition"}
_ENTITIES = {"Entities", "Catalog"}  # see unique_entities


@rule("asam.net:xosc:1.2.0:reference_control.unique_element_names_on_same_level")
def check(document: Document) -> Iterator[Finding]:
    """Element names shall be unique among the elements that one element directly encloses."""
    seen: dict[tuple[object, str], object] = {}
    for element, _, name in document.values("name"):
        parent = element.getparent()
        if parent is None or local_name(parent) in _ENTITIES or local_name(element) in _NOT_OWN_NAMES:
            continue
        first = seen.setdefault((parent, name), element)
        if first is not element:
            yield Finding(element, f"{local_name(element)} {name!r} has the name of another element in {local_name(parent)}")
