"""Conditions can become true, and change where an edge is asked for."""

from collections.abc import Iterator

from lxml import etree

from schemas.checks.document import Document
from schemas.checks.registry import Finding, rule
from schemas.rules.parameter_constraints import satisfies
from schemas.xml import local_name

_MAGNITUDES = {
    "TimeToCollisionCondition": "a time to collision",
    "TimeHeadwayCondition": "a time headway",
    "DistanceCondition": "a distance",
    "RelativeDistanceCondition": "a distance",
    "TraveledDistanceCondition": "a travelled distance",
    "SimulationTimeCondition": "the simulation time",
}
_EDGES = ("rising", "falling", "risingOrFalling")


@rule("xosc.toolchain:xosc:1.0.0:scenario_logic.condition_is_not_constant", level="warning", kinds=("scenario",))
def check(document: Document) -> Iterator[Finding]:
    """A condition should be able to become true, and must not be constant where it waits for an edge.

    Parameters count with their default values; that one is false by default is for the record, since it may be varied.
    """
    for condition in document.elements("Condition"):
        edge = document.value(condition, "conditionEdge")
        for element in condition.iter(*_MAGNITUDES, "ParameterCondition"):
            truth, reason = _constant(document, element) or (True, "")
            if reason and edge in _EDGES:
                yield Finding(element, f"never fires: {reason}, so there is no {edge} edge")
            elif not truth:
                yield Finding(element, f"never fires: {reason}", "info" if local_name(element) == "ParameterCondition" else None)


@rule("xosc.toolchain:xosc:1.0.0:scenario_logic.start_trigger_is_not_empty", level="info", kinds=("scenario",))
def check_empty(document: Document) -> Iterator[Finding]:
    """A start trigger should have a condition: the standard gives an empty one no meaning (7.6.1).

    The runner takes it as if it was absent.
    """
    for trigger in document.elements("StartTrigger"):
        if trigger.find("ConditionGroup") is None:
            yield Finding(trigger, "the start trigger has no condition, so its element starts at once; leave it out to say so")


def _constant(document: Document, element: etree._Element) -> tuple[bool, str] | None:
    """What a condition always is, and why; None where it can change."""
    if local_name(element) == "ParameterCondition":
        return _parameter_condition(document, element)
    rule_name, value = document.value(element, "rule"), document.number(element, "value")
    if local_name(element) == "TraveledDistanceCondition":
        rule_name = "greaterOrEqual"
    if value is None:
        return None
    what = _MAGNITUDES[local_name(element)]
    if (rule_name == "lessThan" and value <= 0) or (rule_name in ("lessOrEqual", "equalTo") and value < 0):
        return False, f"{what} is never {rule_name} {value:g}"
    if (rule_name == "greaterOrEqual" and value <= 0) or (rule_name in ("greaterThan", "notEqualTo") and value < 0):
        return True, f"{what} is always {rule_name} {value:g}"
    return None


def _parameter_condition(document: Document, element: etree._Element) -> tuple[bool, str] | None:
    """Parameters change only by a ParameterAction (of OpenSCENARIO 1.0 to 1.2)."""
    name = (document.value(element, "parameterRef") or "").removeprefix("$")
    declaration = document.declaration(document.root, name)
    actions = document.elements("ParameterAction")
    changed = {(document.value(action, "parameterRef") or "").removeprefix("$") for action in actions}
    if declaration is None or name in changed:
        return None
    rule_name, limit, value = element.get("rule") or "", document.value(element, "value"), document.value(declaration, "value")
    if limit is None or value is None:
        return None
    try:
        truth = satisfies(document, declaration, value, rule_name, limit)
    except ValueError:
        return None
    return truth, f"the parameter {name} is {value!r} by default and no action changes it"
