"""The header says the version."""

from collections.abc import Iterator

from schemas.checks.document import Document
from schemas.checks.registry import Finding, rule
from schemas.registry import revision


@rule("asam.net:xosc:1.0.0:xml.version_is_defined", precondition=True)
@rule("asam.net:xodr:1.0.0:xml.version_is_defined", precondition=True)
def check(document: Document) -> Iterator[Finding]:
    """The header must have the attributes revMajor and revMinor, non-negative integers of at most 65535."""
    if document.header is None:
        return
    for name in ("revMajor", "revMinor"):
        text = document.header.get(name)
        if text is None:
            yield Finding(document.header, f"the attribute {name} is missing")
        elif revision(text) is None:
            yield Finding(document.header, f"{name}={text!r} is no version number: an integer from 0 to 65535 is expected")
