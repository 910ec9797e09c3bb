"""Parameters, variables and monitors are declared once, and where they are used; distributions vary
declared parameters."""

from __future__ import annotations

from collections.abc import Iterator

from lxml import etree

from schemas.checks.document import CheckedDocument
from schemas.checks.registry import Finding, negative, on_cycles, rule, unknown, unresolved
from schemas.common.errors import InvalidFile
from schemas.common.xml import canonical, line_of, parse
from schemas.expressions import ExpressionError, references

DECLARED_NAME_UID = "xosc.toolchain:xosc:1.0.0:parameters.declared_name_is_a_name"


@rule(DECLARED_NAME_UID, kinds=("scenario", "catalog"))
def declared_name_is_a_name(document: CheckedDocument) -> Iterator[Finding]:
    """A declared parameter, variable or monitor must be named without `$`, which
    marks references.
    """
    for element in document.elements(
        "ParameterDeclaration", "VariableDeclaration", "MonitorDeclaration"
    ):
        name = element.get("name") or ""
        # Files of 1.0 write `$name` where a parameter is used; in the declaration it would be part
        # of the name.
        if "$" in name:
            yield Finding(element, f"the declared name {name!r} must be written without '$'")


UNIQUE_DECLARATIONS_UID = "xosc.toolchain:xosc:1.0.0:parameters.declarations_are_unique"


@rule(UNIQUE_DECLARATIONS_UID, kinds=("scenario", "catalog"))
def declarations_are_unique(document: CheckedDocument) -> Iterator[Finding]:
    """A parameter, variable or monitor must not be declared twice and differently in the same
    place."""
    for declarations in document.elements(
        "ParameterDeclarations", "VariableDeclarations", "MonitorDeclarations"
    ):
        first: dict[str, etree._Element] = {}
        for element in declarations.iterchildren(etree.Element):
            name = element.get("name") or ""
            earlier = first.setdefault(name, element)
            # Files repeat declarations; two that say the same leave nothing open.
            if canonical(earlier) != canonical(element):
                yield Finding(
                    element,
                    f"{name!r} is declared twice and differently, first in line {line_of(earlier)}",
                )


@rule("xosc.toolchain:xosc:1.0.0:parameters.no_cyclic_definitions", kinds=("scenario", "catalog"))
def definitions_are_not_cyclic(document: CheckedDocument) -> Iterator[Finding]:
    """The default value of a parameter must not depend on the parameter itself, directly or through
    others."""
    # By declaration, not by name: an inner parameter may take its value from an outer one of its
    # name.
    uses = {
        declaration: _parameters_in(document, declaration)
        for declaration in document.elements("ParameterDeclaration")
    }
    for declaration in on_cycles(uses):
        yield Finding(
            declaration,
            f"the value {declaration.get('value')!r} of "
            f"{declaration.get('name')} depends on itself",
        )


def _parameters_in(document: CheckedDocument, declaration: etree._Element) -> list[etree._Element]:
    try:
        # Broken expressions are for the rules on values.
        names = references(declaration.get("value") or "")
    except ExpressionError:
        return []
    return [used for name in names if (used := document.declaration(declaration, name)) is not None]


@rule(
    "xosc.toolchain:xosc:1.0.0:reference_control.resolvable_parameter_reference",
    kinds=("scenario",),
)
def parameter_reference_is_declared(document: CheckedDocument) -> Iterator[Finding]:
    """The parameterRef of a condition or an action must name a parameter declared for the whole
    scenario."""
    for tag in ("ParameterCondition", "ParameterAction"):
        for element in document.elements(tag):
            name = document.value(element, "parameterRef")
            if (
                name is not None
                # Files of version 1.0 write the name with a `$` (see `_used`).
                and document.declaration(document.root, name.removeprefix("$")) is None
            ):
                yield Finding(
                    element,
                    "parameterRef: "
                    f"{unknown('parameter', name, document.names('ParameterDeclaration'))}",
                )


@rule("asam.net:xosc:1.1.0:parameters.parameter_declaration_parameter_scope", kinds=("scenario",))
def used_parameter_is_in_scope(document: CheckedDocument) -> Iterator[Finding]:
    """A parameter may be used only within the element that declares it."""
    return _undeclared(document)


@rule("asam.net:xosc:1.2.0:parameters.valid_parameter_declaration_in_catalogs", kinds=("catalog",))
def parameter_of_catalog_entry_has_a_default(document: CheckedDocument) -> Iterator[Finding]:
    """A parameter used in a catalogue entry shall be declared in that entry,
    with a default value.
    """
    yield from _undeclared(document)
    for element, attribute, name in _used(document):
        declaration = document.declaration(element, name)
        if (
            declaration is not None
            and not declaration.get("value")
            # An empty text is a default too, of a string.
            and declaration.get("parameterType") != "string"
        ):
            yield Finding(
                element, f"{attribute}: the parameter {name!r} is declared without a default value"
            )


