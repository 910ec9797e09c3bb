"""Declared names are names."""

from collections.abc import Iterator

from schemas.checks.document import Document
from schemas.checks.registry import Finding, rule

UID = "xosc.toolchain:xosc:1.0.0:parameters.declared_name_is_a_name"


@rule(UID, kinds=("scenario", "catalog"))
def check(document: Document) -> Iterator[Finding]:
    """A declared parameter, variable or monitor must be named without `$`, which marks references."""
    for element in document.elements("ParameterDeclaration", "VariableDeclaration", "MonitorDeclaration"):
        name = element.get("name") or ""
        if "$" in name:
            yield Finding(element, f"the declared name {name!r} must be written without '$'")
