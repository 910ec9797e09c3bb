"""Expressions are written with the operators of the standard."""

from collections.abc import Iterator

from schemas.checks.document import Document
from schemas.checks.registry import Finding, rule
from schemas.expressions import FIRST_VERSION, FUNCTIONS, ExpressionError, functions, is_expression


@rule("asam.net:xosc:1.2.0:data_type.allowed_operators", kinds=("scenario", "catalog"))
def check(document: Document) -> Iterator[Finding]:
    """Expressions must be well-formed and use only the operators and functions that the file's version of the standard has.

    OpenSCENARIO 1.0 has no expressions. Functions that came later than the file's version are warnings: tools know them.
    """
    for element, attribute, text in document.parametrised():
        if not is_expression(text):
            continue
        try:
            called = functions(text)
        except ExpressionError as error:
            yield Finding(element, f"{attribute}: {error.message}")
            continue
        if document.type.version < FIRST_VERSION:
            yield Finding(element, f"{attribute}={text!r}: expressions exist since OpenSCENARIO 1.1")
        for name in sorted(called):
            since = FUNCTIONS[name].since
            if FIRST_VERSION <= document.type.version < since:
                version = ".".join(map(str, since))
                yield Finding(element, f"{attribute}={text!r}: {name} exists since OpenSCENARIO {version}", "warning")
