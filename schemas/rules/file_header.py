"""The header is there."""

from collections.abc import Iterator

from schemas.checks.document import Document
from schemas.checks.registry import Finding, rule
from schemas.registry import HEADERS
from schemas.xml import local_name


@rule("asam.net:xosc:1.0.0:xml.fileheader_is_present", precondition=True)
@rule("asam.net:xodr:1.0.0:xml.fileheader_is_present", precondition=True)
def check(document: Document) -> Iterator[Finding]:
    """The root element must have the header as a child: FileHeader in OpenSCENARIO, header in OpenDRIVE."""
    if local_name(document.root) == document.standard and document.header is None:
        yield Finding(document.root, f"the element {HEADERS[document.standard]} is missing below {document.standard}")
