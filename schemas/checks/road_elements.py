"""The elements of OpenDRIVE 1.4 to 1.9 that are read: their children, and the attributes that must
be there and of what type.

It checks road networks of versions whose XSD is not at hand. What one of these versions allows is
allowed: the table is the union of their XSDs. Elements that it does not name (userData, objects'
surfaces, railroads) may hold anything.

Source: the XSDs of ASAM OpenDRIVE 1.4H, 1.5M, 1.6.1, 1.7.0, 1.8.0 and 1.9.0.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from lxml import etree

from schemas.common.errors import nearest
from schemas.common.xml import local_name
from schemas.expressions.values import number, quoted

_ANYWHERE = frozenset({"userData", "include", "dataQuality"})
_TYPES = {"number": "a number", "integer": "an integer", "text": "a text"}
_ENUMERATIONS = {
    "kind": ("road", "junction"),
    "end": ("start", "end"),
    "rule": ("RHT", "LHT"),
    "range": ("arcLength", "normalized"),
    "direction": ("standard", "reversed", "both"),
    "layer": ("permanent", "temporary"),
    "sides": ("left", "right", "both"),
    "boolean": ("true", "false", "1", "0"),
    "dynamic": ("yes", "no"),
    "orientation": ("+", "-", "none"),
    "junction": ("default", "virtual", "direct", "crossing"),
    "lane": (
        "none", "driving", "stop", "shoulder", "biking", "sidewalk", "border", "restricted",
        "parking", "bidirectional", "median", "special1", "special2", "special3", "roadWorks",
        "tram", "rail", "entry", "exit", "offRamp", "onRamp", "connectingRamp", "bus", "taxi",
        "HOV", "mwyEntry", "mwyExit", "curb", "slipLane", "walking", "shared",
    ),
}  # fmt: skip
_CUBIC = "a:number! b:number c:number d:number"
_LANES = "lanes/laneSection/{}/lane"


class _Element(NamedTuple):
    """children: the names of child elements, None for any. attributes: type by name. required:
    attributes that must be there.
    must: children that must be there."""

    children: frozenset[str] | None
    attributes: dict[str, str]
    required: tuple[str, ...]
    must: tuple[str, ...]


def _element(children: str | None = "", attributes: str = "") -> _Element:
    """An element from two lists of words; an exclamation mark stands behind what must be there."""
    names = [] if children is None else children.split()
    pairs = [word.split(":") for word in attributes.split()]
    return _Element(
        None if children is None else frozenset(name.rstrip("!") for name in names) | _ANYWHERE,
        {name: kind.rstrip("!") for name, kind in pairs},
        tuple(name for name, kind in pairs if kind.endswith("!")),
        tuple(name.rstrip("!") for name in names if name.endswith("!")),
    )


_LINK = _element(None, "elementType:kind! elementId:text! contactPoint:end elementS:number")
_OUTLINE = _element(None, "id:integer closed:boolean outer:boolean")
_VALIDITY = _element("", "fromLane:integer! toLane:integer!")
_LANE = {
    "": _element(
        "access border height link material roadMark rule speed visibility width",
        "id:integer! type:lane level:boolean direction:direction",
    ),
    "/link": _element("predecessor successor"),
    "/link/predecessor": _element("", "id:integer! layer:layer"),
    "/link/successor": _element("", "id:integer! layer:layer"),
    "/width": _element("", f"sOffset:number! {_CUBIC}"),
    "/border": _element("", f"sOffset:number! {_CUBIC}"),
    "/speed": _element("", "sOffset:number! max:text!"),
    "/roadMark": _element("explicit sway type", "sOffset:number width:number height:number"),
}
_OF_ROADS = {
    "": _element(
        "elevationProfile lanes! lateralProfile link objects planView! railroad "
        "signals surface type",
        "id:text! length:number! junction:text rule:rule",
    ),
    "link": _element("neighbor predecessor successor"),
    "link/predecessor": _LINK,
    "link/successor": _LINK,
    "type": _element("speed", "s:number! type:text"),
    "type/speed": _element("", "max:text!"),
    "planView": _element("geometry!"),
    "planView/geometry": _element(
        "arc line paramPoly3 poly3 spiral",
        "s:number! x:number! y:number! hdg:number! length:number!",
    ),
    "planView/geometry/line": _element(""),
    "planView/geometry/arc": _element("", "curvature:number!"),
    "planView/geometry/spiral": _element("", "curvStart:number! curvEnd:number!"),
    "planView/geometry/poly3": _element("", "a:number! b:number! c:number! d:number!"),
    "planView/geometry/paramPoly3": _element(
        "",
        "aU:number! bU:number! cU:number! dU:number! aV:number! bV:number! cV:number! dV:number! "
        "pRange:range",
    ),
    "elevationProfile": _element("elevation"),
    "elevationProfile/elevation": _element("", f"s:number! {_CUBIC}"),
    "lateralProfile": _element("crossSectionSurface crossfall shape superelevation"),
    "lateralProfile/superelevation": _element("", f"s:number! {_CUBIC}"),
    "lateralProfile/crossfall": _element("", f"s:number! side:sides {_CUBIC}"),
    "lateralProfile/shape": _element("", f"s:number! t:number! {_CUBIC}"),
    "lanes": _element("laneOffset laneSection!", "layer:layer"),
    "lanes/laneOffset": _element("", f"s:number! {_CUBIC}"),
    "lanes/laneSection": _element(
        "center! left right", "s:number! length:number singleSide:boolean"
    ),
    **{f"lanes/laneSection/{side}": _element("lane") for side in ("left", "center", "right")},
    **{
        _LANES.format(side) + path: declared
        for side in ("left", "center", "right")
        for path, declared in _LANE.items()
    },
    "objects": _element("bridge object objectReference tunnel"),
    "objects/object": _element(
        "borders markings material outline outlines parkingSpace repeat skeleton surface validity",
        "id:text s:number! t:number! zOffset:number hdg:number pitch:number roll:number "
        "length:number width:number radius:number"
        " height:number",
    ),
    "objects/object/outline": _OUTLINE,
    "objects/object/outlines/outline": _OUTLINE,
    "objects/object/validity": _VALIDITY,
    "signals": _element("signal signalReference"),
    "signals/signal": _element(
        None,
        "id:text! s:number! t:number! zOffset:number hOffset:number value:number width:number "
        "height:number dynamic:dynamic"
        " orientation:orientation",
    ),
    "signals/signal/validity": _VALIDITY,
    "signals/signalReference": _element(
        None, "id:text! s:number! t:number! orientation:orientation"
    ),
}
_TABLE = {
    "": _element("controller header! junction junctionGroup road! station vmsGroup"),
    "header": _element(
        "defaultRegulations geoReference license offset vendor",
        "revMajor:integer! revMinor:integer!",
    ),
    "header/offset": _element("", "x:number! y:number! z:number! hdg:number!"),
    "controller": _element("control", "id:text! sequence:integer"),
    "controller/control": _element("", "signalId:text!"),
    "junction": _element(None, "id:text! type:junction"),
    "junction/connection": _element("laneLink predecessor successor", "id:text contactPoint:end"),
    "junction/connection/laneLink": _element(
        "", "from:integer! to:integer! fromLayer:layer toLayer:layer"
    ),
    "junction/controller": _element("", "id:text!"),
    **{f"road/{path}".rstrip("/"): declared for path, declared in _OF_ROADS.items()},
}


_DECIDING = frozenset(
    path
    for path in _TABLE
    if path
    in (
        "",
        "road",
        "road/link",
        "road/elevationProfile",
        "road/lateralProfile",
        "road/lanes",
        "junction/connection",
    )
    or path.startswith(("road/planView", "road/lanes/laneSection"))
)
"""Elements whose children decide the ways and shapes of roads and lanes"""


class Unknown(NamedTuple):
    """An element that no version of the standard has where it stands.

    parent: names from the root to the element around it. expected: names that the standard has
    there. decides: whether the elements that it may be meant for decide the ways and shapes of
    roads and lanes.
    """

    element: etree._Element
    parent: str
    expected: frozenset[str]
    decides: bool


def unknown(root: etree._Element) -> Iterator[Unknown]:
    """Elements of a road network that the table does not have, in document order."""
    for _, path, declared, children in _described(root):
        if declared.children is not None:
            # Not those that may stand anywhere: nobody misspells `road` for `userData`.
            names = declared.children - _ANYWHERE
            for child, name in children:
                if name not in declared.children:
                    yield Unknown(child, path, names, path in _DECIDING)


def violations(root: etree._Element) -> Iterator[tuple[etree._Element, str]]:
    """Elements of a road network that contradict the table, in document order,
    with expectations.
    """
    for element, _, declared, children in _described(root):
        yield from ((element, message) for message in _attributes(element, declared))
        names = {name for _, name in children}
        for name in declared.must:
            if name not in names:
                yield element, f"the element {name} is missing"
        if declared.children is not None:
            for child, name in children:
                if name not in declared.children:
                    yield (
                        child,
                        (
                            f"the element {name} is not expected here; "
                            f"{nearest(name, sorted(declared.children - _ANYWHERE))}"
                        ),
                    )


_Children = list[tuple[etree._Element, str]]


def _described(root: etree._Element) -> Iterator[tuple[etree._Element, str, _Element, _Children]]:
    """Elements that the table describes, in document order: their path, description, and children
    with names."""
    # A list, since recursion is as deep as a file nests its elements.
    pending = [(root, "")]
    while pending:
        element, path = pending.pop()
        declared = _TABLE.get(path)
        if declared is None:
            continue
        children = [(child, local_name(child)) for child in element.iterchildren(etree.Element)]
        yield element, path, declared, children
        # Below an element that is not known nothing is: its children may be anything.
        known = (
            children
            if declared.children is None
            else [child for child in children if child[1] in declared.children]
        )
        pending += [(child, f"{path}/{name}".lstrip("/")) for child, name in reversed(known)]


def _attributes(element: etree._Element, declared: _Element) -> Iterator[str]:
    for name in declared.required:
        if name not in element.attrib:
            yield f"the attribute {name!r} is missing"
    for name, kind in declared.attributes.items():
        text = element.get(name)
        if text is not None and not _fits(kind, text, name in declared.required):
            expected = _TYPES.get(kind) or f"one of {', '.join(_ENUMERATIONS[kind])}"
            yield f"{name}={quoted(text)}: {expected} is expected"


def _fits(kind: str, text: str, required: bool) -> bool:
    # An optional attribute that is empty says as little as none.
    if kind == "text" or (not text.strip() and not required):
        return True
    if kind in _ENUMERATIONS:
        return text in _ENUMERATIONS[kind]
    try:
        value = number(text)
    except ValueError:
        return False
    # NaN compares false, and is refused with the infinities.
    return abs(value) < float("inf") and (kind == "number" or value.is_integer())
