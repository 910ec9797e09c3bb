"""Changes of scenarios and roads that leave the behaviour as it is: files to be
played beside the originals.

Each rewrites a scenario of the library and its road into a folder. `moved` and `mirrored` return
the map of the plane by which trajectories change; the others change none.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

from lxml import etree

from tests.oracles.mutants import LIBRARY

Point = tuple[float, float]
PlaneMap = Callable[[float, float], Point]
ANGLE, SHIFT = 0.7, (1234.5, -678.25)
"""Turn (rad) and shift (m) of moved roads"""


def same(x: float, y: float) -> Point:
    """The map of changes that move nothing."""
    return x, y


def renamed(scenario: etree._Element, road: etree._Element) -> PlaneMap:
    """Give all entities but the ego names that sort the other way round."""
    found = [each.get("name", "") for each in scenario.iter("ScenarioObject")]
    others = [name for name in sorted(found, reverse=True) if name != "Ego"]
    names = {name: f"Other_{number}" for number, name in enumerate(others)}
    for each in scenario.iter(etree.Element):
        for attribute in ("entityRef", "name") if each.tag == "ScenarioObject" else ("entityRef",):
            value = each.get(attribute)
            if value in names:
                each.set(attribute, names[value])
    return same


def reordered(scenario: etree._Element, road: etree._Element) -> PlaneMap:
    """Declare entities in the opposite order, and parameters too where none refers to another."""
    holders = scenario.findall("Entities") + scenario.findall("ParameterDeclarations")
    for holder in holders:
        children = list(holder.iterchildren(etree.Element))
        if not any("$" in child.get("value", "") for child in children):
            holder[:] = children[::-1]
    return same


def moved(scenario: etree._Element, road: etree._Element) -> PlaneMap:
    """Turn and move the road, and positions of the world with it."""
    cos, sin = math.cos(ANGLE), math.sin(ANGLE)

    def place(x: float, y: float) -> Point:
        return cos * x - sin * y + SHIFT[0], sin * x + cos * y + SHIFT[1]

    for each in road.iter("geometry"):
        x, y = place(float(each.get("x", "")), float(each.get("y", "")))
        each.set("x", repr(x))
        each.set("y", repr(y))
        each.set("hdg", repr(float(each.get("hdg", "")) + ANGLE))
    for each in scenario.iter("WorldPosition"):
        x, y, h = (_inner(each.get(name, "0")) for name in ("x", "y", "h"))
        each.set("x", f"${{{cos!r}*({x})-{sin!r}*({y})+({SHIFT[0]!r})}}")
        each.set("y", f"${{{sin!r}*({x})+{cos!r}*({y})+({SHIFT[1]!r})}}")
        each.set("h", f"${{({h})+{ANGLE!r}}}")
    return place


_ROAD_SIGNS = {
    "geometry": ("y", "hdg"),
    "arc": ("curvature",),
    "spiral": ("curvStart", "curvEnd"),
    "laneOffset": ("a", "b", "c", "d"),
    "lane": ("id",),
    "predecessor": ("id",),
    "successor": ("id",),
    "laneLink": ("from", "to"),
}
_SCENARIO_SIGNS = {
    "LanePosition": ("laneId", "offset"),
    "RelativeLanePosition": ("dLane", "offset"),
    "RelativeTargetLane": ("value",),
    "AbsoluteTargetLane": ("value",),
    "RoadPosition": ("t",),
    "WorldPosition": ("y", "h"),
    "Orientation": ("h",),
}


def mirrored(scenario: etree._Element, road: etree._Element) -> PlaneMap:
    """Mirror road and scenario at the x axis: traffic keeps to the left."""
    for each in road.iter("road"):
        each.set("rule", "LHT" if each.get("rule", "RHT") == "RHT" else "RHT")
    for section in road.iter("laneSection"):
        sides = {name: section.find(name) for name in ("left", "right")}
        for name, side in sides.items():
            if side is not None:
                side.tag = "right" if name == "left" else "left"
                side[:] = list(side)[::-1]
        section[:] = sorted(section, key=lambda e: ("left", "center", "right").index(str(e.tag)))
    for element in road.iter(*_ROAD_SIGNS):
        parent = element.getparent()
        if element.tag in ("predecessor", "successor") and parent.getparent().tag != "lane":  # type: ignore[union-attr]
            continue  # of a road
        _negate(element, _ROAD_SIGNS[str(element.tag)])
    for element in scenario.iter(*_SCENARIO_SIGNS):
        _negate(element, _SCENARIO_SIGNS[str(element.tag)])
    return lambda x, y: (x, -y)


def _negate(element: etree._Element, names: tuple[str, ...]) -> None:
    for name in names:
        value = element.get(name)
        if value is None:
            continue
        try:
            number = -float(value)
        except ValueError:
            element.set(name, f"${{-({_inner(value)})}}")
        else:
            element.set(name, str(int(number)) if value.lstrip("+-").isdigit() else repr(number))


def _inner(value: str) -> str:
    """A value as a part of an expression."""
    return value[2:-1] if value.startswith("${") else value


CHANGES = {change.__name__: change for change in (renamed, reordered, moved, mirrored)}


def names() -> list[str]:
    """Scenarios of the library that have a road of its maps."""
    found = [path for path in sorted(LIBRARY.glob("*.xosc")) if "_variation" not in path.name]
    return [path.stem for path in found if b"LogicFile" in path.read_bytes()]


def applies(change: str, name: str) -> bool:
    """Whether a change reaches all of a scenario: routes of catalogues are not mirrored."""
    text = (LIBRARY / f"{name}.xosc").read_bytes()
    return change != "mirrored" or b"<RouteCatalog>" not in text or b"AssignRoute" not in text


def write(name: str, change: str, folder: Path) -> tuple[Path, PlaneMap]:
    """Write a changed scenario of the library with its road; the path, and the map of the plane."""
    scenario = etree.parse(LIBRARY / f"{name}.xosc").getroot()
    (logic,) = scenario.iter("LogicFile")
    road = etree.parse((LIBRARY / logic.get("filepath", "")).resolve()).getroot()
    mapped = CHANGES[change](scenario, road)
    logic.set("filepath", "road.xodr")
    for directory in scenario.iter("Directory"):
        directory.set("path", str((LIBRARY / directory.get("path", "")).resolve()))
    folder.mkdir(parents=True, exist_ok=True)
    etree.ElementTree(road).write(folder / "road.xodr")
    path = folder / f"{name}.xosc"
    etree.ElementTree(scenario).write(path)
    return path, mapped
