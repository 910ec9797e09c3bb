"""Signals that actions set exist."""

from collections.abc import Iterator

from schemas.checks.document import Document
from schemas.checks.messages import unknown
from schemas.checks.registry import Finding, rule


@rule("asam.net:xosc:1.2.0:reference_control.resolvable_signal_id_in_traffic_signal_state_action", kinds=("scenario",))
def check(document: Document) -> Iterator[Finding]:
    """The name of a TrafficSignalStateAction must be the id of a signal in the road network."""
    network = document.road_network
    for element in document.elements("TrafficSignalStateAction") if network else ():
        name = document.value(element, "name")
        if network and name is not None and name not in network.signals:
            yield Finding(element, f"name: {unknown('signal', name, network.signals)} in {network.path.name}")
