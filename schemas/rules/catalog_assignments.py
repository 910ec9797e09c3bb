"""Catalogue references assign parameters that the entry has."""

from collections.abc import Iterator

from schemas.checks.document import Document
from schemas.checks.messages import unknown
from schemas.checks.registry import Finding, rule


@rule("xosc.toolchain:xosc:1.0.0:parameters.assigned_parameter_is_declared", kinds=("scenario",))
def check(document: Document) -> Iterator[Finding]:
    """A ParameterAssignment of a CatalogReference must name a parameter that the catalogue entry declares."""
    for reference in document.elements("CatalogReference"):
        entry = document.resolvable_entry(reference)
        if entry is None:
            continue
        for assignment in reference.iter("ParameterAssignment"):
            name = (assignment.get("parameterRef") or "").removeprefix("$")
            if name not in entry.parameters:
                yield Finding(assignment, f"parameterRef: {unknown('parameter', name, entry.parameters)} in the catalogue entry")
