"""Required elements that are missing, and whose content is obvious."""

from __future__ import annotations

from collections.abc import Iterator

from lxml import etree

from schemas.remarks import Remark
from schemas.rules.valid_schema import UID
from xosc.node import Node
from xosc.repairs.declared import Child, children

BREAKS_SCHEMA = True

_OBVIOUS = {
    ("OpenSCENARIO", "CatalogLocations"): "there are no catalogues",
    ("OpenSCENARIO", "RoadNetwork"): "there are no roads",
    ("Storyboard", "Init"): "nothing is done at the beginning",
    ("Init", "Actions"): "nothing is done at the beginning",
    ("Storyboard", "StopTrigger"): "the run has no end of its own",
    ("Act", "StartTrigger"): "the act starts with its story",
    ("Event", "StartTrigger"): "the event starts with its act",
    ("ManeuverGroup", "Actors"): "no actors are assumed",
    ("SpeedAction", "SpeedActionDynamics"): "the speed changes at once",
    ("FollowTrajectoryAction", "TimeReference"): "the trajectory has no times",
    ("FollowTrajectoryAction", "TrajectoryFollowingMode"): "'position' is assumed",
    ("Vehicle", "Properties"): "there are none",
    ("Pedestrian", "Properties"): "there are none",
    ("MiscObject", "Properties"): "there are none",
    ("Controller", "Properties"): "there are none",
}
"""What the absence of elements says: what their empty form says, or that with what follows here."""
_INSIDE = {"Init": "Actions", "TimeReference": "None"}
_ATTRIBUTES = {
    "Actors": {"selectTriggeringEntities": "false"},
    "SpeedActionDynamics": {"dynamicsShape": "step", "value": "0", "dynamicsDimension": "time"},
    "TrajectoryFollowingMode": {"followingMode": "position"},
}


def repair(root: Node, version: tuple[int, int]) -> Iterator[Remark]:
    """Add them."""
    declared = children(version)
    for node in list(root.iter(*{parent for parent, _ in _OBVIOUS})):
        if node.tag == "OpenSCENARIO" and node.find("Storyboard") is None:
            continue
        siblings = declared.get(node.tag, {})
        for name, child in siblings.items():
            meaning = _OBVIOUS.get((node.tag, name))
            if meaning is not None and child.required and node.find(name) is None:
                _add(node, name, child, siblings)
                what = f"{node.tag} {node.get('name')!r}" if node.has("name") else node.tag
                yield node.remark(UID, f"{what}: the element {name} is missing; {meaning}")


def _add(node: Node, name: str, child: Child, siblings: dict[str, Child]) -> None:
    added = etree.Element(name, _ATTRIBUTES.get(name, {}))
    if name in _INSIDE:
        etree.SubElement(added, _INSIDE[name])
    added.sourceline = node.line  # type: ignore[assignment]  # the stubs leave its type open
    later = next((each for each in node.children() if each.tag in siblings and siblings[each.tag].place > child.place), None)
    if later is None:
        node.element.append(added)
    else:
        later.element.addprevious(added)
