"""Default values fit the declared types."""

from collections.abc import Iterator

from schemas.checks.document import Document
from schemas.checks.registry import Finding, rule
from schemas.values import typed


@rule("asam.net:xosc:1.0.0:parameters.parameter_declaration_parameter_type_inference", kinds=("scenario", "catalog"))
def check(document: Document) -> Iterator[Finding]:
    """The value of a ParameterDeclaration or VariableDeclaration must be of the declared type.

    A warning in a catalogue, where it matters only to those who use the entry with its default.
    """
    for element in document.elements("ParameterDeclaration", "VariableDeclaration"):
        text = document.value(element, "value")
        try:
            kind = document.type_of(element)
        except ValueError:
            continue  # no type of the standard: valid_schema says so
        if text is None:
            continue
        try:
            typed(kind, text)
        except ValueError as error:
            level = "warning" if document.type.kind == "catalog" else None
            yield Finding(element, f"{element.get('name')}: the value is not of type {kind}: {error}", level)
