"""Road coordinates need roads."""

from collections.abc import Iterator

from schemas.checks.document import Document
from schemas.checks.registry import Finding, rule
from schemas.xml import local_name

_ROAD_POSITIONS = ("LanePosition", "RoadPosition", "RelativeLanePosition", "RelativeRoadPosition")


@rule("asam.net:xosc:1.0.0:scenario_logic.invalid_elements_if_no_road_network", kinds=("scenario",))
def check(document: Document) -> Iterator[Finding]:
    """Positions in road or lane coordinates need a road network (LogicFile)."""
    if document.elements("LogicFile"):
        return
    for element in document.elements(*_ROAD_POSITIONS):
        yield Finding(element, f"{local_name(element)} needs a road network, the scenario has no LogicFile")
