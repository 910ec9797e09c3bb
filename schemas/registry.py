"""Which standard, version and kind a file has, and the official XSD for it.

XSDs are not part of this package. They are found in installed packages (scenariogeneration, which is a
dependency, and ASAM's checker bundles where they are installed) and in the folder that the environment
variable `XOSC_SCHEMA_DIR` names, searched with its subfolders. An XSD is recognised by what it says itself:
it declares the standard's root element, and its heading names the standard and version. Of several for the same
version a file of XOSC_SCHEMA_DIR wins, then the higher patch level: 1.3 files are validated with 1.3.1. A version that
has none, but a difference from one that has, gets that XSD with the difference applied.

A difference is a text of a line for each addition, in a notation of its own:

    Motion @ speed_longitudinal: Double?        an optional attribute (without `?` a required one)
    Vertex > Motion: Motion?                    a child element at the end of the content: `?` at most one, `*` any number,
                                                `+` one or more, none of them exactly one
    TrafficDistribution ^ choice 2              the content is a choice that may be made twice
    Role | construction other                   values of an enumeration
    Interpolation                               a type without content

A type that the earlier version lacks is made where it is first named; an enumeration also takes a parameter, as all of them do.
Source of the differences: the official XSDs compared, which a test repeats.
"""

from __future__ import annotations

import copy
import os
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache, cached_property
from importlib import metadata
from pathlib import Path
from typing import NamedTuple

from lxml import etree

from schemas.common.errors import InvalidFile, UsageError
from schemas.xml import line_of, local_name, parse

OPENSCENARIO, OPENDRIVE = "OpenSCENARIO", "OpenDRIVE"
SCHEMA_DIR = "XOSC_SCHEMA_DIR"

HEADERS = {OPENSCENARIO: "FileHeader", OPENDRIVE: "header"}
_PACKAGES = ("scenariogeneration", "asam-qc-openscenarioxml", "asam-qc-opendrive")
_HEADING_BYTES = 4096
_HEADING = re.compile(rb"(OpenSCENARIO|OpenDRIVE)\b[^<>]{0,60}?(?:V|Rev\. ?)(\d+)\.(\d+)(?:\.(\d+))?")
_ROOT_ELEMENT = re.compile(rb"<\w+:element name=\"(?:OpenSCENARIO|OpenDRIVE)\"")
_XSD_1_1 = re.compile(rb"<\w+:(?:assert|alternative|openContent|override)\b|minVersion=\"1\.1\"")


_XSD = "{http://www.w3.org/2001/XMLSchema}"
_OCCURS = {"": {}, "?": {"minOccurs": "0"}, "*": {"minOccurs": "0", "maxOccurs": "unbounded"}, "+": {"maxOccurs": "unbounded"}}
_MODELS = tuple(f"{_XSD}{name}" for name in ("sequence", "choice", "all"))
_LINE = re.compile(r"(\w+)(?: +([@>^|/!-]) +(.+))?")
_DECLARED = re.compile(r"(\w+): ([\w:]+)([?*+]|\{\d+,\d*\}|=\w+)?")


class Difference(NamedTuple):
    """Difference between a version of a standard and an earlier one.

    Attributes:
        standard: the standard's root element.
        version: the later version: major, minor, patch.
        base: the earlier one, whose XSD is at hand.
        additions: a line each.
    """

    standard: str
    version: tuple[int, int, int]
    base: tuple[int, int, int]
    additions: str


