"""Default values obey the constraints."""

from collections.abc import Iterator

from lxml import etree

from schemas.checks.document import Document
from schemas.checks.registry import Finding, rule
from schemas.values import holds, typed


@rule("xosc.toolchain:xosc:1.1.0:parameters.default_value_obeys_constraints", kinds=("scenario", "catalog"), since=(1, 1))
def check(document: Document) -> Iterator[Finding]:
    """The default value of a parameter must satisfy all constraints of at least one of its constraint groups."""
    for declaration in document.elements("ParameterDeclaration"):
        groups = declaration.findall("ConstraintGroup")
        value = document.value(declaration, "value")
        if not groups or value is None or not _is_typed(document, declaration, value):
            continue
        name = declaration.get("name")
        try:
            broken = [_broken(document, declaration, value, group) for group in groups]
        except ValueError as error:
            yield Finding(declaration, f"{name}: the constraint has no meaning: {error}")
            continue
        if all(broken):
            reasons = " or ".join(filter(None, broken))
            yield Finding(declaration, f"{name}: the default value {value!r} is not {reasons}")


def _is_typed(document: Document, declaration: etree._Element, value: str) -> bool:
    """Whether the value is of the declared type, which is the business of another rule."""
    try:
        typed(document.type_of(declaration), value)
    except ValueError:
        return False
    return True


def _broken(document: Document, declaration: etree._Element, value: str, group: etree._Element) -> str | None:
    """The first constraint of a group that a value breaks, in words; None where it satisfies all that can be decided.

    Raises:
        ValueError: a constraint cannot be compared with values of the declared type.
    """
    for constraint in group.findall("ValueConstraint"):
        rule_name, limit = document.value(constraint, "rule"), document.value(constraint, "value")
        if rule_name is not None and limit is not None and not satisfies(document, declaration, value, rule_name, limit):
            return f"{rule_name} {limit}"
    return None


def satisfies(document: Document, declaration: etree._Element, value: str, rule_name: str, limit: str) -> bool:
    """Whether a value of a declared parameter compares to a limit as a rule of the standard says.

    Raises:
        ValueError: one of them is not of the declared type, or the rule has no meaning for it.
    """
    kind = document.type_of(declaration)
    return holds(rule_name, typed(kind, value), typed(kind, limit))
