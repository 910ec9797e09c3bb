"""Parameters that conditions and actions refer to exist."""

from collections.abc import Iterator

from schemas.checks.document import Document
from schemas.checks.messages import unknown
from schemas.checks.registry import Finding, rule


@rule("xosc.toolchain:xosc:1.0.0:reference_control.resolvable_parameter_reference", kinds=("scenario",))
def check(document: Document) -> Iterator[Finding]:
    """The parameterRef of a condition or an action must name a parameter declared for the whole scenario."""
    for tag in ("ParameterCondition", "ParameterAction"):
        for element in document.elements(tag):
            name = document.value(element, "parameterRef")
            if name is not None and document.declaration(document.root, name.removeprefix("$")) is None:
                yield Finding(element, f"parameterRef: {unknown('parameter', name, document.names('ParameterDeclaration'))}")
