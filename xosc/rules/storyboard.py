"""Elements of the storyboard hold what they are there for, conditions can become true and watch
elements that exist."""

from __future__ import annotations

from collections.abc import Iterator

from lxml import etree

from schemas.checks.document import CheckedDocument
from schemas.checks.registry import Finding, rule, unknown
from schemas.common.xml import local_name
from xosc.rules.values import satisfies

EMPTY_ELEMENTS_UID = "xosc.toolchain:xosc:1.0.0:storyboard.elements_are_not_empty"

# Children of which one must be there, by element; attributes and triggers alone do nothing.
_PARTS = {
    "Story": ("Act",),
    "Act": ("ManeuverGroup",),
    "ManeuverGroup": ("Maneuver", "CatalogReference"),
    "Maneuver": ("Event",),
    "Event": ("Action",),
    "Action": ("GlobalAction", "UserDefinedAction", "PrivateAction"),
    "Private": ("PrivateAction",),
    "ConditionGroup": ("Condition",),
    "TriggeringEntities": ("EntityRef",),
    "CollisionCondition": ("EntityRef", "ByType"),
}
CHOICES = (
    "PrivateAction", "GlobalAction", "UserDefinedAction",
    "LongitudinalAction", "LateralAction", "RoutingAction", "ControllerAction", "AppearanceAction",
    "TrailerAction", "EntityAction", "ParameterAction", "VariableAction", "MonitorAction",
    "InfrastructureAction", "TrafficSignalAction", "TrafficAction",
)  # fmt: skip
"""Elements that hold one action of several kinds."""


@rule(EMPTY_ELEMENTS_UID)
def elements_are_not_empty(document: CheckedDocument) -> Iterator[Finding]:
    """A story, act, maneuver group, maneuver, event, action, condition group or collision condition
    must not be empty.

    A maneuver group without maneuvers is information: the XSD allows it, as the XSDs before 1.3
    allow an action without content.
    """
    for element in document.elements(*_PARTS, *CHOICES):
        missing = lacking(element)
        if missing:
            level = "info" if local_name(element) == "ManeuverGroup" else None
            yield Finding(element, f"{missing} is expected inside", level)


def lacking(element: etree._Element) -> str:
    """Return the missing content of an element that is empty by this rule; "" if nothing is
    missing."""
    parts = _PARTS.get(local_name(element), ())
    inside = [local_name(child) for child in element.iterchildren(etree.Element)]
    if parts and not any(name in parts for name in inside):
        return " or ".join(parts)
    return "an action" if local_name(element) in CHOICES and not inside else ""


_WATCHED = {
    "story": "Story",
    "act": "Act",
    "maneuverGroup": "ManeuverGroup",
    "maneuver": "Maneuver",
    "event": "Event",
    "action": "Action",
}
_WATCHED_TAGS = set(_WATCHED.values())


@rule(
    "asam.net:xosc:1.2.0:reference_control.resolvable_storyboard_element_reference",
    kinds=("scenario",),
)
def watched_element_exists(document: CheckedDocument) -> Iterator[Finding]:
    """A storyboardElementRef must name exactly one element of the given type, enclosing ones before
    it (`act::event`)."""
    # By the whole chain of names: equal names are allowed in different parents.
    known: dict[str, list[tuple[str, ...]]] = {tag: [] for tag in _WATCHED_TAGS}
    for storyboard in document.elements("Storyboard"):
        for tag, chain in _walk(document, document, storyboard, ()):
            known[tag].append(chain)
    for element, attribute, reference in document.values("storyboardElementRef"):
        kind = document.value(element, "storyboardElementType") or ""
        chains = known.get(_WATCHED.get(kind, ""))
        # No type of the standard: the XSD says so.
        if chains is None:
            continue
        parts = tuple(reference.split("::"))
        # The end of the chain: enclosing names may be given as far as they are needed.
        matches = sum(chain[-len(parts) :] == parts for chain in chains)
        if matches == 0:
            yield Finding(
                element, f"{attribute}: {unknown(kind, reference, [chain[-1] for chain in chains])}"
            )
        elif matches > 1:
            message = (
                f"{matches} {kind} elements are called {reference!r}; say which with the "
                "enclosing names, like 'act::name'"
            )
            yield Finding(element, f"{attribute}: {message}", "warning")


