"""Numbers of roads are of this world."""

from collections.abc import Iterator

from schemas.checks.document import Document
from schemas.checks.registry import Finding, rule

LARGEST = 1e12
"""Largest number that is accepted; the reader of roads refuses more, too."""
_COEFFICIENTS = {
    "elevation": tuple("abcd"),
    "superelevation": tuple("abcd"),
    "laneOffset": tuple("abcd"),
    "shape": tuple("abcd"),
    "width": tuple("abcd"),
    "border": tuple("abcd"),
    "poly3": tuple("abcd"),
    "paramPoly3": tuple(letter + axis for axis in "UV" for letter in "abcd"),
}


@rule("xosc.toolchain:xodr:1.4.0:numbers_are_plausible")
def check(document: Document) -> Iterator[Finding]:
    """Coefficients of polynomials must be numbers up to 1e12; exporters write others for stretches of some micrometres."""
    for tag, names in _COEFFICIENTS.items():
        for element in document.elements(tag):
            for name in names:
                value = document.number(element, name)
                if value is not None and not abs(value) <= LARGEST:
                    yield Finding(element, f"{name}={element.get(name)} is no number up to {LARGEST:g}")
