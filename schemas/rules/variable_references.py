"""Variables that are referred to exist."""

from collections.abc import Iterator

from schemas.checks.document import Document
from schemas.checks.messages import unresolved
from schemas.checks.registry import Finding, rule


@rule("asam.net:xosc:1.2.0:reference_control.resolvable_variable_reference", kinds=("scenario",), since=(1, 2))
def check(document: Document) -> Iterator[Finding]:
    """A variableRef must name a VariableDeclaration of the scenario."""
    return unresolved(document, "variable", document.names("VariableDeclaration"), "variableRef")
