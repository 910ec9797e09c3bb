"""Conversion between the versions 1.0 to 1.4 of OpenSCENARIO XML: lossless, or refused by name.

What the versions have in common stays as it is, deprecated forms included. `RULES` lists what one
version says differently from the next; everything that the target version cannot say is found by
its own XSD and refused there. One thing is lost without a refusal: before 1.2 a transition keeps to
its time only as far as the vehicle can (`followingMode` is `follow`), so that `position`, the
default since, goes. Source: the official XSDs compared, and the standard's notes on deprecated
elements.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import TypeVar

from lxml import etree

from schemas.common.errors import UsageError
from schemas.expressions import FUNCTIONS, ExpressionError, functions, is_expression
from schemas.expressions.values import number
from schemas.validate import Violation, violations
from schemas.versions.registry import OPENSCENARIO, schema_for
from xosc.document import VERSIONS, Document
from xosc.document.node import OWN, Node

T = TypeVar("T")
Version = tuple[int, int]
Change = Callable[[etree._Element], None]


def convert(document: Document, to: Version) -> Document:
    """The same scenario, catalogue or distribution in another version of the standard.

    Args:
        document: a document that is valid in its own version; it is not changed.
        to: major and minor revision, one of `xosc.document.VERSIONS`.

    Raises:
        Unsupported: the document says something that the target version cannot say, named with file
            and line.
        InvalidFile: the document breaks the schema of its own version.
        UsageError: there is no such version, or no XSD for it is at hand.

    Example:
        >>> import xosc_toolchain as xt
        >>> xt.convert(xt.load("xosc/library/simple_cut_in.xosc"), (1, 2)).version
        (1, 2)
    """
    if to not in VERSIONS:
        known = ", ".join(".".join(map(str, version)) for version in VERSIONS)
        raise UsageError(
            f"there is no conversion to version {'.'.join(map(str, to))}, only to {known}"
        )
    tree = copy.deepcopy(document.root.getroottree())
    etree.strip_attributes(tree, *OWN)
    # Valid before, so that what is invalid afterwards is the target version's lack.
    copied = checked(Document(document.path, tree.getroot(), document.version, document.kind))
    # After the check: what is invalid is refused whatever the target is.
    if to == document.version:
        return copied
    top = Node(copied.root, document.path)
    _refuse_expressions(top, document.version, to)
    for change, tag in _changes(document.version, to):
        # Listed, as changes add and remove elements of that name.
        for element in list(top.element.iter(tag)):
            try:
                change(element)
            except UsageError as error:
                raise _nearest(element, document).unsupported(error.message) from None
    # Last: rules read elements by the names of the version that they come from.
    top.need("FileHeader").element.set("revMinor", str(to[1]))
    for problem in _violations(tree, to):
        node = _nearest(problem.element, document)
        raise node.unsupported(f"can't be said in OpenSCENARIO {to[0]}.{to[1]}: {problem.message}")
    return Document(document.path, top.element, to, document.kind)


def checked(document: Document) -> Document:
    """The document itself.

    Raises:
        InvalidFile: it breaks the schema of its own version.
        UsageError: no XSD for that is at hand.
    """
    for problem in _violations(document.root.getroottree(), document.version):
        raise _nearest(problem.element, document).invalid(
            f"not valid in its own version: {problem.message}"
        )
    return document


def _violations(tree: etree._ElementTree, version: Version) -> list[Violation]:
    schema = schema_for(OPENSCENARIO, version)
    if schema is None:
        raise UsageError(f"no XSD of OpenSCENARIO {version[0]}.{version[1]} is at hand")
    return violations(tree, schema)


def _nearest(element: etree._Element, document: Document) -> Node:
    """The element, or, where a rule has made it, the one around it that was in the file."""
    around = (ancestor for ancestor in (element, *element.iterancestors()) if ancestor.sourceline)
    return Node(next(around, element), document.path)


def _refuse_expressions(top: Node, source: Version, to: Version) -> None:
    """Expressions came with 1.1, and some functions later; in a text of 1.0 they mean nothing."""
    for node in top.iter():
        for name in map(str, node.element.attrib):
            text = node.get(name)
            if not is_expression(text):
                continue
            if (1, 0) in (source, to) and source != to:
                raise node.unsupported(
                    f"{name}={text!r} is plain text in OpenSCENARIO 1.0 and an expression later"
                )
            newer = [function for function in _functions(text) if FUNCTIONS[function].since > to]
            if newer:
                raise node.unsupported(
                    f"{name}={text!r} uses {newer[0]}(), which OpenSCENARIO "
                    f"{to[0]}.{to[1]} does not have"
                )


def _functions(text: str) -> list[str]:
    try:
        return sorted(functions(text))
    except ExpressionError:  # not a conversion's business: it is as malformed in every version
        return []


@dataclass(frozen=True)
class VersionChange:
    """Change of an element between a version and its predecessor."""

    version: Version
    tag: str
    up: Change | None = None
    down: Change | None = None


def _changes(source: Version, to: Version) -> Iterator[tuple[Change, str]]:
    """Changes in the order of the steps from one version to another."""
    upwards = source < to
    for rule in RULES if upwards else reversed(RULES):
        change = rule.up if upwards else rule.down
        # A step between two versions belongs to the later one.
        if change and min(source, to) < rule.version <= max(source, to):
            yield change, rule.tag


# changes -------------------------------------------------------------------------------------


def _renamed_value(version: Version, tag: str, attribute: str, old: str, new: str) -> VersionChange:
    """A value of an enumeration that was renamed."""

    def up(element: etree._Element) -> None:
        if element.get(attribute) == old:
            element.set(attribute, new)

    def down(element: etree._Element) -> None:
        value = element.get(attribute, "")
        # A parameter may have the renamed value in one run, and another one in the next.
        if value.startswith("$"):
            raise UsageError(
                f"{attribute}={value!r} may stand for {new!r}, which is {old!r} before "
                f"{version[0]}.{version[1]}"
            )
        if value == new:
            element.set(attribute, old)

    return VersionChange(version, tag, up, down)


def _left_out_if_empty(element: etree._Element) -> None:
    """Remove an element that may be empty in one version and must not be in the other."""
    parent = element.getparent()
    if (
        parent is not None
        and not element.attrib
        and next(element.iterchildren(etree.Element), None) is None
    ):
        parent.remove(element)


def _attribute(old: str, new: str) -> Change:
    """An attribute that got another name."""

    def change(element: etree._Element) -> None:
        value = element.get(old)
        # A file that has both names already keeps the newer one.
        if value is not None and element.get(new) is None:
            element.set(new, value)
            del element.attrib[old]

    return change


def _implied(attribute: str, value: str) -> Change:
    """An attribute that is removed where it has the value that the older version implies."""

    def change(element: etree._Element) -> None:
        if element.get(attribute) == value:
            del element.attrib[attribute]

    return change


def _zero(attribute: str) -> Change:
    """A number that is removed where it is 0, which the older version implies."""

    def change(element: etree._Element) -> None:
        try:
            if number(element.get(attribute, "")) == 0.0:
                del element.attrib[attribute]
        except ValueError:
            return  # a parameter or an expression

    return change


LEFT_OPEN = {
    "SpeedActionDynamics": ("followingMode", "follow"),
    "LaneChangeActionDynamics": ("followingMode", "follow"),
    "AccelerationCondition": ("direction", "longitudinal"),
}
"""Attributes by tag that there are since `SAID_SINCE`, and what is meant before. Where it is left
out later, that means
something else: the default `position`, the total acceleration."""
SAID_SINCE: Version = (1, 2)


def say_left_open(element: etree._Element) -> None:
    """Write the implied attribute of an element of `LEFT_OPEN` of an older version, which means
    something else from `SAID_SINCE` on."""
    attribute, value = LEFT_OPEN[str(element.tag)]
    if attribute not in element.attrib:
        element.set(attribute, value)


def _with_direction(condition: etree._Element) -> None:
    if "direction" not in condition.attrib:
        raise UsageError(
            "without a direction it is the total acceleration, which versions "
            "before 1.2 do not have"
        )


def _tag(new: str) -> Change:
    """An element that got another name."""

    def change(element: etree._Element) -> None:
        element.tag = new

    return change


def _child(make: Callable[[], etree._Element], before: str = "") -> Change:
    """A child that was required, and now has a meaning when it is absent."""

    def change(element: etree._Element) -> None:
        made = make()
        if element.find(str(made.tag)) is not None:
            return
        following = element.find(before) if before else None
        element.insert(len(element) if following is None else element.index(following), made)

    return change


def _properties() -> etree._Element:
    return etree.Element("Properties")


def _never() -> etree._Element:
    """A stop trigger that never fires, as an absent one."""
    return etree.Element("StopTrigger")


def _at_once() -> etree._Element:
    """A start trigger that always holds, as an absent one; all versions have its rule."""
    trigger = etree.Element("StartTrigger")
    condition = etree.SubElement(etree.SubElement(trigger, "ConditionGroup"), "Condition")
    condition.attrib.update({"name": "at once", "delay": "0", "conditionEdge": "none"})
    value = etree.SubElement(condition, "ByValueCondition")
    etree.SubElement(value, "SimulationTimeCondition", {"value": "-1", "rule": "greaterThan"})
    return trigger


def _straight_line(element: etree._Element) -> None:
    """`alongRoute="false"` of 1.0 is the Euclidean distance, the same in all coordinate systems,
    which 1.1 assumes by default."""
    kind = element.get("relativeDistanceType", _STRAIGHT)
    if (
        "alongRoute" not in element.attrib
        and kind == _STRAIGHT
        and not element.get("coordinateSystem", "").startswith("$")
    ):
        for name in ("coordinateSystem", "relativeDistanceType"):
            element.attrib.pop(name, "")
        element.set("alongRoute", "false")


def _unwrapped(wrapper: str, only: str = "") -> Change:
    """An element that the older version has without its wrapper, as that of 1.1's TrajectoryRef."""

    def change(element: etree._Element) -> None:
        for outer in element.findall(wrapper):
            inner = list(outer.iterchildren(etree.Element))
            # Of more than one child the older version has no place for the others: its XSD refuses
            # them.
            if len(inner) == 1 and only in ("", inner[0].tag):
                element.replace(outer, inner[0])

    return change


