"""The file has the ending of its standard."""

from collections.abc import Iterator

from schemas.checks.document import Document
from schemas.checks.registry import Finding, rule


@rule("asam.net:xosc:1.0.0:general.file_ending", level="warning")
def check(document: Document) -> Iterator[Finding]:
    """Scenario descriptions should have the file extension .xosc."""
    if document.path.suffix != ".xosc":
        yield Finding(document.root, f"the file ends in {document.path.suffix!r}, .xosc is expected")
