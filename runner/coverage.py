"""What of OpenSCENARIO XML is executed: compares the registries with the official XSD and writes `docs/coverage.md`.

python -m runner.coverage docs/coverage.md
"""

from __future__ import annotations

import inspect
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from lxml import etree

from runner.contracts import registry
from runner.interpreter.compiler import WRAPPERS
from schemas.errors import ToolchainError
from schemas.registry import schema_for

VERSION = (1, 3)
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
        "CatalogReference": "entries of all eight kinds of catalogue, with parameter assignments",
        "Vehicle": "cars, trucks, buses, two-wheelers, trains and trailers; performance limits are respected",
        "Pedestrian": "with its own bounding box; moves as a vehicle does",
        "MiscObject": "with its own bounding box",
        "ExternalObjectReference": "refused, by name: objects of an external library can't be loaded",
    },
    "Shape": {
        "Polyline": "with and without times; headings from the vertices or along the path",
        "Clothoid": "curvature at its start, its change, and its length",
        "ClothoidSpline": "segments continue each other or begin anew",
        "Nurbs": "any order, weights and knots",
    },
    "DeterministicParameterDistribution": {
        "DeterministicSingleParameterDistribution": "DistributionSet, DistributionRange, UserDefinedDistribution (by plug-in)",
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
        "CatalogLocations": "all eight kinds",
        "RoadNetwork": "OpenDRIVE 1.4 to 1.8; signals and their controllers",
        "Entities": "ScenarioObject and EntitySelection (by reference and by type)",
        "Storyboard": "all states and transitions, priorities, execution counts, edges, delays, condition groups",
    },
}
"""Elements that no registry executes, by the XSD type that lists them, with a note for the reader."""


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
"""What esmini 3.6.0 does not do, as read from its documents and source; everything else it does."""


class Row(NamedTuple):
    """One element of the standard: what happens to it, and a note."""

    name: str
    status: str
    note: str


def schema_root() -> etree._Element:
    """Root of the XSD that the coverage is compared with.

    Raises:
        ToolchainError: it is not at hand.
    """
    schema = schema_for("OpenSCENARIO", VERSION)
    if schema is None:
        raise ToolchainError("the XSD of OpenSCENARIO 1.3 is not installed")
    return etree.parse(schema.path).getroot()


def leaves(root: etree._Element, type_name: str) -> Iterator[tuple[str, str]]:
    """Parent and name of every element below a type of the XSD, through the elements that only group others."""
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


def rows(root: etree._Element, family: Family) -> list[Row]:
    """What the runner does with each element of a family."""
    family.table.load()
    found = []
    for parent, name in leaves(root, family.type):
        key = f"{parent}/{name}" if f"{parent}/{name}" in family.table.classes else name
        if key in family.table.classes:
            found.append(Row(key, "executed", _first_line(family.table.classes[key])))
        elif key in family.table.refused:
            found.append(Row(key, "refused", family.table.refused[key]))
        else:
            found.append(Row(key, "unknown", ""))
    return list({row.name: row for row in found}.values())  # deprecated forms lie in two places


def other_rows(root: etree._Element, type_name: str) -> list[Row]:
    """What happens to the elements of a type that no registry executes."""
    notes = OTHERS[type_name]
    found = []
    for element in _elements(root, type_name):
        name = str(element.get("name"))
        note = notes.get(name)
        status = "unknown" if note is None else "refused" if note.startswith("refused") else "executed"
        found.append(Row(name, status, note or ""))
    return found


def _first_line(cls: type) -> str:
    return " ".join((inspect.getdoc(cls) or "").split("\n\n")[0].split())


def markdown() -> str:
    """The whole page."""
    root = schema_root()
    sections = [(family.title, rows(root, family)) for family in FAMILIES]
    sections += [(title, other_rows(root, type_name)) for title, type_name in _TITLES.items()]
    total = [row for _, section in sections for row in section]
    executed = sum(row.status == "executed" for row in total)
    full = sum(row.name not in ESMINI for row in total)
    part = sum(ESMINI.get(row.name, "").startswith("in part") for row in total)
    lines = [
        "# Coverage of OpenSCENARIO XML",
        "",
        "Generated by `make docs` from the runner's registries and the official XSD of OpenSCENARIO XML 1.3.1; a test",
        "fails when this page, the registries and the XSD disagree. Files of 1.0, 1.1 and 1.2 are read in their own forms.",
        "What is refused is refused before the run, by name, file and line. Nothing is skipped.",
        "",
        f"{executed} of {len(total)} elements are executed here; esmini 3.6.0 executes {full} in full and {part} in part.",
    ]
    for title, section in sections:
        lines += ["", f"## {title}", "", "| element | here | what it does | esmini 3.6.0 |", "|---|---|---|---|"]
        lines += [f"| {row.name} | {row.status} | {row.note} | {ESMINI.get(row.name, 'yes')} |" for row in section]
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
