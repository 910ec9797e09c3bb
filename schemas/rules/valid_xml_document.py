"""The file is an XML document: what the parser decides before any other rule can look."""

from collections.abc import Iterator

from schemas.checks.document import Document
from schemas.checks.registry import Finding, rule


@rule("asam.net:xosc:1.0.0:xml.valid_xml_document", precondition=True)
@rule("asam.net:xodr:1.0.0:xml.valid_xml_document", precondition=True)
def check(document: Document) -> Iterator[Finding]:
    """The file must be a well-formed XML document, without a document type and not too large.

    Nothing is left to find in a document that has been parsed; `schemas.checks.checker` reports the others under this uid.
    """
    return iter(())
