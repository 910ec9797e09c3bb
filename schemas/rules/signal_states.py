"""Signals that phases and conditions name exist."""

from collections.abc import Iterator

from schemas.checks.document import Document
from schemas.checks.messages import unknown
from schemas.checks.registry import Finding, rule

UID = "asam.net:xosc:1.0.0:reference_control.traffic_signal_state_references"

_REFERENCES = (("TrafficSignalState", "trafficSignalId"), ("TrafficSignalCondition", "name"))


@rule(UID, kinds=("scenario",))
def check(document: Document) -> Iterator[Finding]:
    """The signals of a TrafficSignalState and of a TrafficSignalCondition must exist in the road network."""
    network = document.road_network
    if network is None:
        return
    for tag, attribute in _REFERENCES:
        for element in document.elements(tag):
            name = document.value(element, attribute)
            if name is not None and name not in network.signals:
                yield Finding(element, f"{attribute}: {unknown('signal', name, network.signals)} in {network.path.name}")
