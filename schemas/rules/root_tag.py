"""The root element names the standard."""

from collections.abc import Iterator

from schemas.checks.document import Document
from schemas.checks.registry import Finding, rule
from schemas.xml import local_name


@rule("asam.net:xosc:1.0.0:xml.root_tag_is_openscenario", precondition=True)
@rule("asam.net:xodr:1.0.0:xml.root_tag_is_opendrive", precondition=True)
def check(document: Document) -> Iterator[Finding]:
    """The root element must be OpenSCENARIO or OpenDRIVE."""
    if local_name(document.root) != document.standard:
        yield Finding(document.root, f"the root element is {local_name(document.root)}, {document.standard} is expected")
