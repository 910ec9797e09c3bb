"""NURBS have as many knots as they need."""

from collections.abc import Iterator

from schemas.checks.document import Document
from schemas.checks.registry import Finding, rule


@rule("xosc.toolchain:xosc:1.0.0:routing.nurbs_knots_fit_order")
def check(document: Document) -> Iterator[Finding]:
    """A Nurbs must have at least as many control points as its order, and one knot for each point and each order, ascending."""
    for element in document.elements("Nurbs"):
        order = document.number(element, "order")
        points, knots = len(element.findall("ControlPoint")), element.findall("Knot")
        if order is None:
            continue
        if points < order:
            yield Finding(element, f"{points} control points are fewer than the order {order:g}")
        elif len(knots) != points + order:
            yield Finding(element, f"{len(knots)} knots, but {points} control points of order {order:g} need {points + order:g}")
        values = [value for knot in knots if (value := document.number(knot, "value")) is not None]
        if values != sorted(values):
            yield Finding(element, "the knots must ascend")
