"""Coverage of OpenSCENARIO XML: compares the registries with the official XSD and writes
`docs/coverage.md`.

python -m studies.coverage docs/coverage.md
"""

from __future__ import annotations

import inspect
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from lxml import etree

from runner.engine.compile import registry
from runner.engine.compile.compiler import WRAPPERS
from schemas.common.errors import ToolchainError
from schemas.versions.differences import ATTRIBUTE, CHILD, VALUES, additions, known_differences
from schemas.versions.registry import schema_for

VERSIONS = ((1, 0), (1, 1), (1, 2), (1, 3), (1, 4))
VERSION = VERSIONS[-1]
_XSD = "{http://www.w3.org/2001/XMLSchema}"


class Family(NamedTuple):
    """Elements that one registry executes: the XSD type whose choices name them."""

    title: str
    type: str
    table: registry.Registry


FAMILIES = (
    Family("Private actions", "PrivateAction", registry.action),
    Family("Global actions", "GlobalAction", registry.action),
    Family("User-defined actions", "UserDefinedAction", registry.action),
    Family("Conditions by entity", "EntityCondition", registry.condition),
    Family("Conditions by value", "ByValueCondition", registry.condition),
    Family("Positions", "Position", registry.position),
)

OTHERS: dict[str, dict[str, str]] = {
    "EntityObject": {
        "CatalogReference": "entries of all nine kinds of catalogue, with parameter assignments",
        "Vehicle": (
            "cars, trucks, buses, two-wheelers, trains and trailers; performance "
            "limits are respected"
        ),
        "Pedestrian": "with its own bounding box; moves as a vehicle does",
        "MiscObject": "with its own bounding box",
        "ExternalObjectReference": (
            "refused, by name: objects of an external library can't be loaded"
        ),
    },
    "Shape": {
        "Polyline": "with and without times; headings from the vertices or along the path",
        "Clothoid": "curvature at its start, its change, and its length",
        "ClothoidSpline": "segments continue each other or begin anew",
        "Nurbs": "any order, weights and knots",
    },
    "DeterministicParameterDistribution": {
        "DeterministicSingleParameterDistribution": (
            "DistributionSet, DistributionRange, UserDefinedDistribution (by plug-in)"
        ),
        "DeterministicMultiParameterDistribution": "ValueSetDistribution",
    },
    "StochasticDistributionType": {
        "ProbabilityDistributionSet": "weights need not add up to 1",
        "NormalDistribution": "truncated to its Range where it has one",
        "LogNormalDistribution": "truncated to its Range where it has one",
        "UniformDistribution": "over its Range",
        "PoissonDistribution": "truncated to its Range where it has one",
        "Histogram": "a bin by its weight, then uniform",
        "UserDefinedDistribution": "by plug-in, refused by name where none is installed",
    },
    "ScenarioDefinition": {
        "ParameterDeclarations": "all types, expressions, constraint groups, every scope",
        "VariableDeclarations": "all types; set, modified and compared while the scenario runs",
        "MonitorDeclarations": "their values are in the event log",
        "CatalogLocations": "all nine kinds",
        "RoadNetwork": "OpenDRIVE 1.4 to 1.9; signals and their controllers",
        "Entities": "ScenarioObject and EntitySelection (by reference and by type)",
        "Storyboard": (
            "all states and transitions, priorities, execution counts, edges, "
            "delays, condition groups"
        ),
    },
}
"""Elements that no registry executes, by the XSD type that lists them, with a note for the reader.
"""


