"""Variables that are referred to exist."""

from collections.abc import Iterator

from schemas.checks.document import Document
from schemas.checks.messages import unresolved
from schemas.checks.registry import Finding, rule


@rule("asam.net:xosc:1.2.0:reference_control.resolvable_variable_reference", kinds=("scenario",), since=(1, 2))
def check(document: Document) -> Iterator[Finding]:
    """A variableRef must name something that the scenario declares."""
    declared = document.names("VariableDeclaration"), document.names("ParameterDeclaration")
    return unresolved(document, "variable", frozenset().union(*declared), "variableRef")


@rule("xosc.toolchain:xosc:1.2.0:reference_control.variable_is_no_parameter", kinds=("scenario",), since=(1, 2))
def check_parameters(document: Document) -> Iterator[Finding]:
    """A variableRef must not name a parameter: parameters keep their values while a scenario runs."""
    parameters = frozenset(document.names("ParameterDeclaration")) - frozenset(document.names("VariableDeclaration"))
    for element, attribute, name in document.values("variableRef"):
        if name in parameters:
            yield Finding(element, f"{attribute}: {name!r} is a parameter, declare it as a variable to change it")