def _undeclared(document: CheckedDocument) -> Iterator[Finding]:
    """A finding for each parameter that an attribute uses and no declaration in scope declares."""
    for element, attribute, name in _used(document):
        if document.declaration(element, name) is None:
            # Of any scope: a name that is declared elsewhere is the likeliest slip.
            known = document.names("ParameterDeclaration")
            yield Finding(
                element,
                f"{attribute}={element.get(attribute)!r}: "
                f"{unknown('parameter', name, known)} in scope here",
            )


def _used(document: CheckedDocument) -> Iterator[tuple[etree._Element, str, str]]:
    """Each parameter that an attribute uses: the element, the attribute, the parameter's name."""
    for element, attribute, text in document.parametrised():
        if attribute == "parameterRef":  # names a parameter, as files of version 1.0 write it
            continue
        try:
            names = references(text)
        except ExpressionError:
            continue
        # In a fixed order, for the same report each time.
        yield from ((element, attribute, name) for name in sorted(names))


@rule(
    "asam.net:xosc:1.2.0:reference_control.resolvable_variable_reference",
    kinds=("scenario",),
    since=(1, 2),
)
def variable_reference_is_declared(document: CheckedDocument) -> Iterator[Finding]:
    """A variableRef must name something that the scenario declares."""
    # The name of a parameter is the fault of the rule below, and told there alone.
    declared = document.names("VariableDeclaration"), document.names("ParameterDeclaration")
    return unresolved(document, "variable", frozenset().union(*declared), "variableRef")


@rule(
    "xosc.toolchain:xosc:1.2.0:reference_control.variable_is_no_parameter",
    kinds=("scenario",),
    since=(1, 2),
)
def variable_is_no_parameter(document: CheckedDocument) -> Iterator[Finding]:
    """A variableRef must not name a parameter: parameters keep their values
    while a scenario runs.
    """
    parameters = frozenset(document.names("ParameterDeclaration")) - frozenset(
        document.names("VariableDeclaration")
    )
    for element, attribute, name in document.values("variableRef"):
        if name in parameters:
            yield Finding(
                element,
                f"{attribute}: {name!r} is a parameter, declare it as a variable to change it",
            )


@rule(
    "xosc.toolchain:xosc:1.3.0:reference_control.resolvable_monitor_reference",
    kinds=("scenario",),
    since=(1, 3),
)
def monitor_reference_is_declared(document: CheckedDocument) -> Iterator[Finding]:
    """A monitorRef must name a MonitorDeclaration of the scenario."""
    return unresolved(document, "monitor", document.names("MonitorDeclaration"), "monitorRef")


@rule(
    "xosc.toolchain:xosc:1.1.0:reference_control.distributed_parameter_is_declared",
    kinds=("distribution",),
    since=(1, 1),
)
def distributed_parameter_is_declared(document: CheckedDocument) -> Iterator[Finding]:
    """A parameter of a ParameterValueDistribution must be declared by the
    scenario that it is for.
    """
    scenario = scenario_of(document)
    if scenario is None:
        return
    # Of the whole scenario alone: a distribution can't reach what a maneuver or an entry declares.
    declared = {
        element.get("name") or ""
        for element in scenario.iterfind("ParameterDeclarations/ParameterDeclaration")
    }
    for element, attribute, name in document.values("parameterName", "parameterRef"):
        if name not in declared:
            yield Finding(
                element, f"{attribute}: {unknown('parameter', name, declared)} in the scenario"
            )


def scenario_of(document: CheckedDocument) -> etree._Element | None:
    """The root of the scenario that a distribution is for; None where it can't be read."""
    # One alone by the XSD; without it, its own rules tell what is wrong.
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


@rule(
    "xosc.toolchain:xosc:1.1.0:data_type.distributions_are_well_formed",
    kinds=("distribution",),
    since=(1, 1),
)
def ranges_and_weights_are_well_formed(document: CheckedDocument) -> Iterator[Finding]:
    """Limits of ranges must ascend, step widths be positive, and weights, variances and expected
    counts not negative."""
    for element in document.elements("Range"):
        lower, upper = (
            document.number(element, "lowerLimit"),
            document.number(element, "upperLimit"),
        )
        # `not <=`, here and below, since NaN compares false with everything and is caught too.
        if lower is not None and upper is not None and not lower <= upper:
            yield Finding(
                element, f"the lower limit {lower:g} is greater than the upper limit {upper:g}"
            )
    for element in document.elements("DistributionRange"):
        step = document.number(element, "stepWidth")
        if step is not None and not step > 0:
            yield Finding(element, f"stepWidth={step:g} must be greater than 0")
    yield from negative(document, _WEIGHTS)