ESMINI = {
    "SpeedAction": "in part: followingMode is ignored",
    "LaneOffsetAction": "in part: continuous is ignored",
    "LateralDistanceAction": "in part: displacement any ends the player",
    "VisibilityAction": "in part: no SensorReferenceSet",
    "ActivateControllerAction": "in part: no animation domain",
    "AssignControllerAction": "in part: no animation domain",
    "AssignRouteAction": "in part: no closed routes, route parameters, random strategy",
    "LightStateAction": "in part: no UserDefinedLight",
    "AnimationAction": "no",
    "PreferredLaneLayerAction": "no",
    "EnvironmentAction": "in part: friction acts, the rest is drawn; no DomeImage, wetness",
    "TrafficSignalControllerAction": "no",
    "SetMonitorAction": "no",
    "ParameterAction/ModifyAction": "no",
    "TrafficSourceAction": "no",
    "TrafficSinkAction": "no",
    "TrafficSwarmAction": "in part: no TrafficDefinition, directions, range of initial speeds",
    "TrafficAreaAction": "no",
    "TrafficStopAction": "no",
    "DistanceCondition": "in part: routingAlgorithm is ignored",
    "RelativeDistanceCondition": "in part: routingAlgorithm is ignored",
    "TimeHeadwayCondition": "in part: routingAlgorithm is ignored",
    "TimeToCollisionCondition": "in part: routingAlgorithm is ignored",
    "RelativeAngleCondition": "no: ends the player",
    "TimeOfDayCondition": "no: dropped with a warning",
    "UserDefinedValueCondition": "no: dropped with a warning",
    "TrafficSignalControllerCondition": "no: dropped with a warning",
    "TrafficSignalCondition": "in part: signals with integer ids",
    "RoutePosition": "in part: not FromCurrentEntity",
    "GeoPosition": "no: the file is not loaded",
    "ExternalObjectReference": "no",
    "DeterministicSingleParameterDistribution": "in part: no UserDefinedDistribution",
    "ProbabilityDistributionSet": "no",
    "NormalDistribution": "no",
    "LogNormalDistribution": "no",
    "UniformDistribution": "no",
    "PoissonDistribution": "no",
    "Histogram": "no",
    "UserDefinedDistribution": "no",
    "ParameterDeclarations": "in part: no constraint groups, unsignedInt, unsignedShort, dateTime",
    "MonitorDeclarations": "no",
    "RoadNetwork": "in part: no traffic signal controllers, UsedArea",
    "Entities": "in part: no EntitySelection",
    "Storyboard": "in part: no selectTriggeringEntities; skipped events make no transition",
}
"""Gaps of esmini 3.6.0, from its documents and source; it executes everything else."""


_LISTED = ("PreferredLaneLayerAction",)
"""Additions that are rows of the tables above."""

NEW_IN_1_4 = {
    ("AbsoluteTargetLane", "layer"): "else the layer that the entity prefers, or keeps to",
    ("RelativeTargetLane", "layer"): "else the layer of the reference entity's lane",
    (
        "LanePosition",
        "layer",
    ): "else the temporary layer where there is one, or the one that the entity prefers",
    ("Vertex", "Motion"): "speed and acceleration there; with a Timing the times hold as well",
    ("ClothoidSplineSegment", "MotionStart"): "as of a Vertex",
    ("ClothoidSpline", "MotionEnd"): "as of a Vertex",
    ("Clothoid", "MotionStart"): "as of a Vertex",
    ("Clothoid", "MotionEnd"): "as of a Vertex",
    ("Polyline", "Interpolation"): "a smooth curve through the vertices, with a remark",
    (
        "Phase",
        "semantics",
    ): (
        "obeyed by SUMO's drivers, `idm`, `r157-cc`, `r157-reg`, `rss` and `fsm`, "
        "whatever the states show"
    ),
    (
        "TrafficDistribution",
        "CatalogReferences",
    ): "entries of a catalogue, with parameter assignments",
    ("TrafficDistributionEntry", "name"): "its name in a catalogue",
    ("TrafficDistributionEntry", "ParameterDeclarations"): "as of other catalogue entries",
    ("CatalogLocations", "TrafficDistributionEntryCatalog"): "as the other kinds",
    ("Catalog", "TrafficDistributionEntry"): "as the other kinds",
    (
        "VehicleCategory",
        "values",
    ): "driven, drawn and exported as the nearest of the categories before",
    ("Role", "values"): "kept; no motion depends on roles",
    ("VehicleLightType", "values"): "as the other lights",
}
"""Treatment of the additions of 1.4, by type and name."""


class CoverageRow(NamedTuple):
    """One element of the standard: what happens to it, and a note."""

    name: str
    status: str
    note: str


def schema_root(version: tuple[int, int] = VERSION) -> etree._Element:
    """Root of the XSD of a version, by default of the one that the coverage is compared with.

    Raises:
        ToolchainError: it is not at hand.
    """
    schema = schema_for("OpenSCENARIO", version)
    if schema is None:
        raise ToolchainError(f"the XSD of OpenSCENARIO {version[0]}.{version[1]} is not installed")
    return schema.tree().getroot()


def leaves(root: etree._Element, type_name: str) -> Iterator[tuple[str, str]]:
    """Parent and name of every element below a type of the XSD, through the elements that only
    group others."""
    for element in _elements(root, type_name):
        name = str(element.get("name"))
        if name in WRAPPERS:
            yield from leaves(root, str(element.get("type")))
        else:
            yield type_name, name


