"""Parameters are declared where they are used."""

from collections.abc import Iterator

from schemas.checks.document import Document
from schemas.checks.messages import unknown
from schemas.checks.registry import Finding, rule
from schemas.expressions import ExpressionError, references


@rule("asam.net:xosc:1.1.0:parameters.parameter_declaration_parameter_scope", kinds=("scenario",))
def check(document: Document) -> Iterator[Finding]:
    """A parameter may be used only within the element that declares it."""
    return undeclared(document)


@rule("asam.net:xosc:1.2.0:parameters.valid_parameter_declaration_in_catalogs", level="warning", kinds=("catalog",))
def check_catalog(document: Document) -> Iterator[Finding]:
    """A parameter used in a catalogue entry shall be declared in that entry, with a default value.

    A warning: the other entries of the catalogue are fit for use.
    """
    return undeclared(document)


def undeclared(document: Document) -> Iterator[Finding]:
    """A finding for each parameter that an attribute uses and no declaration in scope declares."""
    for element, attribute, text in document.parametrised():
        if attribute == "parameterRef":  # names a parameter, as files of version 1.0 write it
            continue
        try:
            names = references(text)
        except ExpressionError:
            continue
        for name in sorted(names):
            if document.declaration(element, name) is None:
                known = document.names("ParameterDeclaration")
                yield Finding(element, f"{attribute}={text!r}: {unknown('parameter', name, known)} in scope here")