DIFFERENCES = (
    Difference(
        "OpenSCENARIO", (1, 4, 0), (1, 3, 1),
        """
        LaneLayerType | permanent temporary
        AbsoluteTargetLane @ layer: LaneLayerType?
        RelativeTargetLane @ layer: LaneLayerType?
        LanePosition @ layer: LaneLayerType?
        PreferredLaneLayerAction @ layer: LaneLayerType
        RoutingAction > PreferredLaneLayerAction: PreferredLaneLayerAction

        Motion @ speed_longitudinal: Double?
        Motion @ acceleration_longitudinal: Double?
        Vertex > Motion: Motion?
        ClothoidSplineSegment > MotionStart: Motion?
        ClothoidSpline > MotionEnd: Motion?
        Clothoid > MotionStart: Motion?
        Clothoid > MotionEnd: Motion?
        Interpolation
        Polyline > Interpolation: Interpolation?

        TrafficSignalSemantics | go stop attention_go attention_stop caution fallback
        Phase @ semantics: TrafficSignalSemantics?

        TrafficDistribution ^ choice 2
        TrafficDistribution > CatalogReferences: CatalogReference+
        TrafficDistributionEntry @ name: String?
        TrafficDistributionEntry > ParameterDeclarations: ParameterDeclarations?
        TrafficDistributionEntryCatalogLocation > Directory: Directory
        CatalogLocations > TrafficDistributionEntryCatalog: TrafficDistributionEntryCatalogLocation?
        Catalog > TrafficDistributionEntry: TrafficDistributionEntry*

        VehicleCategory | aircraft heavyTruck landVehicle micromobilityDevice motorcycle other semitractor standupScooter
        VehicleCategory | watercraft wheelchair workMachine
        Role | agriculture construction dangerousGoodsTransport fireBrigade freightTransport garbageCollection other
        Role | roadsideAssistance specialTransport trafficControl
        VehicleLightType | tailLights
        """,
    ),
    Difference(
        "OpenDRIVE", (1, 9, 0), (1, 8, 0),
        """
        e_layerType | permanent temporary
        t_road > lanes: t_road_lanes{1,2}
        t_road_lanes @ layer: e_layerType?
        t_road_lanes ! not(@layer = 'permanent' and laneSection/@length)
        t_road_lanes ! not(laneOffset and laneSection//border)
        t_road_lanes_laneSection @ length: t_grEqZero?
        t_road_lanes_laneSection_lcr_lane_link_predecessorSuccessor @ layer: xs:string?
        OBJECT_laneValidity @ layer: e_layerType?

        t_junction_connection_laneLink @ fromLayer: e_layerType?
        t_junction_connection_laneLink @ toLayer: e_layerType?
        t_junction_connection_virtual @ type: e_connection_type=virtual
        t_junction_common ! every $each in connection/@id satisfies count(connection[@id = $each]) = 1
        t_junction_direct ! every $each in connection/@id satisfies count(connection[@id = $each]) = 1
        t_junction_virtual ! every $each in connection/@id satisfies count(connection[@id = $each]) = 1
        t_junction_priority @ high: xs:string
        t_junction_priority @ low: xs:string

        t_road_lateralProfile ! not(crossSectionSurface and (superelevation or shape))
        t_road_surface_CRG @ xOffset: xs:double?
        t_road_surface_CRG @ yOffset: xs:double?

        OBJECT @ invalidated: xs:boolean?
        OBJECT @ temporary: xs:boolean?
        OBJECT ! not(@type = 'barrier' and (@radius or material or surface or parkingSpace or skeleton or repeat/@distance != 0))
        OBJECT ! not(@type = 'building' and (material or surface or parkingSpace or skeleton or repeat/@distance <= 0))
        OBJECT ! not(@type = 'crosswalk' and (@radius or parkingSpace or skeleton or repeat/@distance = 0))
        OBJECT ! not(@type = 'gantry' and (@radius or material or surface or parkingSpace or repeat/@distance <= 0))
        OBJECT ! not(@type = 'obstacle' and (material or surface or parkingSpace or skeleton or repeat/@distance <= 0))
        OBJECT ! not(@type = 'parkingSpace' and (@radius or skeleton or repeat/@distance <= 0))
        OBJECT ! not(@type = 'pole' and (material or surface or parkingSpace or repeat/@distance <= 0))
        OBJECT ! not(@type = 'roadMark' and (@radius or parkingSpace or skeleton or repeat/@distance <= 0))
        OBJECT ! not(@type = 'roadSurface' and (parkingSpace or skeleton or repeat/@distance <= 0))
        OBJECT ! not(@type = 'trafficIsland' and (surface or parkingSpace or skeleton))
        OBJECT ! not(@type = 'tree' and (material or surface or parkingSpace or repeat/@distance <= 0))
        OBJECT ! not(@type = 'vegetation' and (material or surface or parkingSpace or skeleton or repeat/@distance <= 0))
        OBJECT ! not(@radius and (@width or @length)) and ((@width and @length) or not(@width or @length))
        OBJECT_borders_border ! if (@useCompleteOutline) then not(cornerReference) else count(cornerReference) > 1
        OBJECT_repeat @ bT: t_grEqZero?
        OBJECT_repeat @ cT: t_grEqZero?
        OBJECT_repeat @ dT: t_grEqZero?
        OBJECT_skeleton_polyline / vertexRoad: OBJECT_skeleton_polyline_vertexRoad{2,}
        OBJECT_skeleton_polyline / vertexLocal: OBJECT_skeleton_polyline_vertexLocal{2,}
        OBJECT_outlines_outline / cornerRoad: OBJECT_outlines_outline_cornerRoad{2,}
        OBJECT_outlines_outline / cornerLocal: OBJECT_outlines_outline_cornerLocal{2,}
        OBJECT_outlines_outline / curveLocal: OBJECT_outlines_outline_curveLocal+
        OBJECT_outlines_outline > markings: OBJECT_markings?
        OBJECT_outlines_outline_curveLocal > arc: OBJECT_outlines_outline_curveLocal_arc
        OBJECT_outlines_outline_curveLocal > line: OBJECT_outlines_outline_curveLocal_line
        OBJECT_outlines_outline_curveLocal > paramPoly3: OBJECT_outlines_outline_curveLocal_paramPoly3
        OBJECT_outlines_outline_curveLocal ^ choice 1
        OBJECT_outlines_outline_curveLocal @ hdg: xs:double
        OBJECT_outlines_outline_curveLocal @ height: t_grEqZero
        OBJECT_outlines_outline_curveLocal @ id: xs:nonNegativeInteger?
        OBJECT_outlines_outline_curveLocal @ length: t_grZero
        OBJECT_outlines_outline_curveLocal @ u: xs:double
        OBJECT_outlines_outline_curveLocal @ v: xs:double
        OBJECT_outlines_outline_curveLocal @ z: xs:double
        OBJECT_outlines_outline_curveLocal_arc @ curvature: xs:double
        OBJECT_outlines_outline_curveLocal_line
        OBJECT_outlines_outline_curveLocal_paramPoly3 @ aU: xs:double
        OBJECT_outlines_outline_curveLocal_paramPoly3 @ bU: xs:double
        OBJECT_outlines_outline_curveLocal_paramPoly3 @ cU: xs:double
        OBJECT_outlines_outline_curveLocal_paramPoly3 @ dU: xs:double
        OBJECT_outlines_outline_curveLocal_paramPoly3 @ aV: xs:double
        OBJECT_outlines_outline_curveLocal_paramPoly3 @ bV: xs:double
        OBJECT_outlines_outline_curveLocal_paramPoly3 @ cV: xs:double
        OBJECT_outlines_outline_curveLocal_paramPoly3 @ dV: xs:double
        OBJECT_outlines_outline_curveLocal_paramPoly3 @ pRange: e_paramPoly3_pRange

        t_road_signals_signal - staticBoard vmsBoard
        t_road_signals_signal @ invalidated: xs:boolean?
        t_road_signals_signal @ temporary: xs:boolean?
        t_road_signals_signal_road > staticBoard: t_road_signals_staticBoard*
        t_road_signals_signal_road > vmsBoard: t_road_signals_vmsBoard*
        t_road_signals_signal_road ! not(@type = 'multiBoard') or (@dynamic = 'yes' and vmsBoard and staticBoard)
        e_personCategory | pedestrian
        e_vehicleCategory | bicycle bus car heavyTruck landVehicle microMobilityDevice motorcycle other
        e_vehicleCategory | semiTractor semiTrailer standupScooter trailer train tram van workMachine
        t_signals_semantics_animal
        t_signals_semantics_person > type: e_personCategory
        t_signals_semantics_vehicle > type: e_vehicleCategory
        t_signals_semantics_prohibited > animal: t_signals_semantics_animal*
        t_signals_semantics_prohibited > person: t_signals_semantics_person*
        t_signals_semantics_prohibited > vehicle: t_signals_semantics_vehicle*
        t_signals_semantics_supplementaryAllows > animal: t_signals_semantics_animal*
        t_signals_semantics_supplementaryAllows > person: t_signals_semantics_person*
        t_signals_semantics_supplementaryAllows > vehicle: t_signals_semantics_vehicle*
        t_signals_semantics_supplementaryProhibits > animal: t_signals_semantics_animal*
        t_signals_semantics_supplementaryProhibits > person: t_signals_semantics_person*
        t_signals_semantics_supplementaryProhibits > vehicle: t_signals_semantics_vehicle*
        t_signals_semantics_speed - type unit value
        t_signals_semantics_speed @ type: e_signals_semantics_speed?
        t_signals_semantics_speed @ unit: e_unitSpeed?
        t_signals_semantics_speed @ value: xs:double?
        e_signals_semantics_lane | other
        """.replace("OBJECT", "t_road_objects_object"),
    ),
)  # fmt: skip


