"""Signal controllers that are referred to exist."""

from collections.abc import Iterator

from schemas.checks.document import Document
from schemas.checks.messages import unresolved
from schemas.checks.registry import Finding, rule


@rule(
    "asam.net:xosc:1.2.0:reference_control.resolvable_traffic_signal_controller_by_traffic_signal_controller_ref",
    kinds=("scenario",),
)
def check(document: Document) -> Iterator[Finding]:
    """A trafficSignalControllerRef must name a TrafficSignalController of the scenario's RoadNetwork."""
    controllers = document.names("TrafficSignalController")
    return unresolved(document, "traffic signal controller", controllers, "trafficSignalControllerRef")
