"""Declarations are unique."""

from collections.abc import Iterator

from lxml import etree

from schemas.checks.document import Document
from schemas.checks.registry import Finding, rule
from schemas.xml import line_of

UID = "xosc.toolchain:xosc:1.0.0:parameters.declarations_are_unique"


@rule(UID, kinds=("scenario", "catalog"))
def check(document: Document) -> Iterator[Finding]:
    """A parameter, variable or monitor must not be declared twice and differently in the same place."""
    for declarations in document.elements("ParameterDeclarations", "VariableDeclarations", "MonitorDeclarations"):
        first: dict[str, etree._Element] = {}
        for element in declarations.iterchildren(etree.Element):
            name = element.get("name") or ""
            earlier = first.setdefault(name, element)
            if _text(earlier) != _text(element):
                yield Finding(element, f"{name!r} is declared twice and differently, first in line {line_of(earlier)}")


def _text(element: etree._Element) -> bytes:
    return etree.tostring(element, method="c14n", with_tail=False)
