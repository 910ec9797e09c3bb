"""The document is valid against the official XSD of its version."""

from collections.abc import Iterator

from schemas.checks.document import Document
from schemas.checks.registry import Finding, rule
from schemas.registry import SCHEMA_DIR, schema_for
from schemas.validate import find_violations

UID = "asam.net:xosc:1.0.0:xml.valid_schema"


@rule(UID)
@rule("asam.net:xodr:1.0.0:xml.valid_schema")
def check(document: Document) -> Iterator[Finding]:
    """The document must be valid against the XSD of the version that its header names.

    Where no XSD of that version is at hand this is a warning: the file may be fine, but nothing has shown it.
    """
    schema = schema_for(document.type.standard, document.type.version)
    if schema is None:
        message = f"not validated: no XSD of {document.type} is at hand; {SCHEMA_DIR} can name a folder that holds one"
        yield Finding(document.header if document.header is not None else document.root, message, "warning")
        return
    for element, message in find_violations(document.tree, schema):
        yield Finding(element, message)
