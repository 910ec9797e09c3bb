"""Default values obey the constraints."""

import operator
from collections.abc import Callable, Iterator
from typing import Any

from lxml import etree

from schemas.rules.document import Document
from schemas.rules.registry import Finding, rule

COMPARISONS: dict[str, Callable[[Any, Any], bool]] = {
    "equalTo": operator.eq,
    "notEqualTo": operator.ne,
    "greaterThan": operator.gt,
    "greaterOrEqual": operator.ge,
    "lessThan": operator.lt,
    "lessOrEqual": operator.le,
}


@rule("xosc.toolchain:xosc:1.1.0:parameters.default_value_obeys_constraints", kinds=("scenario", "catalog"), since=(1, 1))
def check(document: Document) -> Iterator[Finding]:
    """The default value of a parameter must satisfy all constraints of at least one of its constraint groups."""
    for declaration in document.elements("ParameterDeclaration"):
        groups = declaration.findall("ConstraintGroup")
        value = document.value(declaration, "value")
        if not groups or value is None:
            continue
        broken = [_broken(document, value, group) for group in groups]
        if all(broken):
            reasons = " or ".join(filter(None, broken))
            yield Finding(declaration, f"{declaration.get('name')}: the default value {value!r} is not {reasons}")


def _broken(document: Document, value: str, group: etree._Element) -> str | None:
    """The first constraint of a group that a value breaks, in words; None where it satisfies all that can be decided."""
    for constraint in group.findall("ValueConstraint"):
        rule_name, limit = constraint.get("rule") or "", document.value(constraint, "value")
        if limit is not None and rule_name in COMPARISONS and not satisfies(value, rule_name, limit):
            return f"{rule_name} {limit}"
    return None


def satisfies(value: str, rule_name: str, limit: str) -> bool:
    """Whether a value compares to a limit as a rule of the standard says: as numbers where both are, else as text."""
    try:
        return COMPARISONS[rule_name](float(value), float(limit))
    except ValueError:
        return COMPARISONS[rule_name](value, limit)
