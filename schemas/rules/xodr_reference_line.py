"""Reference lines have no gaps."""

from collections.abc import Iterator

from schemas.checks.document import Document
from schemas.checks.registry import Finding, rule

_TOLERANCE = 0.01
"""Metres that the end of one geometry may be away from the start of the next."""


@rule("xosc.toolchain:xodr:1.4.0:road.geometry.reference_line_is_complete")
def check(document: Document) -> Iterator[Finding]:
    """A road must have geometries of positive length that follow each other from s=0 to the road's length."""
    for road in document.elements("road"):
        geometries = road.findall("{*}planView/{*}geometry")
        if not geometries:
            yield Finding(road, "the road has no geometry")
            continue
        end: float | None = 0.0
        for geometry in geometries:
            s, length = document.number(geometry, "s"), document.number(geometry, "length")
            if length is not None and not length > 0:
                yield Finding(geometry, f"length={length:g} must be greater than 0", "warning" if length == 0 else None)
            if s is not None and end is not None and not abs(s - end) <= _TOLERANCE:
                yield Finding(geometry, f"s={s:g}, but the geometry before it ends at {end:g}", "warning")
            end = None if s is None or length is None else s + length
        total = document.number(road, "length")
        if end is not None and total is not None and not abs(total - end) <= _TOLERANCE:
            yield Finding(road, f"length={total:g}, but the geometries end at {end:g}", "warning")