def _elements(root: etree._Element, type_name: str) -> Iterator[etree._Element]:
    for definition in root:
        if definition.get("name") == type_name:
            for inner in definition.iter(f"{_XSD}element", f"{_XSD}group"):
                if inner.tag == f"{_XSD}element":
                    yield inner
                elif inner.get("ref"):
                    yield from _elements(root, str(inner.get("ref")))


def first_versions() -> dict[str, str]:
    """The first version of the standard that has an element, by the element's name."""
    found: dict[str, str] = {}
    for version in VERSIONS:
        for element in schema_root(version).iter(f"{_XSD}element"):
            found.setdefault(str(element.get("name")), ".".join(map(str, version)))
    return found


def rows(root: etree._Element, family: Family) -> list[CoverageRow]:
    """Return the runner's treatment of each element of a family."""
    family.table.load()
    found = []
    for parent, name in leaves(root, family.type):
        key = f"{parent}/{name}" if f"{parent}/{name}" in family.table.classes else name
        if key in family.table.classes:
            found.append(CoverageRow(key, "executed", _first_line(family.table.classes[key])))
        elif key in family.table.refused:
            found.append(CoverageRow(key, "refused", family.table.refused[key]))
        else:
            found.append(CoverageRow(key, "unknown", ""))
    return list({row.name: row for row in found}.values())  # deprecated forms lie in two places


def other_rows(root: etree._Element, type_name: str) -> list[CoverageRow]:
    """Return the treatment of a type's elements that no registry executes."""
    notes = OTHERS[type_name]
    found = []
    for element in _elements(root, type_name):
        name = str(element.get("name"))
        note = notes.get(name)
        status = (
            "unknown" if note is None else "refused" if note.startswith("refused") else "executed"
        )
        found.append(CoverageRow(name, status, note or ""))
    return found


def new_parts() -> Iterator[tuple[str, str]]:
    """Type and name of each addition of 1.4 to a type that was there, as
    `NEW_IN_1_4` lists them.
    """
    for difference in known_differences():
        if difference.standard == "OpenSCENARIO" and difference.version[:2] == (1, 4):
            known = {each.get("name") for each in schema_root((1, 3))}
            for of, sign, new in additions(difference):
                if of in known and sign in (ATTRIBUTE, CHILD, VALUES) and new not in _LISTED:
                    yield of, new


def _first_line(cls: type) -> str:
    return " ".join((inspect.getdoc(cls) or "").split("\n\n")[0].split())


def markdown() -> str:
    """The whole page."""
    root, since = schema_root(), first_versions()
    sections = [(family.title, rows(root, family)) for family in FAMILIES]
    sections += [(title, other_rows(root, type_name)) for title, type_name in _TITLES.items()]
    total = [row for _, section in sections for row in section]
    executed = sum(row.status == "executed" for row in total)
    full = sum(row.name not in ESMINI for row in total)
    part = sum(ESMINI.get(row.name, "").startswith("in part") for row in total)
    lines = [
        "# Coverage of OpenSCENARIO XML",
        "",
        (
            "Generated by `make docs` from the runner's registries and the schema of OpenSCENARIO "
            "XML 1.4; a test fails when"
        ),
        (
            "this page, the registries and the schema disagree. Files of 1.0 to 1.3 are read in "
            "their own forms."
        ),
        "What is refused is refused before the run, by name, file and line. Nothing is skipped.",
        "",
        (
            f"{executed} of {len(total)} elements are executed here; esmini 3.6.0 executes {full} "
            f"in full and {part} in part."
        ),
    ]
    for title, section in sections:
        lines += [
            "",
            f"## {title}",
            "",
            "| element | since | here | what it does | esmini 3.6.0 |",
            "|---|---|---|---|---|",
        ]
        lines += [
            (
                f"| {row.name} | {since[row.name.rpartition('/')[2]]} | {row.status} | {row.note} "
                f"| {ESMINI.get(row.name, 'yes')} |"
            )
            for row in section
        ]
    lines += [
        "",
        "## Attributes, parts and values that 1.4 brought",
        "",
        "| of | new | what it does |",
        "|---|---|---|",
    ]
    lines += [f"| {of} | {new} | {NEW_IN_1_4[of, new]} |" for of, new in new_parts()]
    return "\n".join(lines) + "\n"


_TITLES = {
    "Entities": "EntityObject",
    "Trajectory shapes": "Shape",
    "Deterministic distributions": "DeterministicParameterDistribution",
    "Stochastic distributions": "StochasticDistributionType",
    "Scenario": "ScenarioDefinition",
}


def main() -> None:
    """Write the page to the file named on the command line."""
    Path(sys.argv[1]).write_text(markdown(), encoding="utf-8", newline="\n")


if __name__ == "__main__":
    main()
