"""Expressions have a value."""

from collections.abc import Iterator

from lxml import etree

from schemas.checks.document import Document
from schemas.checks.registry import Finding, rule
from schemas.expressions import ExpressionError, evaluate, is_expression, references


@rule("xosc.toolchain:xosc:1.1.0:expressions.expression_has_a_value", kinds=("scenario", "catalog"), since=(1, 1))
def check(document: Document) -> Iterator[Finding]:
    """An expression must have a value with the parameters' defaults: no division by zero, no text in a sum, no overflow.

    Malformed expressions, undeclared parameters and defaults of the wrong type are the business of other rules.
    """
    for element, attribute, text in document.parametrised():
        try:
            usable = is_expression(text) and all(_has_value(document, element, name) for name in references(text))
        except ExpressionError:
            continue
        if not usable:
            continue
        try:
            evaluate(text, document.lookup(element))
        except ExpressionError as error:
            yield Finding(element, f"{attribute}: {error.message}")


def _has_value(document: Document, element: etree._Element, name: str) -> bool:
    try:
        document.lookup(element)(name)
    except KeyError:
        return False
    return True
