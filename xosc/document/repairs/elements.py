"""Repairs of elements: doubled, misspelt, in another order or missing; and the violations of the
schema that are left."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from copy import deepcopy
from itertools import pairwise

from lxml import etree

from schemas import validate
from schemas.checks.structure import SCHEMA_UID
from schemas.common.remarks import Remark
from schemas.versions.registry import OPENSCENARIO, schema_for
from xosc.document.node import Node
from xosc.document.repairs.attributes import (
    Child,
    children,
    content,
    ignored,
    names,
    similar,
    suggested,
)
from xosc.rules.storyboard import lacking

_LISTS = (
    "ParameterDeclarations",
    "VariableDeclarations",
    "MonitorDeclarations",
    "Entities",
    "Properties",
)


def join_doubled_elements(root: Node, version: tuple[int, int]) -> Iterator[Remark]:
    """Put lists together that are there several times, and keep the first of other elements that
    may be there once."""
    declared = children(version)
    for node in list(root.iter()):
        first: dict[str, Node] = {}
        for child in node.children():
            allowed = declared.get(node.tag, {}).get(child.tag)
            if (
                allowed is None
                or allowed.many
                or first.setdefault(child.tag, child).element is child.element
            ):
                continue
            cause = ""
            if child.tag in _LISTS:
                first[child.tag].element.extend(child.element)
                meaning = "what is in both is read"
            else:
                meaning = f"that of line {first[child.tag].line} is read"
                cause = "" if _alike(child, first[child.tag]) else ignored(child)
            node.element.remove(child.element)
            yield child.remark(SCHEMA_UID, f"a second element {child.tag}; {meaning}", cause)


def _alike(one: Node, other: Node) -> bool:
    """Whether two elements have the same content: which of them is read does not matter."""
    first, second = (
        etree.canonicalize(
            etree.tostring(node.element, with_tail=False, encoding="unicode"), strip_text=True
        )
        for node in (one, other)
    )
    return bool(first == second)


def keep_first_positions(root: Node, version: tuple[int, int]) -> Iterator[Remark]:
    """Keep the first of several positions that stand where there is one place."""
    for node in list(root.iter("Position")):
        inside = node.children()
        for other in inside[1:]:
            first = inside[0]
            node.element.remove(other.element)
            yield other.remark(
                SCHEMA_UID,
                f"a second position {other.tag}; the {first.tag} of line {first.line} is read",
            )


def double_lone_vertices(root: Node, version: tuple[int, int]) -> Iterator[Remark]:
    """Give a polyline of one vertex a second one at the same place."""
    for node in list(root.iter("Polyline")):
        vertices = node.children("Vertex")
        if len(vertices) == 1:
            vertices[0].element.addnext(deepcopy(vertices[0].element))
            yield vertices[0].remark(
                SCHEMA_UID,
                "a Polyline needs two vertices; one of no length, at this place, is read",
            )


_DYNAMICS = ("SpeedActionDynamics", "LaneChangeActionDynamics")
_STEADY = ("TargetDistanceSteadyState", "TargetTimeSteadyState")


def move_content(root: Node, version: tuple[int, int]) -> Iterator[Remark]:
    """Put dynamics and steady states, one element too deep or beside their element, where they
    belong."""
    for node in list(root.iter(*_DYNAMICS)):
        inside = node.children()
        if len(inside) == 1 and not node.element.attrib and inside[0].has("dynamicsShape"):
            node.element.attrib.update(inside[0].element.attrib)
            node.element.remove(inside[0].element)
            # An element without content may hold no line breaks either.
            node.element.text = None
            yield inside[0].remark(
                SCHEMA_UID,
                f"the element {inside[0].tag} is none of {node.tag}; its attributes "
                "are read as those of it",
            )
    for node in list(root.iter("FinalSpeed")):
        speeds = node.children("AbsoluteSpeed", "RelativeSpeedToMaster")
        astray = [
            inner
            for inner in node.iter(*_STEADY)
            if inner.element.getparent() not in [speed.element for speed in speeds]
        ]
        if (
            len(speeds) != 1
            or len(astray) != 1
            or any(speeds[0].find(tag) is not None for tag in _STEADY)
        ):
            continue
        holder = astray[0].element.getparent()
        speeds[0].element.append(astray[0].element)
        if (
            holder is not None
            and holder is not node.element
            and not len(holder)
            and (above := holder.getparent()) is not None
        ):
            above.remove(holder)
        yield astray[0].remark(
            SCHEMA_UID,
            f"the element {astray[0].tag} belongs in {speeds[0].tag}; it is "
            "read as if it were there",
        )


def correct_element_names(root: Node, version: tuple[int, int]) -> Iterator[Remark]:
    """Rename misspelt elements: to an absent allowed element with nearly their name, or of the type
    of that name."""
    declared, known = children(version), names(children)
    for node in list(root.iter()):
        siblings = declared.get(node.tag, {})
        inside = node.children() if siblings else []
        present = {child.tag for child in inside}
        for child in inside:
            absent = {name: sibling for name, sibling in siblings.items() if name not in present}
            right = (
                ""
                if child.tag in known[node.tag]
                else similar(child.tag, absent) or _of_type(child.tag, absent)
            )
            if right:
                yield child.remark(
                    SCHEMA_UID,
                    f"the element {child.tag} is in no version of the standard; {right} is meant",
                )
                child.element.tag = right
                present.add(right)


def _of_type(name: str, absent: dict[str, Child]) -> str:
    """The only element of the type of that name; "" where there is none, or more than one."""
    tags = [tag for tag, child in absent.items() if child.type == name]
    return tags[0] if len(tags) == 1 else ""


def order_elements(root: Node, version: tuple[int, int]) -> Iterator[Remark]:
    """Put child elements in the order of the standard, where it has no meaning; those of one name
    stay in theirs."""
    declared = children(version)
    for node in list(root.iter()):
        siblings = declared.get(node.tag, {})
        inside = [child for child in node.children() if child.tag in siblings]
        places = [siblings[child.tag].place for child in inside]
        late = next(
            (number for number, (before, after) in enumerate(pairwise(places)) if after < before),
            None,
        )
        if late is None:
            continue
        first, second = inside[late], inside[late + 1]
        # append moves an element that is in the tree; sorted keeps the order within a name.
        for child in sorted(inside, key=lambda node: siblings[node.tag].place):
            node.element.append(child.element)
        yield second.remark(
            SCHEMA_UID,
            f"the element {second.tag} comes after {first.tag}; it is read as if it came before",
        )


_MEANINGS = {
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
"""Meaning of absent elements: that of their empty form, or the text given here."""
_INSIDE = {"Init": "Actions", "TimeReference": "None"}
_ATTRIBUTES = {
    "Actors": {"selectTriggeringEntities": "false"},
    "SpeedActionDynamics": {"dynamicsShape": "step", "value": "0", "dynamicsDimension": "time"},
    "TrajectoryFollowingMode": {"followingMode": "position"},
}


def add_missing_elements(root: Node, version: tuple[int, int]) -> Iterator[Remark]:
    """Add required elements that have one obvious content."""
    declared = children(version)
    for node in list(root.iter(*{parent for parent, _ in _MEANINGS})):
        if node.tag == "OpenSCENARIO" and node.find("Storyboard") is None:
            continue
        siblings = declared.get(node.tag, {})
        for name, child in siblings.items():
            meaning = _MEANINGS.get((node.tag, name))
            if meaning is not None and child.required and node.find(name) is None:
                _add(node, name, child, siblings)
                what = f"{node.tag} {node.get('name')!r}" if node.has("name") else node.tag
                yield node.remark(SCHEMA_UID, f"{what}: the element {name} is missing; {meaning}")


def _add(node: Node, name: str, child: Child, siblings: dict[str, Child]) -> None:
    added = etree.Element(name, _ATTRIBUTES.get(name, {}))
    if name in _INSIDE:
        etree.SubElement(added, _INSIDE[name])
    # Errors about it name the line of the element around it.
    added.sourceline = node.line  # type: ignore[assignment]  # the stubs leave its type open
    later = next(
        (
            other
            for other in node.children()
            if other.tag in siblings and siblings[other.tag].place > child.place
        ),
        None,
    )
    if later is None:
        node.element.append(added)
    else:
        later.element.addprevious(added)


_BOXES = {
    "car": (1.4, 4.5, 1.8, 1.5),
    "van": (1.6, 5.5, 2.0, 2.4),
    "truck": (3.0, 9.0, 2.5, 3.5),
    "bus": (3.4, 12.0, 2.55, 3.2),
    "motorbike": (0.7, 2.2, 0.8, 1.5),
    "bicycle": (0.55, 1.8, 0.6, 1.7),
    "pedestrian": (0.0, 0.5, 0.6, 1.8),
    "wheelchair": (0.3, 1.1, 0.7, 1.4),
}
"""x of the centre from the rear axle, length, width and height (m) of common European vehicles, by
category."""


def add_missing_boxes(root: Node, version: tuple[int, int]) -> Iterator[Remark]:
    """Give vehicles and pedestrians a missing BoundingBox, that of their category, where there is a
    usual size."""
    for node in root.iter("Vehicle", "Pedestrian"):
        category = node.get(f"{node.tag.lower()}Category", "")
        if node.find("BoundingBox") is not None or category not in _BOXES:
            continue
        x, length, width, height = _BOXES[category]
        box = etree.Element("BoundingBox")
        box.sourceline = node.line  # type: ignore[assignment]  # the stubs leave its type open
        etree.SubElement(box, "Center", x=f"{x:g}", y="0", z=f"{height / 2:g}")
        etree.SubElement(
            box, "Dimensions", length=f"{length:g}", width=f"{width:g}", height=f"{height:g}"
        )
        node.element.append(box)
        usual = (
            f"that of a usual {category} is assumed: {length:g} m long, {width:g} m wide, "
            f"{height:g} m high"
        )
        yield node.remark(
            SCHEMA_UID,
            f"{node.tag} {node.get('name', '')!r}: the element BoundingBox is missing; {usual}",
        )


def _unknown(root: Node, version: tuple[int, int]) -> Iterator[tuple[Node, Iterable[str]]]:
    """Elements that no version of the standard has at their place, with the names that this version
    has there."""
    known, declared = names(content), content(version)
    for node in root.iter(*known):
        for child in node.children():
            if (
                known[node.tag]
                and child.tag not in known[node.tag]
                and not child.tag.startswith("{")
            ):
                yield child, declared.get(node.tag, ())


def remarks_on_violations(root: Node, version: tuple[int, int]) -> Iterator[Remark]:
    """A remark on each violation; elements of the storyboard that are empty are
    left to the runner.
    """
    unknown = list(_unknown(root, version))
    for child, absent in unknown:
        text = f"the element {child.tag} is in no version of the standard here; it is NOT executed"
        yield child.remark(SCHEMA_UID, text + suggested(child.tag, absent), ignored(child))
    schema = schema_for(OPENSCENARIO, version)
    if schema is None:
        return
    told = {child.element for child, _ in unknown}
    for element, message in validate.brief_violations(root.element.getroottree(), schema):
        if element not in told and not ("Missing child" in message and lacking(element)):
            what = message.removeprefix("Element ").rstrip(". ")
            yield Node(element, root.path).remark(
                SCHEMA_UID, f"{what}; the file is read as it stands"
            )