def _split_controller_action(element: etree._Element) -> None:
    """One ControllerAction could assign, override and activate; since 1.3 each is a
    ControllerAction of its own."""
    # From the last to the second: each becomes the next sibling of the first one's holder, which
    # keeps their order.
    for child in list(element.iterchildren(etree.Element))[:0:-1]:
        holder = _holder(element)
        twin = etree.Element(holder.tag)
        if "name" in holder.attrib:
            twin.set("name", _twin_name(holder, child))
        inside = twin if holder.tag == "PrivateAction" else etree.SubElement(twin, "PrivateAction")
        etree.SubElement(inside, "ControllerAction").append(child)
        holder.addnext(twin)


def _merge_controller_actions(element: etree._Element) -> None:
    """In 1.0 a ControllerAction both assigns and overrides, so two that follow each other become
    one."""
    holder = _holder(element)
    twin = holder.getnext()
    other = (
        next(twin.iter("ControllerAction"), None)
        if twin is not None and twin.tag == holder.tag
        else None
    )
    if (
        other is None
        or _holder(other) is not twin
        or sorted(_tags(element) + _tags(other)) != _ASSIGN_AND_OVERRIDE
    ):
        return
    if "name" not in holder.attrib or twin.get("name") == _twin_name(holder, other[0]):
        element.extend(other)
        _parent(holder).remove(twin)


