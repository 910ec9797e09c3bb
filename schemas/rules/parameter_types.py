"""Default values fit the declared types."""

from collections.abc import Iterator

from schemas.expressions import ExpressionError
from schemas.rules.document import Document, typed
from schemas.rules.registry import Finding, rule


@rule(
    "asam.net:xosc:1.0.0:parameters.parameter_declaration_parameter_type_inference",
    level="warning",
    kinds=("scenario", "catalog"),
)
def check(document: Document) -> Iterator[Finding]:
    """The value of a ParameterDeclaration must be of its parameterType.

    A warning: it matters only where the default is used, which expression_has_a_value looks at.
    """
    for element in document.elements("ParameterDeclaration", "VariableDeclaration"):
        text = document.value(element, "value")
        kind = element.get("parameterType") or element.get("variableType") or "string"
        if text is None or not text:
            continue
        try:
            typed(text, kind)
        except ExpressionError:
            yield Finding(element, f"{element.get('name')}: the value {text!r} is not of type {kind}")
