"""No parameter is defined by itself."""

from collections.abc import Iterator

from lxml import etree

from schemas.checks.document import Document
from schemas.checks.graphs import on_cycles
from schemas.checks.registry import Finding, rule
from schemas.expressions import ExpressionError, references


@rule("xosc.toolchain:xosc:1.0.0:parameters.no_cyclic_definitions", kinds=("scenario", "catalog"))
def check(document: Document) -> Iterator[Finding]:
    """The default value of a parameter must not depend on the parameter itself, directly or through others."""
    uses = {declaration: _uses(document, declaration) for declaration in document.elements("ParameterDeclaration")}
    for declaration in on_cycles(uses):
        yield Finding(declaration, f"the value {declaration.get('value')!r} of {declaration.get('name')} depends on itself")


def _uses(document: Document, declaration: etree._Element) -> list[etree._Element]:
    try:
        names = references(declaration.get("value") or "")
    except ExpressionError:
        return []
    return [used for name in names if (used := document.declaration(declaration, name)) is not None]
