"""Distributions vary parameters that the scenario has, by ranges and weights that make sense."""

from __future__ import annotations

from collections.abc import Iterator

from lxml import etree

from schemas.checks.document import Document
from schemas.checks.findings import negative, unknown
from schemas.checks.registry import Finding, rule
from schemas.errors import InvalidFile
from schemas.xml import parse


@rule("xosc.toolchain:xosc:1.1.0:reference_control.distributed_parameter_is_declared", kinds=("distribution",), since=(1, 1))
def distributed_parameter_is_declared(document: Document) -> Iterator[Finding]:
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


_WEIGHTS = (
    ("Element", "weight"),
    ("Bin", "weight"),
    ("NormalDistribution", "variance"),
    ("LogNormalDistribution", "variance"),
    ("PoissonDistribution", "expectedValue"),
)


@rule("xosc.toolchain:xosc:1.1.0:data_type.distributions_are_well_formed", kinds=("distribution",), since=(1, 1))
def ranges_and_weights_are_well_formed(document: Document) -> Iterator[Finding]:
    """Limits of ranges must ascend, step widths be positive, and weights, variances and expected counts not negative."""
    for element in document.elements("Range"):
        lower, upper = document.number(element, "lowerLimit"), document.number(element, "upperLimit")
        if lower is not None and upper is not None and not lower <= upper:
            yield Finding(element, f"the lower limit {lower:g} is greater than the upper limit {upper:g}")
    for element in document.elements("DistributionRange"):
        step = document.number(element, "stepWidth")
        if step is not None and not step > 0:
            yield Finding(element, f"stepWidth={step:g} must be greater than 0")
    yield from negative(document, _WEIGHTS)
