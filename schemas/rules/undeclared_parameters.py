"""Parameters are declared where they are used."""

from collections.abc import Iterator

from lxml import etree

from schemas.checks.document import Document
from schemas.checks.messages import unknown
from schemas.checks.registry import Finding, rule
from schemas.expressions import ExpressionError, references


@rule("asam.net:xosc:1.1.0:parameters.parameter_declaration_parameter_scope", kinds=("scenario",))
def check(document: Document) -> Iterator[Finding]:
    """A parameter may be used only within the element that declares it."""
    return undeclared(document)


@rule("asam.net:xosc:1.2.0:parameters.valid_parameter_declaration_in_catalogs", kinds=("catalog",))
def check_catalog(document: Document) -> Iterator[Finding]:
    """A parameter used in a catalogue entry shall be declared in that entry, with a default value."""
    yield from undeclared(document)
    for element, attribute, name in _used(document):
        declaration = document.declaration(element, name)
        if declaration is not None and not declaration.get("value") and declaration.get("parameterType") != "string":
            yield Finding(element, f"{attribute}: the parameter {name!r} is declared without a default value")


def undeclared(document: Document) -> Iterator[Finding]:
    """A finding for each parameter that an attribute uses and no declaration in scope declares."""
    for element, attribute, name in _used(document):
        if document.declaration(element, name) is None:
            known = document.names("ParameterDeclaration")
            yield Finding(element, f"{attribute}={element.get(attribute)!r}: {unknown('parameter', name, known)} in scope here")


def _used(document: Document) -> Iterator[tuple[etree._Element, str, str]]:
    """Each parameter that an attribute uses: the element, the attribute, the parameter's name."""
    for element, attribute, text in document.parametrised():
        if attribute == "parameterRef":  # names a parameter, as files of version 1.0 write it
            continue
        try:
            names = references(text)
        except ExpressionError:
            continue
        yield from ((element, attribute, name) for name in sorted(names))
