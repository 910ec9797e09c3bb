"""Lane offsets that are kept are not counted from themselves."""

from collections.abc import Iterator

from lxml import etree

from schemas.checks.document import Document
from schemas.checks.registry import Finding, rule

UID = "xosc.toolchain:xosc:1.0.0:actions.kept_lane_offset_is_from_another_entity"


@rule(UID, kinds=("scenario",))
def check(document: Document) -> Iterator[Finding]:
    """A continuous LaneOffsetAction must not keep an offset from its own actor's: that would run away."""
    for action in document.elements("LaneOffsetAction"):
        target = action.find("LaneOffsetTarget/RelativeTargetLaneOffset")
        if target is None or document.value(action, "continuous") not in ("true", "1") or not document.number(target, "value"):
            continue
        name = document.value(target, "entityRef")
        if name is not None and name in _actors(document, action):
            yield Finding(target, f"{name!r} can't keep an offset from its own lane offset")


def _actors(document: Document, action: etree._Element) -> set[str | None]:
    """Names of the entities that a private action is for."""
    for above in action.iterancestors("Private", "ManeuverGroup"):
        return {document.value(actor, "entityRef") for actor in (above, *above.iterfind("Actors/EntityRef"))}
    return set()
