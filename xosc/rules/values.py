"""Values are of their type and obey their constraints; expressions have a value; durations and
distances are not negative."""

from __future__ import annotations

from collections.abc import Iterator

from lxml import etree

from schemas.checks.document import CheckedDocument
from schemas.checks.registry import Finding, negative, rule
from schemas.common.xml import local_name
from schemas.expressions import (
    FIRST_VERSION,
    FUNCTIONS,
    ExpressionError,
    evaluate,
    functions,
    is_expression,
    references,
)
from schemas.expressions.values import TYPES, holds, typed
from xosc.rules.parameters import scenario_of


@rule(
    "asam.net:xosc:1.0.0:parameters.parameter_declaration_parameter_type_inference",
    kinds=("scenario", "catalog"),
)
def default_is_of_the_declared_type(document: CheckedDocument) -> Iterator[Finding]:
    """The value of a ParameterDeclaration or VariableDeclaration must be of the declared type.

    A warning in a catalogue, where it matters only if the entry is used with its default.
    """
    for element in document.elements("ParameterDeclaration", "VariableDeclaration"):
        text = document.value(element, "value")
        try:
            kind = document.type_of(element)
        except ValueError:
            continue  # no type of the standard: the rule valid_schema says so
        if text is None:
            continue
        try:
            typed(kind, text)
        except ValueError as error:
            level = "warning" if document.type.kind == "catalog" else None
            yield Finding(
                element, f"{element.get('name')}: the value is not of type {kind}: {error}", level
            )


DECLARED_TYPE_UID = "xosc.toolchain:xosc:1.0.0:parameters.value_is_of_the_declared_type"
_REFERENCES = {"Parameter": "parameterRef", "Variable": "variableRef"}


@rule(DECLARED_TYPE_UID, kinds=("scenario", "distribution"))
def value_is_of_the_declared_type(document: CheckedDocument) -> Iterator[Finding]:
    """A value that a parameter or variable is compared with, or set to, must be of its declared
    type."""
    yield from _distributed(document)
    for family, attribute in _REFERENCES.items():
        declared = {
            document.value(declaration, "name"): declaration
            for declaration in document.elements(f"{family}Declaration")
        }
        # Of the whole scenario: conditions and actions reach no other declarations.
        for element, holder in _uses(document, family):
            name, text = (
                (document.value(holder, attribute) or "").removeprefix("$"),
                document.value(element, "value"),
            )
            if name not in declared or text is None:
                continue
            try:
                kind = document.type_of(declared[name])
            except ValueError:
                continue  # no type of the standard: the rule valid_schema says so
            try:
                typed(kind, text)
            except ValueError as error:
                yield Finding(element, f"{name}: the value is not of type {kind}: {error}")


def _uses(
    document: CheckedDocument, family: str
) -> Iterator[tuple[etree._Element, etree._Element]]:
    """Elements with a value, and the elements that name its subject."""
    for condition in document.elements(f"{family}Condition"):
        yield condition, condition
    for action in document.elements("SetAction"):
        holder = action.getparent()
        # SetAction is a child of ParameterAction and of VariableAction alike.
        if holder is not None and local_name(holder) == f"{family}Action":
            yield action, holder


def _distributed(document: CheckedDocument) -> Iterator[Finding]:
    """Values that a distribution lists for parameters of its scenario."""
    # The types are in another file: without it nothing is known of the values.
    scenario = scenario_of(document) if document.type.kind == "distribution" else None
    declared = (
        scenario.iterfind("ParameterDeclarations/ParameterDeclaration")
        if scenario is not None
        else ()
    )
    types = {declaration.get("name"): declaration.get("parameterType") for declaration in declared}
    for holder, _, name in document.values("parameterName", "parameterRef"):
        kind = types.get(name)
        # A ParameterAssignment has its value itself, a distribution has them in Elements.
        for element in (holder, *holder.iter("{*}Element")) if kind in TYPES else ():
            text = document.value(element, "value")
            try:
                typed(str(kind), text or "")
            except ValueError as error:
                if text is not None:
                    yield Finding(element, f"{name}: the value is not of type {kind}: {error}")


@rule(
    "xosc.toolchain:xosc:1.1.0:parameters.default_value_obeys_constraints",
    kinds=("scenario", "catalog"),
    since=(1, 1),
)
def default_obeys_constraints(document: CheckedDocument) -> Iterator[Finding]:
    """The default value of a parameter must satisfy all constraints of at least one of its
    constraint groups."""
    for declaration in document.elements("ParameterDeclaration"):
        groups = declaration.findall("ConstraintGroup")
        value = document.value(declaration, "value")
        # Groups are alternatives; the constraints within one hold together.
        if not groups or value is None or not _is_typed(document, declaration, value):
            continue
        name = declaration.get("name")
        try:
            broken = [_broken(document, declaration, value, group) for group in groups]
        except ValueError as error:
            yield Finding(declaration, f"{name}: the constraint has no meaning: {error}")
            continue
        # Each group without a broken constraint is None here, and one of them is enough.
        if all(broken):
            reasons = " or ".join(filter(None, broken))
            yield Finding(declaration, f"{name}: the default value {value!r} is not {reasons}")


def _is_typed(document: CheckedDocument, declaration: etree._Element, value: str) -> bool:
    """Whether the value is of the declared type, which is the business of another rule."""
    try:
        typed(document.type_of(declaration), value)
    except ValueError:
        return False
    return True