def _walk(
    document: CheckedDocument,
    source: CheckedDocument,
    parent: etree._Element,
    chain: tuple[str, ...],
) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Element name and chain of names of the storyboard elements below one, those from catalogues
    included."""
    for child in parent.iterchildren(etree.Element):
        tag = local_name(child)
        # From the scenario only: entries that refer to entries could lead round in a circle.
        if (
            tag == "CatalogReference"
            and local_name(parent) == "ManeuverGroup"
            and source is document
        ):
            entry = document.resolvable_entry(child)
            if entry is not None:
                yield from _named(document, document.source(entry), entry.element, chain)
        elif tag in _WATCHED_TAGS:
            yield from _named(document, source, child, chain)


def _named(
    document: CheckedDocument,
    source: CheckedDocument,
    element: etree._Element,
    chain: tuple[str, ...],
) -> Iterator[tuple[str, tuple[str, ...]]]:
    # By the parameters of the file that the element is in: those of a catalogue are its own.
    own = (*chain, source.value(element, "name") or "")
    yield local_name(element), own
    yield from _walk(document, source, element, own)


_MAGNITUDES = {
    "TimeToCollisionCondition": "a time to collision",
    "TimeHeadwayCondition": "a time headway",
    "DistanceCondition": "a distance",
    "RelativeDistanceCondition": "a distance",
    "TraveledDistanceCondition": "a travelled distance",
    "SimulationTimeCondition": "the simulation time",
}
_EDGES = ("rising", "falling", "risingOrFalling")


@rule(
    "xosc.toolchain:xosc:1.0.0:scenario_logic.condition_is_not_constant",
    level="warning",
    kinds=("scenario",),
)
def condition_is_not_constant(document: CheckedDocument) -> Iterator[Finding]:
    """A condition should be able to become true, and must not be constant where it waits for an
    edge.

    Parameters count with their default values; that one is false by default is for the record,
    since it may be varied.
    """
    for condition in document.elements("Condition"):
        edge = document.value(condition, "conditionEdge")
        for element in condition.iter(*_MAGNITUDES, "ParameterCondition"):
            truth, reason = _constant(document, element) or (True, "")
            # The first evaluation is no edge (7.6.3), and a constant condition has no other change.
            if reason and edge in _EDGES:
                yield Finding(element, f"never fires: {reason}, so there is no {edge} edge")
            elif not truth:
                yield Finding(
                    element,
                    f"never fires: {reason}",
                    # A parameter that turns a variant of the scenario on is off by default, and no
                    # fault.
                    "info" if local_name(element) == "ParameterCondition" else None,
                )


@rule(
    "xosc.toolchain:xosc:1.0.0:scenario_logic.start_trigger_is_not_empty",
    level="info",
    kinds=("scenario",),
)
def start_trigger_is_not_empty(document: CheckedDocument) -> Iterator[Finding]:
    """A start trigger should have a condition: the standard gives an empty one no meaning (7.6.1).

    The runner takes it as if it was absent.
    """
    for trigger in document.elements("StartTrigger"):
        if trigger.find("ConditionGroup") is None:
            yield Finding(
                trigger,
                "the start trigger has no condition, so its element starts at once; "
                "leave it out to say so",
            )


def _constant(document: CheckedDocument, element: etree._Element) -> tuple[bool, str] | None:
    """Return the constant value of a condition and the reason; None if the value can change."""
    if local_name(element) == "ParameterCondition":
        return _parameter_condition(document, element)
    rule_name, value = document.value(element, "rule"), document.number(element, "value")
    # It has no attribute `rule`: it holds from its value on.
    if local_name(element) == "TraveledDistanceCondition":
        rule_name = "greaterOrEqual"
    # A limit that is not known decides nothing.
    if value is None:
        return None
    what = _MAGNITUDES[local_name(element)]
    # None of these magnitudes is below 0; at 0 itself a touching or starting run may be.
    if (rule_name == "lessThan" and value <= 0) or (
        rule_name in ("lessOrEqual", "equalTo") and value < 0
    ):
        return False, f"{what} is never {rule_name} {value:g}"
    if (rule_name == "greaterOrEqual" and value <= 0) or (
        rule_name in ("greaterThan", "notEqualTo") and value < 0
    ):
        return True, f"{what} is always {rule_name} {value:g}"
    return None


def _parameter_condition(
    document: CheckedDocument, element: etree._Element
) -> tuple[bool, str] | None:
    """Return the constant value of a ParameterCondition and the reason; None if an action may set
    the parameter."""
    name = (document.value(element, "parameterRef") or "").removeprefix("$")
    declaration = document.declaration(document.root, name)
    actions = document.elements("ParameterAction")
    changed = {
        (document.value(action, "parameterRef") or "").removeprefix("$") for action in actions
    }
    # Changed by any action, whenever it runs: the value is no constant any more.
    if declaration is None or name in changed:
        return None
    rule_name, limit, value = (
        element.get("rule") or "",
        document.value(element, "value"),
        document.value(declaration, "value"),
    )
    if limit is None or value is None:
        return None
    try:
        truth = satisfies(document, declaration, value, rule_name, limit)
    # A wrong type or operator is the business of the rules on values.
    except ValueError:
        return None
    return truth, f"the parameter {name} is {value!r} by default and no action changes it"
