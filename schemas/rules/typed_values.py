"""Values that parameters and variables are compared with, or set to, are of their type."""

from collections.abc import Iterator

from lxml import etree

from schemas.checks.document import Document
from schemas.checks.registry import Finding, rule
from schemas.rules.distribution_parameters import scenario_of
from schemas.values import TYPES, typed
from schemas.xml import local_name

UID = "xosc.toolchain:xosc:1.0.0:parameters.value_is_of_the_declared_type"
_REFERENCES = {"Parameter": "parameterRef", "Variable": "variableRef"}


@rule(UID, kinds=("scenario", "distribution"))
def check(document: Document) -> Iterator[Finding]:
    """A value that a parameter or variable is compared with, or set to, must be of its declared type."""
    yield from _distributed(document)
    for family, attribute in _REFERENCES.items():
        declared = {document.value(each, "name"): each for each in document.elements(f"{family}Declaration")}
        for element, holder in _uses(document, family):
            name, text = (document.value(holder, attribute) or "").removeprefix("$"), document.value(element, "value")
            if name not in declared or text is None:
                continue
            try:
                kind = document.type_of(declared[name])
            except ValueError:
                continue  # no type of the standard: valid_schema says so
            try:
                typed(kind, text)
            except ValueError as error:
                yield Finding(element, f"{name}: the value is not of type {kind}: {error}")


def _uses(document: Document, family: str) -> Iterator[tuple[etree._Element, etree._Element]]:
    """Elements with a value, and those that name what it is for."""
    for condition in document.elements(f"{family}Condition"):
        yield condition, condition
    for action in document.elements("SetAction"):
        holder = action.getparent()
        if holder is not None and local_name(holder) == f"{family}Action":
            yield action, holder


def _distributed(document: Document) -> Iterator[Finding]:
    """Values that a distribution lists for parameters of its scenario."""
    scenario = scenario_of(document) if document.type.kind == "distribution" else None
    declared = scenario.iterfind("ParameterDeclarations/ParameterDeclaration") if scenario is not None else ()
    types = {each.get("name"): each.get("parameterType") for each in declared}
    for holder, _, name in document.values("parameterName", "parameterRef"):
        kind = types.get(name)
        for element in (holder, *holder.iter("{*}Element")) if kind in TYPES else ():
            text = document.value(element, "value")
            try:
                typed(str(kind), text or "")
            except ValueError as error:
                if text is not None:
                    yield Finding(element, f"{name}: the value is not of type {kind}: {error}")
