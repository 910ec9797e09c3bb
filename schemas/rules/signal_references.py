"""Signals that phases, conditions and actions name exist."""

from collections.abc import Iterator

from schemas.checks.document import Document
from schemas.checks.messages import unknown
from schemas.checks.registry import Finding, rule

UID = "asam.net:xosc:1.0.0:reference_control.traffic_signal_state_references"


@rule(UID, kinds=("scenario",))
def check(document: Document) -> Iterator[Finding]:
    """The signals of a TrafficSignalState and of a TrafficSignalCondition must exist in the road network."""
    yield from _unknown(document, "TrafficSignalState", "trafficSignalId")
    yield from _unknown(document, "TrafficSignalCondition", "name")


@rule("asam.net:xosc:1.2.0:reference_control.resolvable_signal_id_in_traffic_signal_state_action", kinds=("scenario",))
def check_actions(document: Document) -> Iterator[Finding]:
    """The name of a TrafficSignalStateAction must be the id of a signal in the road network."""
    yield from _unknown(document, "TrafficSignalStateAction", "name")


def _unknown(document: Document, tag: str, attribute: str) -> Iterator[Finding]:
    network = document.road_network
    for element in document.elements(tag) if network else ():
        name = document.value(element, attribute)
        if network and name is not None and name not in network.signals:
            yield Finding(element, f"{attribute}: {unknown('signal', name, network.signals)} in {network.path.name}")