_ASSIGN_AND_OVERRIDE = ["AssignControllerAction", "OverrideControllerValueAction"]


def _tags(element: etree._Element) -> list[str]:
    return [str(child.tag) for child in element.iterchildren(etree.Element)]


def _twin_name(holder: etree._Element, child: etree._Element) -> str:
    return f"{holder.get('name')} {child.tag}"


def _holder(controller_action: etree._Element) -> etree._Element:
    """The repeatable element around a ControllerAction: the Action of an event, the PrivateAction
    of an Init."""
    private = _parent(controller_action)
    action = private.getparent()
    return action if action is not None and action.tag == "Action" else private


def _parent(element: etree._Element) -> etree._Element:
    parent = element.getparent()
    assert parent is not None, "a valid document has this element inside others"
    return parent


def _without_white_space(element: etree._Element) -> None:
    """An element that had no content may then hold comments, but no line breaks
    around them either.
    """
    element.text = (element.text or "").strip() or None
    for child in element:
        child.tail = (child.tail or "").strip() or None


# differences between versions, in the order of the steps up --------------------------------------

_STRAIGHT = "euclidianDistance"
_ALONG_ROUTE = ("DistanceCondition", "TimeHeadwayCondition", "TimeToCollisionCondition")
_ROUTED = (*_ALONG_ROUTE, "RelativeDistanceCondition")