@dataclass(frozen=True)
class FileType:
    """Type of a document: standard and version.

    Attributes:
        standard: "OpenSCENARIO" or "OpenDRIVE".
        version: major and minor revision.
        kind: "scenario", "catalog", "distribution" (of parameter values) or "road".
    """

    standard: str
    version: tuple[int, int]
    kind: str

    def __str__(self) -> str:
        return f"{self.standard} {self.version[0]}.{self.version[1]}"


@dataclass(frozen=True)
class Schema:
    """An official XSD, or one that is made of an official XSD and a difference.

    Attributes:
        standard: "OpenSCENARIO" or "OpenDRIVE".
        version: major, minor and patch level of the standard.
        path: the XSD that declares the root element; it includes its neighbours by relative names.
        difference: what is added to that XSD; None where it is that of the version itself.
    """

    standard: str
    version: tuple[int, int, int]
    path: Path
    difference: Difference | None = None

    def __str__(self) -> str:
        return f"{self.standard} {'.'.join(map(str, self.version))}"

    def tree(self) -> etree._ElementTree:
        """The parsed XSD, with the difference applied.

        Raises:
            InvalidFile: the file can't be read or is no XML.
        """
        return parse(self.path) if self.difference is None else applied(self.difference, _whole(self.path))

    @cached_property
    def xsd_1_1(self) -> bool:
        """Whether it, or a file beside it that it includes, needs an XSD 1.1 processor.

        The official schemas keep their parts in one folder, so the neighbours it includes are looked at as well.
        """
        content = self.path.read_bytes()
        names = re.findall(rb"schemaLocation=\"([^\"/\\]+)\"", content)
        parts = [self.path.parent / name.decode(errors="replace") for name in names]
        return any(_XSD_1_1.search(text) for text in [content, *(part.read_bytes() for part in parts if part.is_file())])


