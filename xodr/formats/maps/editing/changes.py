"""Elements, attributes and values of OpenDRIVE that some versions lack, and their changes.

Source: the XSDs of ASAM OpenDRIVE 1.4H, 1.5M, 1.6.1, 1.7.0, 1.8.0 and 1.9.0.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple

from lxml import etree

from schemas.expressions.values import number
from xodr.formats.maps.editing.tree import remove

Version = tuple[int, int]
Edit = Callable[[etree._Element], None]

VERSIONS: tuple[Version, ...] = ((1, 4), (1, 5), (1, 6), (1, 7), (1, 8), (1, 9))
"""Versions that are written."""


class Change(NamedTuple):
    """Change of what stands at a place in the versions that lack it.

    Attributes:
        lacking: these versions.
        where: XPath of elements from the root, without namespaces.
        edit: called with each of them; None refuses the file.
        reason: of the remark; of a refusal the end of "OpenDRIVE 1.4 …".
    """

    lacking: tuple[Version, ...]
    where: str
    edit: Edit | None
    reason: str


def elements_at(root: etree._Element, where: str) -> Iterator[etree._Element]:
    """The elements at a place, an XPath."""
    elements = root.xpath(where)
    assert isinstance(elements, list)
    yield from (element for element in elements if isinstance(element, etree._Element))


# edits -------------------------------------------------------------------------------------------


def _without(*names: str) -> Edit:
    """An edit that takes attributes away."""

    def edit(element: etree._Element) -> None:
        for name in names:
            if name in element.attrib:
                del element.attrib[name]

    return edit


def _dropped(*names: str) -> tuple[Edit, str]:
    """An edit that takes attributes away on which no motion depends, and its reason."""
    return _without(*names), f"{', '.join(names)} {_NOT_MOVED}"


def _with(**values: str) -> Edit:
    """An edit that writes attributes which are not there."""

    def edit(element: etree._Element) -> None:
        for name, value in values.items():
            if name not in element.attrib:
                element.set(name, value)

    return edit


def _renamed(attribute: str, values: Mapping[str, str]) -> Edit:
    """An edit that writes other values of an attribute."""

    def edit(element: etree._Element) -> None:
        value = element.get(attribute, "")
        element.set(attribute, values.get(value, value))

    return edit


def _all_but(attribute: str, kept: str) -> Edit:
    """An edit that writes one value of an attribute, and the former one as the subtype."""

    def edit(element: etree._Element) -> None:
        former = element.get(attribute, "")
        element.set(attribute, kept)
        if former and not element.get("subtype"):
            element.set("subtype", former)

    return edit


def _two_decimals(header: etree._Element) -> None:
    """Write the version of the map as 1.5 asks for it, or leave it out."""
    value = number(header.attrib.pop("version"))
    if value is not None and 0.0 <= value < 9.995:
        header.set("version", f"{value:.2f}")


def _no_width(lane: etree._Element) -> None:
    lane.insert(1 if lane.find("link") is not None else 0, etree.Element("width", _NO_WIDTH))


def _bidirectional(element: etree._Element) -> None:
    element.attrib.pop("direction")
    element.set("type", "bidirectional")


def _road_works(element: etree._Element) -> None:
    element.attrib.pop("roadWorks")
    element.set("type", "roadWorks")


def _one_access_each(element: etree._Element) -> None:
    """An `access` element for each of its restrictions, in its place."""
    for restriction in reversed(element.findall("restriction")):
        alone = etree.Element("access")
        alone.attrib.update(element.attrib)
        alone.set("restriction", restriction.get("type", "none"))
        alone.tail, alone.sourceline = element.tail, element.sourceline
        element.addnext(alone)
    remove(element)


def _one_outline(element: etree._Element) -> None:
    """The first of several outlines, in the place of all."""
    first = element.find("outline")
    if first is not None:
        element.addprevious(first)
    remove(element)


def _crossing(junction: etree._Element) -> None:
    """Take away a junction, and the roads out of it."""
    for road in elements_at(junction.getroottree().getroot(), "/OpenDRIVE/road"):
        if road.get("junction") == junction.get("id"):
            road.set("junction", "-1")
    remove(junction)


def _speed_of_attributes(element: etree._Element) -> None:
    for name in reversed(_SPEED):
        child = etree.Element(name)
        child.text = element.get(name, "")
        element.attrib.pop(name)
        element.insert(0, child)


def _speed_of_elements(element: etree._Element) -> None:
    for name in _SPEED:
        child = element.find(name)
        if child is not None:
            element.set(name, (child.text or "").strip())
            element.remove(child)


# changes -----------------------------------------------------------------------------------------


def _before(minor: int) -> tuple[Version, ...]:
    return tuple(version for version in VERSIONS if version < (1, minor))


def _since(minor: int) -> tuple[Version, ...]:
    return tuple(version for version in VERSIONS if version >= (1, minor))


def _in(attribute: str, values: str) -> str:
    """XPath condition: the attribute has one of some values, divided by `|`."""
    return f"contains('|{values}|', concat('|', @{attribute}, '|'))"


_SPEED = ("type", "unit", "value")
_NO_WIDTH = dict.fromkeys(("sOffset", *"abcd"), "0")
_ASKED = "what 1.5 asks for is written"
_LANE = "//laneSection/*/lane"
_MARK = f"{_LANE}/roadMark"
_OBJECT = "/OpenDRIVE/road/objects/object"
_OUTLINE = f"{_OBJECT}//outline"
_SIGNAL = "/OpenDRIVE/road/signals/signal"
_JUNCTION = "/OpenDRIVE/junction"
_SEMANTICS = "//semantics"
_NOT_MOVED = "left out: no motion depends on it"
_OTHER_OBJECTS = (
    "|none|obstacle|pole|tree|vegetation|barrier|building|parkingSpace|patch|railing|trafficIsland|crosswalk|streetLamp|gantry"
    "|soundBarrier|car|van|bus|trailer|bike|motorbike|tram|train|pedestrian|wind|roadMark|"
)
"""Types of objects since 1.5, but for `truck` of 1.5, `roadMark` since 1.6 and `roadSurface` since
1.8."""
_EARLY_LANES = {
    "bus": "restricted", "taxi": "restricted", "HOV": "restricted", "mwyEntry": "entry",
    "mwyExit": "exit",
    "connectingRamp": "driving",
}  # fmt: skip
_LATE_LANES = {"walking": "sidewalk", "slipLane": "driving", "shared": "driving"}
_TOWN = "townArterial|townCollector|townExpressway|townLocal|townPlayStreet|townPrivate"


def _lane_types(lacking: tuple[Version, ...], names: Mapping[str, str]) -> Iterator[Change]:
    for name, nearest in names.items():
        said = f"the type {name} is written as {nearest}, the nearest of this version"
        yield Change(lacking, f"{_LANE}[@type='{name}']", _renamed("type", names), said)
        yield Change(lacking, f"{_OUTLINE}[@laneType='{name}']", _renamed("laneType", names), said)


CHANGES: tuple[Change, ...] = (
    # 1.9
    Change(
        _before(9),
        "//lanes[@layer='temporary']",
        None,
        "has no temporary lanes, which take the place of the permanent ones",
    ),
    Change(
        _before(9),
        "//*[@layer]",
        _without("layer"),
        "its layer is left out: all lanes are permanent",
    ),
    Change(
        _before(9),
        "//laneLink[@fromLayer or @toLayer]",
        _without("fromLayer", "toLayer"),
        "its layer is left out: all lanes are permanent",
    ),
    Change(
        _before(9),
        "//laneSection[@length]",
        _without("length"),
        "its length is left out: it ends where the next one starts",
    ),
    Change(
        _before(9),
        "/OpenDRIVE/road/*/*[@invalidated='true' or @invalidated='1']",
        remove,
        "what is not in force is left out",
    ),
    Change(
        _before(9),
        "//*[@invalidated]",
        _without("invalidated"),
        "it is in force, which is not written",
    ),
    Change(
        _before(9),
        "//*[self::object or self::signal or self::sign][@temporary]",
        *_dropped("temporary"),
    ),
    Change(
        _before(9),
        "//repeat[@bT or @cT or @dT]",
        _without("bT", "cT", "dT"),
        "its cubic is left out: objects are repeated along a straight line",
    ),
    Change(_before(9), "//outline[curveLocal]", remove, "an outline of curves is left out"),
    Change(_before(9), "//outlines[not(outline)]", remove, "left out: it is empty"),
    Change(_before(9), "//outline/markings", remove, _NOT_MOVED),
    Change(_before(9), "//CRG[@xOffset or @yOffset]", *_dropped("xOffset", "yOffset")),
    Change(
        ((1, 8),),
        f"{_SEMANTICS}/speed[@value]",
        _speed_of_attributes,
        "its attributes are elements in 1.8",
    ),
    Change(
        _since(9),
        f"{_SEMANTICS}/speed[value]",
        _speed_of_elements,
        "its elements are attributes since 1.9",
    ),
    Change(
        ((1, 8),),
        f"{_SEMANTICS}/*[animal or person or vehicle] | {_SEMANTICS}/lane[@type='other']",
        remove,
        _NOT_MOVED,
    ),
    Change(_since(9), "//staticBoard/sign/vmsBoard", remove, _NOT_MOVED),
    # 1.8
    Change(
        _before(8),
        "//crossSectionSurface",
        None,
        "has no crossSectionSurface, which gives the heights of the road",
    ),
    Change(
        _before(8),
        f"{_LANE}[@direction='reversed']",
        None,
        "has no lanes whose traffic is reversed",
    ),
    Change(
        _before(8),
        f"{_LANE}[@direction='both']",
        _bidirectional,
        "its direction both is the type bidirectional",
    ),
    Change(
        _before(8),
        f"{_LANE}[@direction]",
        _without("direction"),
        "its direction is the one that all lanes have",
    ),
    Change(
        _before(8),
        f"{_LANE}[@roadWorks='true' or @roadWorks='1']",
        _road_works,
        "its roadWorks is the type roadWorks",
    ),
    Change(
        _before(8),
        f"{_LANE}[@roadWorks or @advisory or @dynamicLaneDirection or @dynamicLaneType]",
        *_dropped("roadWorks", "advisory", "dynamicLaneDirection", "dynamicLaneType"),
    ),
    *_lane_types(_before(8), _LATE_LANES),
    Change(
        _before(8),
        f"{_LANE}/access[restriction]",
        _one_access_each,
        "it is written once for each restriction",
    ),
    Change(
        _before(8),
        f"{_LANE}/access[@restriction='HOV']",
        remove,
        "left out: this version has no restriction of HOV",
    ),
    Change(
        _before(8),
        f"{_JUNCTION}[@type='crossing']",
        _crossing,
        "crossings of roads without connections are left out",
    ),
    Change(
        _before(8),
        f"{_JUNCTION}/*[self::crossPath or self::planView or self::objects or self::boundary or "
        "self::elevationGrid]",
        remove,
        "left out: this version's junctions have none",
    ),
    Change(_before(8), f"{_JUNCTION}/connection/laneLink[@overlapZone]", *_dropped("overlapZone")),
    Change(
        _before(8),
        "//junctionGroup[@type!='roundabout' and @type!='unknown']",
        _renamed("type", {"complexJunction": "unknown", "highwayInterchange": "unknown"}),
        _NOT_MOVED,
    ),
    Change(
        _before(8),
        "//header/defaultRegulations | //header/license | /OpenDRIVE/vmsGroup",
        remove,
        _NOT_MOVED,
    ),
    Change(
        _before(8),
        f"{_SIGNAL}/*[self::semantics or self::staticBoard or self::vmsBoard]",
        remove,
        _NOT_MOVED,
    ),
    Change(_before(8), f"{_SIGNAL}[@length]", *_dropped("length")),
    Change(_before(8), f"{_OBJECT}/skeleton", remove, _NOT_MOVED),
    Change(_before(8), f"{_OBJECT}/material[@roadMarkColor]", *_dropped("roadMarkColor")),
    Change(
        _before(8),
        "//repeat[@detachFromReferenceLine]",
        _without("detachFromReferenceLine"),
        "objects are repeated along the reference line",
    ),
    Change(
        _before(8),
        f"{_OBJECT}[@type='roadSurface']",
        _all_but("type", "none"),
        "this version has no such type: it becomes the subtype",
    ),
    Change(_before(8), f"{_OBJECT}/borders/border[@type='paint']", remove, _NOT_MOVED),
    Change(_before(8), f"{_OBJECT}/borders[not(border)]", remove, "left out: it is empty"),
    Change(_before(8), f"{_OUTLINE}[@fillType='paint']", *_dropped("fillType")),
    Change(
        _before(8),
        "//*[@color='black']",
        _renamed("color", {"black": "standard"}),
        "black is written as standard",
    ),
    # 1.7
    Change(
        _since(7),
        f"{_OBJECT}[@length = 0 or @radius = 0]",
        _without("length", "radius"),
        "it has no size, which is not written as 0",
    ),
    Change(
        _since(7),
        f"{_MARK}/type[@width = 0]",
        remove,
        "its lines have no width: the mark's type is left",
    ),
    Change(
        _before(7),
        f"{_JUNCTION}[@type='direct']",
        None,
        "has no direct junctions: their roads are linked without connecting roads",
    ),
    Change(
        _before(7),
        f"{_JUNCTION}[@mainRoad or @sStart or @sEnd or @orientation]",
        _without("mainRoad", "sStart", "sEnd", "orientation"),
        "the stretch of its main road follows from its connections",
    ),
    Change(_before(7), f"{_OBJECT}/surface", remove, _NOT_MOVED),
    Change(_before(7), f"{_OBJECT}[@perpToRoad]", *_dropped("perpToRoad")),
    Change(
        _before(7),
        "//*[@color='violet']",
        _renamed("color", {"violet": "standard"}),
        "violet is written as standard",
    ),
    # 1.6
    Change(
        _before(6),
        "//elevationProfile[not(elevation)] | //lateralProfile[not(*)]",
        remove,
        "left out: it is level",
    ),
    *_lane_types(_before(6), {"curb": "border"}),
    Change(
        _before(6),
        f"{_LANE}/ancestor::center/lane/*[not(self::link or self::roadMark or self::userData)]",
        remove,
        _NOT_MOVED,
    ),
    Change(
        _before(6),
        f"{_OBJECT}[@type='roadMark']",
        _all_but("type", "none"),
        "this version has no such type: it becomes the subtype",
    ),
    Change(
        _since(6),
        "//crossfall[@a != 0 or @b != 0 or @c != 0 or @d != 0]",
        None,
        "has no crossfall, which gives the heights of the road",
    ),
    Change(_since(6), "//crossfall", remove, "left out: it is level"),
    Change(_since(6), f"{_LANE}/visibility | /OpenDRIVE/road/link/neighbor", remove, _NOT_MOVED),
    Change(_since(6), f"{_JUNCTION}/connection[@connectionMaster]", *_dropped("connectionMaster")),
    Change(
        _since(6),
        f"{_OBJECT}[@type='truck']",
        _all_but("type", "none"),
        "this version has no such type: it becomes the subtype",
    ),
    # 1.5
    Change(
        ((1, 5),),
        "//header[@version and not(string-length(@version) = 4 and contains(@version, '.'))]",
        _two_decimals,
        "the version of the map has two decimals in 1.5",
    ),
    Change(
        _since(5),
        "//userData[not(@code)]",
        _with(code=""),
        "its code, which the version asks for, is written as empty",
    ),
    Change(((1, 5),), "//userData[not(@value)]", _with(value=""), _ASKED),
    Change(((1, 5),), f"{_SIGNAL}[not(@width and @height)]", _with(width="0", height="0"), _ASKED),
    Change(
        ((1, 5),),
        f"{_OUTLINE}[not(@id and @outer and @closed and @fillType and @laneType)]",
        _with(id="0", outer="true", closed="true", fillType="concrete", laneType="none"),
        _ASKED,
    ),
    Change(
        _since(5),
        f"{_MARK}[not(@color)]",
        _with(color="standard"),
        "its color, which the version asks for, is standard",
    ),
    Change(_since(5), f"{_OBJECT}[not(@zOffset)]", _with(zOffset="0"), "it stands on the road"),
    Change(
        _before(6),
        "//laneSection/*[self::left or self::right]/lane[not(width or border)]",
        _no_width,
        "a lane without width has a width of 0",
    ),
    Change(
        _before(5),
        f"{_JUNCTION}[@type='virtual']",
        None,
        "has no virtual junctions, at which roads leave others between their ends",
    ),
    Change(_before(5), "/OpenDRIVE/road[@rule='LHT']", None, "has no left-hand traffic"),
    Change(
        _before(5),
        "/OpenDRIVE/header/offset[@x != 0 or @y != 0 or @z != 0 or @hdg != 0]",
        None,
        "has no offset of its coordinates; `xosc-road place --without-offset` "
        "makes it a part of them",
    ),
    Change(_before(5), "/OpenDRIVE/header/offset", remove, "left out: it is 0"),
    Change(_before(5), "//CRG[@mode='global']", None, "has no surfaces of mode global"),
    Change(
        _before(5),
        "/OpenDRIVE/road[@rule]",
        _without("rule"),
        "its rule is left out: traffic keeps to the right in this version",
    ),
    Change(
        _before(5), f"{_JUNCTION}[@type]", _without("type"), "its type is left out: all are default"
    ),
    Change(
        _before(5),
        f"{_JUNCTION}/connection[@type]",
        _without("type"),
        "its type is left out: all are default",
    ),
    Change(_before(5), f"{_JUNCTION}/surface", remove, _NOT_MOVED),
    Change(
        _before(5),
        "/OpenDRIVE/road/link/*[@elementDir]",
        _without("elementDir"),
        "elementDir left out: the contact point says it",
    ),
    Change(_before(5), "/OpenDRIVE/road/type[@country]", *_dropped("country")),
    Change(
        _before(5),
        f"/OpenDRIVE/road/type[{_in('type', _TOWN)}]",
        _renamed("type", dict.fromkeys(_TOWN.split("|"), "town")),
        "its type is written as town",
    ),
    *_lane_types(_before(5), _EARLY_LANES),
    Change(
        _before(5),
        f"{_LANE}/access[@rule='allow']",
        remove,
        "left out: this version names only what is not allowed",
    ),
    Change(
        _before(5),
        f"{_LANE}/access[@rule]",
        _without("rule"),
        "its rule is left out: the version knows one",
    ),
    Change(
        _before(5),
        f"{_LANE}/access[@restriction='autonomousTraffic']",
        _renamed("restriction", {"autonomousTraffic": "autonomous traffic"}),
        "it is written in two words",
    ),
    Change(
        _since(5),
        f"{_LANE}/access[@restriction='autonomous traffic']",
        _renamed("restriction", {"autonomous traffic": "autonomousTraffic"}),
        "it is written as one word",
    ),
    Change(
        _before(5),
        f"{_LANE}/access[not("
        f"{_in('restriction', 'simulator|autonomous traffic|pedestrian|none')})]",
        remove,
        "left out: this version has no such restriction",
    ),
    Change(((1, 5),), f"{_LANE}/access[not(@rule)]", _with(rule="deny"), "its rule is said: deny"),
    Change(_before(5), f"{_MARK}/*[self::explicit or self::sway]", remove, _NOT_MOVED),
    Change(_before(5), f"{_MARK}/type/line[@color]", *_dropped("color")),
    Change(
        _before(5),
        f"{_MARK}[@type='custom' or @type='edge']",
        _renamed("type", {"custom": "none", "edge": "solid"}),
        "custom is written as none, edge as solid",
    ),
    Change(
        _before(5),
        "//*[@color='orange']",
        _renamed("color", {"orange": "standard"}),
        "orange is written as standard",
    ),
    Change(_before(5), f"{_OBJECT}/*[self::borders or self::markings]", remove, _NOT_MOVED),
    Change(
        _before(5),
        f"{_OBJECT}/outlines[count(outline) > 1]",
        _one_outline,
        "this version has one outline: the first is written",
    ),
    Change(_before(5), f"{_OBJECT}/outlines", _one_outline, "its outline is written alone"),
    Change(
        _before(5),
        f"{_OUTLINE}[@id or @fillType or @outer or @closed or @laneType]",
        *_dropped("id", "fillType", "outer", "closed", "laneType"),
    ),
    Change(_before(5), f"{_OUTLINE}/*[@id]", *_dropped("id")),
    Change(_before(5), f"{_OBJECT}[@dynamic or @subtype]", *_dropped("dynamic", "subtype")),
    Change(
        _before(5),
        "//repeat[@lengthStart or @lengthEnd or @radiusStart or @radiusEnd]",
        _without("lengthStart", "lengthEnd", "radiusStart", "radiusEnd"),
        "changing length and radius are left out",
    ),
    Change(
        _before(5),
        f"{_SIGNAL}/*[self::positionInertial or self::positionRoad or self::reference]",
        remove,
        "left out: the signal stands at its s and t",
    ),
    Change(_before(5), f"{_SIGNAL}[@countryRevision]", *_dropped("countryRevision")),
    Change(_since(5), f"{_OBJECT}/parkingSpace/marking", remove, _NOT_MOVED),
    Change(
        _since(5),
        f"{_OBJECT}[@type and not(contains('{_OTHER_OBJECTS}truck|roadSurface|', concat('|', "
        "@type, '|')))]",
        _all_but("type", "none"),
        "its type is none of this version's: it becomes the subtype",
    ),
    Change(
        ((1, 5),),
        f"{_OBJECT}[not(@dynamic and @orientation and @hdg and @pitch and @roll and @height and "
        "@validLength)]",
        _with(
            dynamic="no",
            orientation="none",
            hdg="0",
            pitch="0",
            roll="0",
            height="0",
            validLength="0",
        ),
        "what 1.5 asks for is written",
    ),
)
"""In the order in which they are made."""