def _broken(
    document: CheckedDocument, declaration: etree._Element, value: str, group: etree._Element
) -> str | None:
    """The first constraint of a group that a value breaks, in words; None where it satisfies all
    that can be decided.

    Raises:
        ValueError: a constraint cannot be compared with values of the declared type.
    """
    for constraint in group.findall("ValueConstraint"):
        rule_name, limit = document.value(constraint, "rule"), document.value(constraint, "value")
        if (
            rule_name is not None
            and limit is not None
            and not satisfies(document, declaration, value, rule_name, limit)
        ):
            return f"{rule_name} {limit}"
    return None


def satisfies(
    document: CheckedDocument, declaration: etree._Element, value: str, rule_name: str, limit: str
) -> bool:
    """Whether a value of a declared parameter compares to a limit as a rule of the standard says.

    Raises:
        ValueError: one of them is not of the declared type, or the rule has no meaning for it.
    """
    kind = document.type_of(declaration)
    return holds(rule_name, typed(kind, value), typed(kind, limit))


@rule("asam.net:xosc:1.2.0:data_type.allowed_operators", kinds=("scenario", "catalog"))
def expression_has_allowed_operators(document: CheckedDocument) -> Iterator[Finding]:
    """Expressions must be well-formed and use only the operators and functions that the file's
    version of the standard has.

    OpenSCENARIO 1.0 has no expressions. Functions that came later than the file's version are
    warnings: tools know them.
    """
    for element, attribute, text in document.parametrised():
        if not is_expression(text):
            continue
        try:
            # Parsed, not evaluated: whether it has a value is the next rule's question.
            called = functions(text)
        except ExpressionError as error:
            yield Finding(element, f"{attribute}: {error.message}")
            continue
        if document.type.version < FIRST_VERSION:
            yield Finding(
                element, f"{attribute}={text!r}: expressions exist since OpenSCENARIO 1.1"
            )
        for name in sorted(called):
            since = FUNCTIONS[name].since
            if FIRST_VERSION <= document.type.version < since:
                version = ".".join(map(str, since))
                yield Finding(
                    element,
                    f"{attribute}={text!r}: {name} exists since OpenSCENARIO {version}",
                    "warning",
                )


@rule(
    "xosc.toolchain:xosc:1.1.0:expressions.expression_has_a_value",
    kinds=("scenario", "catalog"),
    since=(1, 1),
)
def expression_has_a_value(document: CheckedDocument) -> Iterator[Finding]:
    """An expression must have a value with the parameters' defaults: no division by zero, no text
    in a sum, no overflow.

    Malformed expressions, undeclared parameters and defaults of the wrong type are the business of
    other rules.
    """
    for element, attribute, text in document.parametrised():
        try:
            # A plain `$name` is no expression: that its parameter exists is another rule's
            # business.
            usable = is_expression(text) and all(
                _has_value(document, element, name) for name in references(text)
            )
        except ExpressionError:
            continue
        if not usable:
            continue
        try:
            evaluate(text, document.lookup(element))
        except ExpressionError as error:
            yield Finding(element, f"{attribute}: {error.message}")


def _has_value(document: CheckedDocument, element: etree._Element, name: str) -> bool:
    try:
        document.lookup(element)(name)
    except KeyError:
        return False
    return True


NOT_NEGATIVE_UID = "xosc.toolchain:xosc:1.0.0:data_type.durations_and_radii_are_not_negative"

_DURATIONS = (
    ("StandStillCondition", "duration"),
    ("EndOfRoadCondition", "duration"),
    ("OffroadCondition", "duration"),
    ("OffRoadCondition", "duration"),
    ("LongitudinalDistanceAction", "timeGap"),
    ("AnimationAction", "animationDuration"),
    ("TrafficSignalController", "delay"),
    ("SpeedProfileEntry", "time"),
    ("TrafficSwarmAction", "innerRadius"),
    ("TrafficSwarmAction", "semiMajorAxis"),
    ("TrafficSwarmAction", "semiMinorAxis"),
)


@rule(NOT_NEGATIVE_UID)
def durations_are_not_negative(document: CheckedDocument) -> Iterator[Finding]:
    """Durations, time gaps, delays and radii must be non-negative."""
    return negative(document, _DURATIONS)


_DISTANCES = (
    ("LongitudinalDistanceAction", "distance"),
    ("LateralDistanceAction", "distance"),
    ("RelativeClearanceCondition", "distanceForward"),
    ("RelativeClearanceCondition", "distanceBackward"),
)


@rule("asam.net:xosc:1.1.0:data_type.distances_are_not_negative", since=(1, 1))
def distances_are_not_negative(document: CheckedDocument) -> Iterator[Finding]:
    """Distances of actions and conditions shall be non-negative; directions are said by other
    attributes."""
    return negative(document, _DISTANCES)


@rule("asam.net:xosc:1.0.0:data_type.condition_delay_not_negative")
def condition_delay_is_not_negative(document: CheckedDocument) -> Iterator[Finding]:
    """The delay of a Condition shall be non-negative."""
    return negative(document, [("Condition", "delay")])


@rule(
    "asam.net:xosc:1.2.0:data_type.non_negative_transition_time_in_light_state_action", since=(1, 2)
)
def light_transition_time_is_not_negative(document: CheckedDocument) -> Iterator[Finding]:
    """The transitionTime of a LightStateAction shall be non-negative."""
    return negative(document, [("LightStateAction", "transitionTime")])


@rule("xosc.toolchain:xosc:1.0.0:data_type.transition_value_is_not_negative", level="warning")
def transition_value_is_not_negative(document: CheckedDocument) -> Iterator[Finding]:
    """The value of TransitionDynamics, a time, a distance or a rate by its dimension, must be
    non-negative.

    A warning: players commonly take the magnitude of a negative rate.
    """
    return negative(
        document, [(tag, "value") for tag in ("SpeedActionDynamics", "LaneChangeActionDynamics")]
    )