def detect(tree: etree._ElementTree) -> FileType:
    """Standard, version and kind of a parsed document.

    Raises:
        InvalidFile: the root element is of neither standard, or the header with the revision is missing or malformed.
    """
    root = tree.getroot()
    path = tree.docinfo.URL
    standard = local_name(root)
    if standard not in HEADERS:
        message = f"the root element is <{standard}>, OpenSCENARIO or OpenDRIVE is expected"
        raise InvalidFile(message, path=path, line=line_of(root))
    header = header_of(root)
    if header is None:
        message = f"the element {HEADERS[standard]}, which holds the version, is missing"
        raise InvalidFile(message, path=path, line=line_of(root), element=standard)
    version = revision(header.get("revMajor")), revision(header.get("revMinor"))
    if version[0] is None or version[1] is None:
        message = "the attributes revMajor and revMinor must hold the version, two non-negative integers"
        raise InvalidFile(message, path=path, line=line_of(header), element=local_name(header))
    return FileType(standard, (version[0], version[1]), _kind(root))


def header_of(root: etree._Element) -> etree._Element | None:
    """The element that holds the version."""
    name = HEADERS.get(local_name(root))
    return next((child for child in root if name and local_name(child) == name), None)


def revision(text: str | None) -> int | None:
    """A part of the version, an unsignedShort; None for anything else."""
    if text is None or not re.fullmatch(r"\s*\+?\d{1,5}\s*", text, re.ASCII) or int(text) > 65535:
        return None
    return int(text)


def schema_for(standard: str, version: tuple[int, int]) -> Schema | None:
    """The XSD to validate that version with, or None where none is at hand.

    Raises:
        UsageError: XOSC_SCHEMA_DIR does not name a folder.
    """
    return _schemas(os.environ.get(SCHEMA_DIR, "")).get((standard, *version))


def available_schemas() -> list[Schema]:
    """Every XSD at hand, one a version, sorted."""
    return [schema for _, schema in sorted(_schemas(os.environ.get(SCHEMA_DIR, "")).items())]


def _kind(root: etree._Element) -> str:
    if local_name(root) == OPENDRIVE:
        return "road"
    children = {local_name(child) for child in root}
    if "Catalog" in children:
        return "catalog"
    return "distribution" if "ParameterValueDistribution" in children else "scenario"


