"""Distributions vary parameters that the scenario has."""

from collections.abc import Iterator

from lxml import etree

from schemas.checks.document import Document
from schemas.checks.messages import unknown
from schemas.checks.registry import Finding, rule
from schemas.errors import InvalidFile
from schemas.xml import parse


@rule("xosc.toolchain:xosc:1.1.0:reference_control.distributed_parameter_is_declared", kinds=("distribution",), since=(1, 1))
def check(document: Document) -> Iterator[Finding]:
    """A parameter of a ParameterValueDistribution must be declared by the scenario that it is for."""
    scenario = scenario_of(document)
    if scenario is None:
        return
    declared = {element.get("name") or "" for element in scenario.iterfind("ParameterDeclarations/ParameterDeclaration")}
    for element, attribute, name in document.values("parameterName", "parameterRef"):
        if name not in declared:
            yield Finding(element, f"{attribute}: {unknown('parameter', name, declared)} in the scenario")


def scenario_of(document: Document) -> etree._Element | None:
    """The root of the scenario that a distribution is for; None where it can't be read."""
    for element in document.elements("ScenarioFile"):
        name = document.value(element, "filepath")
        try:
            return parse(document.file(name)).getroot() if name else None
        except InvalidFile:
            return None
    return None
