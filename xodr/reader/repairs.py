"""Repairs of OpenDRIVE files that the reader refuses although their meaning is plain.

The reader itself is strict. Where it refuses a file, the repairs change the parsed document, and it
is read once more; each kind of repair becomes one remark. A repair never chooses between two
meanings: what is left unclear is refused by the reader.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from itertools import pairwise
from os import PathLike
from typing import NamedTuple

from lxml import etree

from schemas.common.errors import ToolchainError
from schemas.common.remarks import Remark
from schemas.common.terminal.text import finite_number
from schemas.common.xml import line_of
from xodr.model import PERMANENT
from xodr.reader.elements import (
    LARGEST,
    connections,
    read_controller,
    read_object,
    read_signal,
    read_signal_reference,
    read_structure,
    text,
)

SCHEMA = "asam.net:xodr:1.0.0:xml.valid_schema"
"""The rule that an attribute breaks which is missing or is not of its type."""


class Repair(NamedTuple):
    """One change of the document.

    fault: what was wrong with the element. assumption: what is read instead.
    """

    element: etree._Element
    rule: str
    fault: str
    assumption: str


def _value(element: etree._Element, name: str) -> float | None:
    """An attribute as a finite number; None where it is missing or something else."""
    return finite_number(element.get(name, ""))


def _given(element: etree._Element, name: str, fault: str) -> str:
    """Complaint about an attribute: its value with the fault, or that it is missing."""
    found = element.get(name)
    return f"{name} is missing" if found is None else f"{name}={found!r} {fault}"


def _leave_out(element: etree._Element) -> None:
    """Remove an element from its parent; the text behind it stays."""
    parent = element.getparent()
    if parent is not None:
        parent.remove(element)


# files without a header or without a version ------------------------------------------------------

_HEADER = "asam.net:xodr:1.0.0:xml.fileheader_is_present"
_VERSION = "asam.net:xodr:1.0.0:xml.version_is_defined"

_ASSUMED = {"revMajor": "1", "revMinor": "4"}


def _repair_header(root: etree._Element) -> Iterator[Repair]:
    """Give the file a header with a version where it has none."""
    header = root.find("header")
    if header is None:
        root.insert(0, etree.Element("header", _ASSUMED))
        yield Repair(root, _HEADER, "the element header is missing", "read as OpenDRIVE 1.4")
        return
    for name, assumed in _ASSUMED.items():
        number = _value(header, name)
        if number is None or number != int(number):
            fault = _given(header, name, "is no version")
            header.set(name, assumed)
            yield Repair(header, _VERSION, fault, "read as OpenDRIVE 1.4")


# attributes that are missing or make no sense where only one value can be meant -------------------

_NUMBERS = "xosc.toolchain:xodr:1.4.0:numbers_are_plausible"

_ZERO_BY_DEFAULT = {
    "elevation": ("a",),
    "superelevation": ("a",),
    "laneOffset": ("a",),
    "shape": ("a",),
    "width": ("a",),
    "border": ("a",),
    "crossfall": ("a",),
    "height": ("inner", "outer"),
    "arc": ("curvature",),
    "spiral": ("curvStart", "curvEnd"),
    "poly3": tuple("abcd"),
    "paramPoly3": tuple(name + axis for name in "abcd" for axis in "UV"),
}
"""Attributes that are 0 where they are missing, by element."""

_STARTS = {
    "elevation": "s",
    "superelevation": "s",
    "laneOffset": "s",
    "shape": "s",
    "crossfall": "s",
    "laneSection": "s",
    "type": "s",
    "width": "sOffset",
    "border": "sOffset",
    "height": "sOffset",
    "speed": "sOffset",
}
"""Attribute with the start of a record, by element; a missing one of a first record is 0."""

_PARENTS = {
    "elevation": "elevationProfile",
    **dict.fromkeys(("superelevation", "shape", "crossfall"), "lateralProfile"),
    **dict.fromkeys(("laneOffset", "laneSection"), "lanes"),
    **dict.fromkeys(("width", "border", "height", "speed"), "lane"),
    **dict.fromkeys(("arc", "spiral", "poly3", "paramPoly3"), "geometry"),
    "type": "road",
}
"""Parents of these records: road marks, objects and signals have other elements of the same names.
"""

_SHORT = 0.1
"""Records with absurd numbers are read as constant where they hold for at most this length, in m.
"""


def _repair_values(root: etree._Element) -> Iterator[Repair]:
    """Fill in, correct or leave out single values."""
    yield from _empty_curves(root)
    yield from _missing(root)
    yield from _absurd_records(root)
    yield from _speeds(root)


def _empty_curves(root: etree._Element) -> Iterator[Repair]:
    for curve in root.findall("road/planView/geometry/paramPoly3"):
        geometry = curve.getparent()
        # A curve with a constant only stays at one place, whatever its length.
        if geometry is not None and not any(
            _value(curve, name + axis) for name in "bcd" for axis in "UV"
        ):
            geometry.replace(curve, etree.Element("line"))
            yield Repair(curve, SCHEMA, "the curve has no coefficients", "read as a line")


def _missing(root: etree._Element) -> Iterator[Repair]:
    for road in root.iterfind("road"):
        for element in _records(road, _ZERO_BY_DEFAULT):
            for name in _ZERO_BY_DEFAULT[str(element.tag)]:
                if element.get(name) is None:
                    element.set(name, "0")
                    yield Repair(element, SCHEMA, f"the attribute {name!r} is missing", "read as 0")
        for element in _records(road, _STARTS):
            name = _STARTS[str(element.tag)]
            # Starts that are given but make no sense are for _repair_order, or refused.
            start = _start(element, name) if element.get(name) is None else None
            if start is not None:
                element.set(name, start)
                yield Repair(
                    element, SCHEMA, f"the attribute {name!r} is missing", f"read as {start}"
                )


def _records(road: etree._Element, names: Iterable[str]) -> Iterator[etree._Element]:
    """Records of some names in their places."""
    for element in road.iter(*names):
        parent = element.getparent()
        if parent is not None and parent.tag == _PARENTS[str(element.tag)]:
            yield element


def _start(element: etree._Element, name: str) -> str | None:
    """Return the start of a record that lacks it: 0 for the first, the preceding start for shapes,
    None for others."""
    before = next(element.itersiblings(str(element.tag), preceding=True), None)
    if before is None:
        return "0"
    return before.get(name) if element.tag == "shape" else None


def _absurd_records(root: etree._Element) -> Iterator[Repair]:
    """Polynomials that some exporters fit to stretches of some micrometres."""
    for road in root.iterfind("road"):
        length = _value(road, "length")
        for path in ("elevationProfile/elevation", "lateralProfile/superelevation"):
            yield from _constant_where_short(road.findall(path), "s", length)
        for lanes in road.iterfind("lanes"):
            yield from _constant_where_short(lanes.findall("laneOffset"), "s", length)
            sections = lanes.findall("laneSection")
            ends = [*(_value(section, "s") for section in sections), length]
            for section, start, end in zip(sections, ends, ends[1:], strict=False):
                reach = None if start is None or end is None else end - start
                for lane in section.iter("lane"):
                    for tag in ("width", "border"):
                        yield from _constant_where_short(lane.findall(tag), "sOffset", reach)


def _constant_where_short(
    records: list[etree._Element], name: str, reach: float | None
) -> Iterator[Repair]:
    """Make records constant that have absurd numbers and hold for a short stretch only.

    The last one holds up to `reach`.
    """
    # A record holds up to the next one of its kind.
    ends = [*(_value(record, name) for record in records), reach]
    for record, start, end in zip(records, ends, ends[1:], strict=False):
        absurd = next((letter for letter in "abcd" if not _plausible(record, letter)), None)
        if absurd is None or start is None or end is None or end - start > _SHORT:
            continue
        fault = f"{absurd}={record.get(absurd)} for {end - start:.2g} m"
        if _plausible(record, "a"):
            record.attrib.update(dict.fromkeys("bcd", "0"))
            yield Repair(record, _NUMBERS, fault, "the record is read as constant")
        else:
            _leave_out(record)
            yield Repair(record, _NUMBERS, fault, "the record is left out")


def _plausible(record: etree._Element, name: str) -> bool:
    number = _value(record, name)
    return name not in record.attrib or (number is not None and abs(number) <= LARGEST)


def _speeds(root: etree._Element) -> Iterator[Repair]:
    limits = (
        *root.iterfind("road/type/speed"),
        *root.iterfind("road/lanes/laneSection/*/lane/speed"),
    )
    for speed in limits:
        limit, number = speed.get("max"), _value(speed, "max")
        if limit is None:
            _leave_out(speed)
            yield Repair(speed, SCHEMA, "the attribute 'max' is missing", "no limit is read")
        elif number is not None and number < 0.0:
            speed.set("max", "undefined")
            yield Repair(speed, SCHEMA, f"max={limit!r} is negative", "read as 'undefined'")


# records that do not ascend, or of which several begin at the same place --------------------------

_ORDER = "xosc.toolchain:xodr:1.4.0:road.records_ascend"

_OF_ROADS = {
    "type": ("s",),
    "planView/geometry": ("s",),
    "elevationProfile/elevation": ("s",),
    "lateralProfile/superelevation": ("s",),
    "lateralProfile/crossfall": ("s",),
    "lateralProfile/shape": ("s", "t"),
}
_OF_LAYERS = {"laneOffset": ("s",), "laneSection": ("s",)}
_OF_LANES = {"width": ("sOffset",), "border": ("sOffset",), "speed": ("sOffset",)}
_UNIQUE = frozenset({"elevation", "superelevation", "laneOffset", "shape", "width", "border"})
"""Records that exclude each other at a place."""


def _repair_order(root: etree._Element) -> Iterator[Repair]:
    """Sort records, and keep the last of several that begin at the same place."""
    for tag, records in (
        ("road", _OF_ROADS),
        ("road/lanes", _OF_LAYERS),
        ("road/lanes/laneSection/*/lane", _OF_LANES),
    ):
        for element in root.iterfind(tag):
            for path, keys in records.items():
                yield from _sorted(element.findall(path), keys)


def _sorted(records: list[etree._Element], names: tuple[str, ...]) -> Iterator[Repair]:
    keys = {record: tuple(_value(record, name) for name in names) for record in records}
    if len(records) < 2 or any(None in key for key in keys.values()):
        return
    known = {
        record: tuple(number for number in key if number is not None)
        for record, key in keys.items()
    }
    # One remark for each list: sorting mends all of its faults at once.
    out_of_order = next(
        (after for before, after in pairwise(records) if known[after] < known[before]), None
    )
    if out_of_order is not None:
        before = records[records.index(out_of_order) - 1]
        _put_in_order(records, sorted(records, key=known.__getitem__))
        fault = f"{_place(known[out_of_order], names)} follows {_place(known[before], names)}"
        yield Repair(out_of_order, _ORDER, fault, "the records are read in ascending order")
    # In writing order of equals, for sorted() is stable: the last one of a place wins.
    for before, after in pairwise(sorted(records, key=known.__getitem__)):
        if (
            before.tag in _UNIQUE
            and known[before] == known[after]
            and before.attrib != after.attrib
        ):
            _leave_out(before)
            fault = f"two records begin at {_place(known[after], names)}"
            yield Repair(after, _ORDER, fault, "the last of them is read")


def _put_in_order(records: list[etree._Element], ordered: list[etree._Element]) -> None:
    parent = records[0].getparent()
    if parent is None:
        return
    # Put back where the list began: lane and lateralProfile have other children whose order counts.
    first = parent.index(records[0])
    for record in records:
        _leave_out(record)
    for number, record in enumerate(ordered):
        parent.insert(first + number, record)


def _place(key: tuple[float, ...], names: tuple[str, ...]) -> str:
    return " ".join(f"{name}={number:g}" for name, number in zip(names, key, strict=True))


# roads and geometries without a length ------------------------------------------------------------

_LINE = "xosc.toolchain:xodr:1.4.0:road.geometry.reference_line_is_complete"


_TOO_SHORT = 1e-9
"""Length (m) of roads and geometries that exporters write for none"""


def _length(element: etree._Element) -> float:
    length = _value(element, "length") or 0.0
    return length if abs(length) > _TOO_SHORT else 0.0


def _repair_plan_view(root: etree._Element) -> Iterator[Repair]:
    """Give roads the length of their line, and lines that of their road.

    Roads with neither are left out.
    """
    for road in root.findall("road"):
        geometries = road.findall("planView/geometry")
        length, *lengths = (_length(element) for element in (road, *geometries))
        # The lengths of a road and of its geometries are equal, so each tells the other.
        if length <= 0.0 and sum(lengths) > 0.0:
            fault = _given(road, "length", "is no length")
            road.set("length", repr(sum(lengths)))
            yield Repair(road, _LINE, fault, "the length of its geometries is read")
        elif length > 0.0 and len(geometries) == 1 and lengths == [0.0]:
            geometries[0].set("length", repr(length))
            yield Repair(
                geometries[0],
                _LINE,
                "the only geometry of the road has no length",
                "the length of the road is read",
            )
        elif not any(lengths):
            _leave_out(road)
            yield Repair(
                road,
                _LINE,
                f"the road {road.get('id')!r} has no geometry with a length",
                "the road is left out",
            )


# roads without lanes, lanes on the wrong side, lane links that lead nowhere -----------------------

_LANES = "xosc.toolchain:xodr:1.4.0:road.lane.lane_sections_are_whole"
_LAYERS = "asam.net:xodr:1.9.0:road.lane.layer.layer_limits"


def _repair_lanes(root: etree._Element) -> Iterator[Repair]:
    """Give every road a lane section, and every lane an id of its side."""
    for road in root.iterfind("road"):
        yield from _lane_sections(road)
        for side, sign in (("left", 1), ("right", -1)):
            for section in road.iterfind(f"lanes/laneSection/{side}"):
                yield from _lane_side(section, side, sign)
        for link in [
            *road.iterfind("lanes//link/predecessor"),
            *road.iterfind("lanes//link/successor"),
        ]:
            if _value(link, "id") is None:
                _leave_out(link)
                yield Repair(link, SCHEMA, _given(link, "id", "is no lane"), "the link is left out")


def _lane_sections(road: etree._Element) -> Iterator[Repair]:
    lanes, length = road.find("lanes"), _value(road, "length")
    layers: dict[str, etree._Element] = {}
    for layer in road.findall("lanes"):
        name = layer.get("layer") or PERMANENT
        if layers.setdefault(name, layer) is not layer:
            _leave_out(layer)
            yield Repair(
                layer,
                _LAYERS,
                f"the road {road.get('id')!r} has another {name} layer of lanes",
                "the first is read",
            )
    if lanes is None:
        lanes = etree.SubElement(road, "lanes")
    sections = lanes.findall("laneSection")
    if not sections:
        # The centre lane alone, as the smallest section that the reader takes.
        center = etree.SubElement(etree.SubElement(lanes, "laneSection", s="0"), "center")
        etree.SubElement(center, "lane", id="0")
        yield Repair(
            road,
            _LANES,
            f"the road {road.get('id')!r} has no lane section",
            "it is read as a road without lanes",
        )
    # Sections at or behind the end of the road hold nowhere; the first one holds from 0 on.
    for section in sections[1:]:
        start = _value(section, "s")
        if start is not None and length is not None and start >= length:
            _leave_out(section)
            fault = f"s={start:g} is not on the road, which is {length:g} m long"
            yield Repair(section, _LANES, fault, "the section is left out")


def _lane_side(section: etree._Element, side: str, sign: int) -> Iterator[Repair]:
    lanes = section.findall("lane")
    ids = [_value(lane, "id") for lane in lanes]
    # Mixed signs have two meanings (a wrong side, or a wrong sign), so the reader refuses them.
    if lanes and all(number is not None and number * sign < 0 for number in ids):
        for lane, number in zip(lanes, ids, strict=True):
            lane.set("id", f"{-(number or 0.0):.0f}")
        fault = f"the lane ids on the {side} side have the sign of the other side"
        yield Repair(lanes[0], _LANES, fault, "read with the sign of their side")


# signals, objects and controllers that cannot be read ---------------------------------------------

_READERS: dict[str, Callable[[etree._Element], object]] = {
    "road/signals/signal": lambda element: read_signal(element, ""),
    "road/signals/signalReference": read_signal_reference,
    "road/objects/object": lambda element: read_object(element, ""),
    "road/objects/bridge": read_structure,
    "road/objects/tunnel": read_structure,
    "controller": read_controller,
    "junction/controller": lambda element: text(element, "id"),
}


def _repair_roadside(root: etree._Element) -> Iterator[Repair]:
    """Leave out signals, objects, structures and controllers that the reader refuses."""
    for path, read in _READERS.items():
        # findall, not iterfind: elements are removed on the way.
        for element in root.findall(path):
            try:
                read(element)
            except ToolchainError as error:
                _leave_out(element)
                yield Repair(element, SCHEMA, error.message, f"the {element.tag} is left out")


# links and connections to roads and junctions that the file does not have -------------------------

_LINKED = "xosc.toolchain:xodr:1.4.0:road.linkage.linked_elements_exist"


_WORDS = {
    ("road", "rule"): {"right": "RHT", "left": "LHT"},
    ("lane", "direction"): {
        "forward": "standard",
        "forwards": "standard",
        "same": "standard",
        "backward": "reversed",
        "backwards": "reversed",
        "reverse": "reversed",
        "bidirectional": "both",
    },
}
"""Values by other words, which say the same, by element and attribute"""
_VALUES = {"rule": ("RHT", "LHT"), "direction": ("standard", "reversed", "both")}


def _repair_words(root: etree._Element) -> Iterator[Repair]:
    """Values of an enumeration in other words, or in another case."""
    for (tag, name), words in _WORDS.items():
        known = {value.lower(): value for value in _VALUES[name]}
        for element in root.iter(tag):
            text = element.get(name)
            if not text or text in _VALUES[name]:
                continue
            value = (known | words).get(text.strip().lower())
            if value is not None:
                fault = _given(element, name, f"is not one of {', '.join(_VALUES[name])}")
                element.set(name, value)
                yield Repair(element, SCHEMA, fault, f"{value} is meant")


def _repair_links(root: etree._Element) -> Iterator[Repair]:
    """Remove links and connections without a target; complete links without a contact point."""
    known = {
        kind: {element.get("id") for element in root.iterfind(kind)}
        for kind in ("road", "junction")
    }
    for road in root.iterfind("road"):
        for link in road.findall("link/*"):
            yield from _link(link, known)
    for junction in root.iterfind("junction"):
        for connection in connections(junction):
            yield from _connection(connection, known["road"])


def _link(link: etree._Element, known: dict[str, set[str | None]]) -> Iterator[Repair]:
    if link.tag not in ("predecessor", "successor"):
        return
    kind, name = link.get("elementType"), link.get("elementId")
    # Roads and junctions may share ids, in which case the kind cannot be told.
    if kind not in known:
        kinds = [kind for kind, names in known.items() if name in names]
        if len(kinds) == 1:
            fault = _given(link, "elementType", "is neither road nor junction")
            link.set("elementType", kinds[0])
            yield Repair(link, SCHEMA, fault, "the only element of that id is linked")
            return
    # The road then ends there: nothing tells which other was meant.
    if name not in known.get(kind or "", ()):
        _leave_out(link)
        yield Repair(link, _LINKED, f"the {kind} {name!r} does not exist", "the link is left out")
    elif link.get("elementS") and _value(link, "elementS") is None:
        _leave_out(link)
        yield Repair(
            link, SCHEMA, _given(link, "elementS", "is not a number"), "the link is left out"
        )
    elif link.get("contactPoint") not in ("start", "end", None):
        fault = _given(link, "contactPoint", "is neither start nor end")
        # The reader takes the nearer end where none is named.
        del link.attrib["contactPoint"]
        yield Repair(link, SCHEMA, fault, "the nearer end is linked")


def _connection(connection: etree._Element, roads: set[str | None]) -> Iterator[Repair]:
    ends = ("incomingRoad", "linkedRoad" if connection.get("linkedRoad") else "connectingRoad")
    for name in ends:
        road = connection.get(name)
        if road not in roads:
            _leave_out(connection)
            fault = _given(connection, name, "does not exist")
            yield Repair(
                connection, SCHEMA if road is None else _LINKED, fault, "the connection is left out"
            )
            return
    for link in connection.findall("laneLink"):
        if _value(link, "from") is None or _value(link, "to") is None:
            _leave_out(link)
            yield Repair(link, SCHEMA, "from and to are not both lanes", "the link is left out")


# all of them --------------------------------------------------------------------------------------

# The order counts: a repair relies on values that those before it filled in.
_REPAIRS: tuple[Callable[[etree._Element], Iterator[Repair]], ...] = (
    _repair_header,
    _repair_values,
    _repair_order,
    _repair_plan_view,
    _repair_lanes,
    _repair_roadside,
    _repair_words,
    _repair_links,  # last: roads may have been left out
)


def repair(root: etree._Element, path: str | PathLike[str]) -> tuple[Remark, ...]:
    """Repair a document, and report each assumption once.

    Names of its elements have no namespace any more.
    """
    found: dict[tuple[str, str], list[Repair]] = {}
    for kind in _REPAIRS:
        for fault in kind(root):
            found.setdefault((fault.rule, fault.assumption), []).append(fault)
    return tuple(_remark(path, alike) for alike in found.values())


def _remark(path: str | PathLike[str], alike: list[Repair]) -> Remark:
    """Remark on repairs of one kind: the first of them, and the number of others."""
    first = alike[0]
    more = f" (and {len(alike) - 1} more)" if len(alike) > 1 else ""
    message = f"{first.element.tag}: {first.fault}{more}; {first.assumption}"
    return Remark(first.rule, message, str(path), line_of(first.element))