@cache
def _schemas(folder: str) -> dict[tuple[str, int, int], Schema]:
    if folder and not Path(folder).expanduser().is_dir():
        raise UsageError(f"{SCHEMA_DIR} names {folder!r}, which is not a folder")
    found: dict[tuple[str, int, int], Schema] = {}
    bases: dict[tuple[str, tuple[int, int, int]], Schema] = {}
    for files in (_installed(), Path(folder).expanduser().rglob("*.xsd") if folder else ()):
        group = sorted((schema for path in files if (schema := _read(path))), key=lambda schema: (schema.version, schema.path))
        found |= {(schema.standard, *schema.version[:2]): schema for schema in group}
        bases |= {(schema.standard, schema.version): schema for schema in group}
    for difference in DIFFERENCES:
        base = _base(difference, bases)
        if base is not None:
            made = Schema(difference.standard, difference.version, base.path, difference)
            found.setdefault((made.standard, *made.version[:2]), made)
    return found


def _base(difference: Difference, bases: dict[tuple[str, tuple[int, int, int]], Schema]) -> Schema | None:
    """The XSD of the version that a difference is from, or of a later patch level of it."""
    found = [schema for (standard, version), schema in bases.items() if standard == difference.standard]
    fitting = [each for each in found if each.version[:2] == difference.base[:2] and each.version >= difference.base]
    return min(fitting, key=lambda schema: schema.version, default=None)


def _installed() -> Iterator[Path]:
    for package in _PACKAGES:
        try:
            files = metadata.files(package) or []
        except metadata.PackageNotFoundError:
            continue
        yield from (Path(str(file.locate())) for file in files if file.suffix == ".xsd")


def _read(path: Path) -> Schema | None:
    try:
        content = path.read_bytes()
    except OSError:
        return None
    heading = _HEADING.search(content[:_HEADING_BYTES])
    if heading is None or not _ROOT_ELEMENT.search(content):
        return None
    standard, major, minor, patch = (group.decode() if group else "0" for group in heading.groups())
    return Schema(standard, (int(major), int(minor), int(patch)), path)


# differences ---------------------------------------------------------------------------------

ATTRIBUTE, CHILD, CHOICE, MODEL, VALUES, REMOVED, ASSERTED = "@", ">", "/", "^", "|", "-", "!"
"""The signs between a type and what is added to it: an attribute, a child, an alternative of its choice, which is then required;
another model, values, children that are removed, an assertion (XPath 2.0). What is there by that name is replaced."""


def additions(difference: Difference) -> Iterator[tuple[str, str, str]]:
    """Type, sign and name of each addition; values of an enumeration are added once, under the name "values"."""
    told: set[str] = set()
    for name, sign, rest in _lines(difference):
        if sign in (ATTRIBUTE, CHILD):
            yield name, sign, _declaration(rest)[0]
        elif sign == VALUES and name not in told:
            told.add(name)
            yield name, sign, "values"


def _lines(difference: Difference) -> Iterator[tuple[str, str, str]]:
    """Type, sign and rest of each line; a type without content has neither sign nor rest."""
    for line in filter(None, map(str.strip, difference.additions.splitlines())):
        parts = _LINE.fullmatch(line)
        assert parts is not None, line
        name, sign, rest = parts.groups(default="")
        yield name, sign, rest


def applied(difference: Difference, base: etree._ElementTree) -> etree._ElementTree:
    """The XSD of the later version, from that of the earlier one, which is not changed."""
    tree = copy.deepcopy(base)
    root = tree.getroot()
    for name, sign, rest in _lines(difference):
        _ADD[sign](_type(root, name, "simpleType" if sign == VALUES else "complexType"), rest)
    return tree


def _whole(path: Path) -> etree._ElementTree:
    """An XSD with the files beside it that it includes in place of these inclusions."""
    tree, known = parse(path), {path.name}
    root = tree.getroot()
    while (include := next(root.iterchildren(f"{_XSD}include"), None)) is not None:
        name = include.get("schemaLocation") or ""
        if name not in known and "/" not in name and "\\" not in name:
            known.add(name)
            for each in list(parse(path.parent / name).getroot()):
                root.append(each)
        root.remove(include)
    for include in list(root.iterchildren(f"{_XSD}include")):
        root.remove(include)
    ahead = [each for each in root if each.tag in (f"{_XSD}import", f"{_XSD}redefine", f"{_XSD}override")]
    for each in reversed(ahead):
        root.insert(0, each)
    return tree


def _type(root: etree._Element, name: str, tag: str) -> etree._Element:
    """The named type, made where there is none."""
    found = next((each for each in root.iterchildren(f"{_XSD}{tag}") if each.get("name") == name), None)
    return found if found is not None else etree.SubElement(root, f"{_XSD}{tag}", {"name": name})