RULES: tuple[VersionChange, ...] = (
    # 1.1
    _renamed_value(
        (1, 1),
        "RelativeDistanceCondition",
        "relativeDistanceType",
        "cartesianDistance",
        "euclidianDistance",
    ),
    VersionChange((1, 1), "RelativeDistanceCondition", down=_implied("coordinateSystem", "entity")),
    *(VersionChange((1, 1), tag, down=_straight_line) for tag in _ALONG_ROUTE),
    VersionChange(
        (1, 1), "LongitudinalDistanceAction", down=_implied("coordinateSystem", "entity")
    ),
    VersionChange(
        (1, 1),
        "LongitudinalDistanceAction",
        down=_implied("displacement", "trailingReferencedEntity"),
    ),
    VersionChange((1, 1), "LateralDistanceAction", down=_implied("coordinateSystem", "entity")),
    VersionChange((1, 1), "LateralDistanceAction", down=_implied("displacement", "any")),
    VersionChange((1, 1), "FollowTrajectoryAction", down=_unwrapped("TrajectoryRef")),
    VersionChange((1, 1), "FollowTrajectoryAction", down=_zero("initialDistanceOffset")),
    VersionChange(
        (1, 1),
        "PrivateAction",
        down=_unwrapped("ControllerAction", only="ActivateControllerAction"),
    ),
    VersionChange((1, 1), "ControllerAction", down=_merge_controller_actions),
    VersionChange((1, 1), "Pedestrian", down=_attribute("model3d", "model")),
    VersionChange((1, 1), "Clothoid", down=_attribute("curvaturePrime", "curvatureDot")),
    VersionChange((1, 1), "Event", down=_child(_at_once)),
    *(
        VersionChange((1, 1), tag, down=_without_white_space)
        for tag in ("FileHeader", "ParameterDeclaration")
    ),
    # 1.2
    _renamed_value((1, 2), "Event", "priority", "overwrite", "override"),
    _renamed_value((1, 2), "ParameterDeclaration", "parameterType", "integer", "int"),
    *(
        VersionChange((1, 2), tag, down=_implied("routingAlgorithm", "undefined"))
        for tag in _ROUTED
    ),
    *(
        VersionChange((1, 2), tag, down=_implied("role", "none"))
        for tag in ("Vehicle", "Pedestrian")
    ),
    *(
        VersionChange((1, 2), tag, down=_implied("followingMode", "position"))
        for tag in ("SpeedActionDynamics", "LaneChangeActionDynamics")
    ),
    *(
        VersionChange(SAID_SINCE, tag, up=say_left_open, down=_implied(*meant))
        for tag, meant in LEFT_OPEN.items()
    ),
    VersionChange(SAID_SINCE, "AccelerationCondition", down=_with_direction),
    # 1.3
    VersionChange((1, 3), "ControllerAction", up=_split_controller_action),
    VersionChange((1, 3), "ObjectController", up=_left_out_if_empty),
    VersionChange((1, 3), "TrafficeSignalGroupState", up=_tag("TrafficSignalGroupState")),
    VersionChange((1, 3), "TrafficSignalGroupState", down=_tag("TrafficeSignalGroupState")),
    VersionChange(
        (1, 3), "Catalog", up=lambda element: element.set("name", element.get("name", ""))
    ),
    VersionChange((1, 3), "Act", down=_child(_at_once, before="StopTrigger")),
    VersionChange((1, 3), "Storyboard", down=_child(_never)),
    *(
        VersionChange((1, 3), tag, down=_child(_properties))
        for tag in ("Vehicle", "Pedestrian", "MiscObject", "Controller")
    ),
    # 1.4
    *(
        _renamed_value((1, 4), tag, attribute, "motorbike", "motorcycle")
        for tag, attribute in (
            ("Vehicle", "vehicleCategory"),
            ("VehicleCategoryDistributionEntry", "category"),
        )
    ),
    *(
        _renamed_value((1, 4), tag, "role", old, new)
        for tag in ("Vehicle", "Pedestrian", "VehicleRoleDistributionEntry")
        for old, new in (("fire", "fireBrigade"), ("roadAssistance", "roadsideAssistance"))
    ),
    VersionChange((1, 4), "LanePosition", down=_implied("layer", "temporary")),
)

EARLIER_CATEGORY = {
    "motorcycle": "motorbike", "heavyTruck": "truck", "semitractor": "truck",
    "workMachine": "truck",
    "standupScooter": "bicycle", "micromobilityDevice": "bicycle", "wheelchair": "bicycle",
    "landVehicle": "car", "other": "car", "aircraft": "car", "watercraft": "car",
}  # fmt: skip
"""Nearest vehicle category before 1.4 by category of 1.4; the first is its new name."""

_OFF_ROADS = ("aircraft", "watercraft")


def with_recent(table: Mapping[str, T]) -> dict[str, T]:
    """A table by vehicle category, with rows for road vehicles of 1.4 that it lacks: those of the
    nearest earlier category."""
    nearest = {
        new: table[old]
        for new, old in EARLIER_CATEGORY.items()
        if old in table and new not in _OFF_ROADS
    }
    return {**nearest, **table}
