"""Relative lane positions say how far away they are."""

from collections.abc import Iterator

from schemas.checks.document import Document
from schemas.checks.registry import Finding, rule

UID = "xosc.toolchain:xosc:1.1.0:positioning.relative_lane_position_has_one_distance"


@rule(UID, kinds=("scenario", "catalog"), since=(1, 1))
def check(document: Document) -> Iterator[Finding]:
    """A RelativeLanePosition must have one of the attributes ds and dsLane, and only one."""
    for element in document.elements("RelativeLanePosition"):
        given = [name for name in ("ds", "dsLane") if element.get(name) is not None]
        if len(given) != 1:
            yield Finding(element, f"{' and '.join(given) or 'neither ds nor dsLane'} given, one of the two is expected")