def _add_attribute(kind: etree._Element, rest: str) -> None:
    name, value, occurs = _declaration(rest)
    use = {} if occurs == "?" else {"use": "required"}
    fixed = {"fixed": occurs[1:]} if occurs.startswith("=") else {}
    content = _content(kind)
    _remove(content, "attribute", name)
    added = etree.Element(f"{_XSD}attribute", {"name": name, "type": value, **use, **fixed})
    first = next(content.iterchildren(f"{_XSD}assert"), None)
    content.insert(len(content) if first is None else content.index(first), added)


def _content(kind: etree._Element) -> etree._Element:
    """The element that holds the children and attributes of a type: the extension, where it extends another type."""
    extension = kind.find(f"{_XSD}complexContent/{_XSD}extension")
    return kind if extension is None else extension


def _remove(content: etree._Element, tag: str, name: str) -> int | None:
    """Remove the declaration of an attribute or a child; its place among the others, None where there is none."""
    found = next((each for each in content.iterchildren(f"{_XSD}{tag}") if each.get("name") == name), None)
    if found is None:
        return None
    place = content.index(found)
    content.remove(found)
    return place


def _add_child(kind: etree._Element, rest: str) -> None:
    content = _content(kind)
    model = next(content.iterchildren(*_MODELS), None)
    if model is None:
        model = etree.Element(f"{_XSD}sequence")
        content.insert(0, model)
    _declare(model, rest)


def _declare(model: etree._Element, rest: str) -> None:
    name, value, occurs = _declaration(rest)
    place = _remove(model, "element", name)
    if occurs.startswith("{"):
        least, most = occurs[1:-1].split(",")
        times = {"minOccurs": least, "maxOccurs": most or "unbounded"}
    else:
        times = _OCCURS[occurs]
    model.insert(len(model) if place is None else place, etree.Element(f"{_XSD}element", {"name": name, "type": value, **times}))


def _add_choice(kind: etree._Element, rest: str) -> None:
    choice = next(_content(kind).iter(f"{_XSD}choice"))
    choice.set("minOccurs", "1")
    _declare(choice, rest)


def _remove_children(kind: etree._Element, rest: str) -> None:
    for model in _content(kind).iterchildren(*_MODELS):
        for name in rest.split():
            _remove(model, "element", name)


def _add_assertion(kind: etree._Element, rest: str) -> None:
    etree.SubElement(_content(kind), f"{_XSD}assert", {"test": rest})


def _change_model(kind: etree._Element, rest: str) -> None:
    name, times = rest.split()
    model = next(_content(kind).iterchildren(*_MODELS))
    model.tag = f"{_XSD}{name}"
    model.set("maxOccurs", times)


def _add_values(kind: etree._Element, rest: str) -> None:
    restriction = next(kind.iter(f"{_XSD}restriction"), None)
    if restriction is None and not _takes_parameters(kind):
        restriction = etree.SubElement(kind, f"{_XSD}restriction", {"base": f"{kind.prefix}:string"})
    if restriction is None:
        union = etree.SubElement(kind, f"{_XSD}union")
        for base in ("parameter", f"{kind.prefix}:string"):
            restriction = etree.SubElement(etree.SubElement(union, f"{_XSD}simpleType"), f"{_XSD}restriction", {"base": base})
        assert restriction is not None
    for value in rest.split():
        etree.SubElement(restriction, f"{_XSD}enumeration", {"value": value})


def _takes_parameters(kind: etree._Element) -> bool:
    """Whether the standard lets parameters stand for values: OpenSCENARIO."""
    return any(each.get("name") == "parameter" for each in kind.itersiblings(f"{_XSD}simpleType", preceding=True))


def _declaration(text: str) -> tuple[str, str, str]:
    """Name, type and occurrence in the text of a declaration."""
    parts = _DECLARED.fullmatch(text)
    assert parts is not None, text
    name, kind, occurs = parts.groups(default="")
    return name, kind, occurs


_ADD: dict[str, Callable[[etree._Element, str], None]] = {
    ATTRIBUTE: _add_attribute,
    CHILD: _add_child,
    CHOICE: _add_choice,
    REMOVED: _remove_children,
    ASSERTED: _add_assertion,
    MODEL: _change_model,
    VALUES: _add_values,
    "": lambda kind, rest: None,
}
"""Makers of additions by the sign between the type and the rest of the line."""
